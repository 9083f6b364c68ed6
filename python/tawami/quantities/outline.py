"""The border of a body at the end of a step, for pictures and files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.border.curves import left
from tawami.border.points import BorderPoints
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints
from tawami.field.border import BorderInCells

#: Ends of the side of a point, in units of its length.
ENDS = np.array([-0.5, 0.5])


class Outline:
    """The border of a body as it is now: one side for each of its points, as long as the point counts.

    Making it is a call for all ranks.

    Args:
        points: All points of the border.
        domain: The particles at the end of the step.
        coefficients: Of all fields since the start, where particles do not move.

    Attributes:
        x: Positions of the points, at small strain those at the start [m].
        area: Outward normals times lengths there [m].
        part: Number of the part of the border of each point.
    """

    def __init__(self, points: MovingPoints, domain: Domain, coefficients: Array) -> None:
        self._made, self.x, self.area = points.made, points.x, points.area
        self.part = self._made.tag
        #: Displacements of the points and their gradients, where particles do not move.
        self._static = (
            None if domain.model.moves else _at_points(domain, self.x, self._made, coefficients)
        )

    def sides(self, deformed: float = 1.0) -> Array:
        """Ends of the sides with enlarged displacements [m], points x 2 x dim.

        Args:
            deformed: Factor on the displacements.
        """
        start = _sides(self._made.x, self._made.length[:, None] * self._made.normal)
        return start + deformed * self._displacements(start)

    def displacements(self) -> Array:
        """Displacements of the ends of the sides since the start [m], points x 2 x dim."""
        start = _sides(self._made.x, self._made.length[:, None] * self._made.normal)
        return self._displacements(start)

    def _displacements(self, start: Array) -> Array:
        if self._static is None:
            return _sides(self.x, self.area) - start
        displacement, gradient = self._static
        offset = np.einsum("nij,nkj->nki", gradient, start - self.x[:, None])
        return np.asarray(displacement[:, None] + offset)

    def tractions(self, acting: Sequence[tuple[MovingPoints, Array]]) -> Array:
        """Sum of tractions of loads and supports at the points [Pa], points x dim.

        Args:
            acting: Points of each load or support, and its tractions there, points x dim.
        """
        total = np.zeros_like(self.x)
        if acting:
            from scipy.spatial import KDTree  # takes long to import
        apart = 2 * np.ptp(self.x)  # parts do not meet at their corners
        for points, tractions in acting:
            tree = KDTree(np.column_stack([points.x, apart * points.made.tag]))
            distance, nearest = tree.query(np.column_stack([self.x, apart * self.part]))
            near = distance <= points.length[nearest] / 2
            total[near] += tractions[nearest[near]]
        return total


def _sides(x: Array, area: Array) -> Array:
    """Straight sides through points, across their normals, points x 2 x dim."""
    return np.asarray(x[:, None] + ENDS[:, None] * left(area)[:, None])


def _at_points(
    domain: Domain, x: Array, made: BorderPoints, coefficients: Array
) -> tuple[Array, Array]:
    """Displacements at points of the border, and their gradients; a call for all ranks."""
    grid, layout, dim = domain.model.grid, domain.layout, domain.model.space.dim
    cells = BorderInCells(grid, domain.active, x, made.normal, torn=True)
    u = np.ascontiguousarray(coefficients[: layout.num_displacement])
    found = np.zeros((len(x), dim + dim**2))
    location = cells.of_rank.location
    gradients = domain.model.space.in_space(
        domain.model.space.gradients(_rust.gradients(location, layout.basis, u))
    )
    found[cells.own, :dim] = _rust.interpolate(location, layout.basis, dim, u)
    found[cells.own, dim:] = gradients.reshape(len(location), dim**2)
    ranks.sum_of(grid.comm, found)
    return found[:, :dim], found[:, dim:].reshape(-1, dim, dim)
