"""Forces of tractions on the edges of a grid."""

from __future__ import annotations

import numpy as np

from tawami.base.arrays import Array, Indices, Mask
from tawami.fem import dolfinx, mesh
from tawami.field.attachment import Attachment
from tawami.grid.grid import Edge


class Tractions:
    """The term of a form with the traction t, on edges of the grid.

    Only cells with particles are loaded.

    Args:
        attachment: The form and the active cells.
    """

    def __init__(self, attachment: Attachment) -> None:
        self._attachment, self._grid = attachment, attachment.grid

    def cells(self, edge: Edge) -> Indices:
        """Numbers along an edge of its cells with particles, on any rank."""
        axis, end = self._grid.edge(edge)
        return np.flatnonzero(np.take(self._attachment.active, end, axis=1 - axis))

    def nodes(self, edge: Edge) -> Array:
        """Positions [m] of the biquadratic nodes of an edge, cells x nodes x dim, on every rank."""
        axis, end = self._grid.edge(edge)
        along = self.cells(edge)
        ij = np.full((len(along), self._grid.space.dim), self._grid.cells[axis] - 1 if end else 0)
        ij[:, 1 - axis] = along
        nodes = self._grid.rectangle.to_grid_axes(dolfinx.reference_nodes(2))
        positions = ij[:, None, :] + nodes[self._on(edge)]
        return np.asarray(self._grid.origin + self._grid.h * positions)

    def forces(self, edge: Edge, values: Array) -> Array:
        """External forces on all coefficients [N per metre depth], on every rank.

        Args:
            edge: Name of the edge.
            values: Traction [Pa] at :meth:`nodes`, cells x nodes x dim.
        """
        attached, rectangle = self._attachment, self._grid.rectangle
        integral = attached.compiled.traction
        assert integral is not None
        axis, end = self._grid.edge(edge)
        ij, local = rectangle.ij, rectangle.facet_of_edge(edge)
        on_edge = ij[attached.cells, axis] == (self._grid.cells[axis] - 1 if end else 0)
        cells = attached.cells[on_edge]
        cells = cells[rectangle.facet_order(cells, local)]
        dim = self._grid.space.dim
        packed = np.zeros((len(cells), len(dolfinx.reference_nodes(2)), dim))
        packed[:, self._on(edge)] = values[np.searchsorted(self.cells(edge), ij[cells, 1 - axis])]
        packed = packed.reshape(len(cells), integral.width)
        form = attached.space.form(integral.kernel, 1, rectangle.entities(cells, local))
        vector = np.zeros(attached.space.size)
        mesh.add_vector(vector, form, integral.kernel, attached.constants(integral), packed)
        return -attached.summed(attached.layout.extraction_on(cells).T @ vector)

    def _on(self, edge: Edge) -> Mask:
        """The biquadratic nodes of a cell on its side towards an edge."""
        axis, end = self._grid.edge(edge)
        nodes = self._grid.rectangle.to_grid_axes(dolfinx.reference_nodes(2))
        return np.isclose(nodes[:, axis], 1.0 if end else 0.0)
