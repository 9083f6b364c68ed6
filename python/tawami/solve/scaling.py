"""Scaling of the unknowns: displacement by its stiffness, eps_v and p as p/mu (docs: theory), any other
field by its own stiffness and its coupling with the displacement.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array, Indices
from tawami.base.petsc import aij, diagonal_of, rows_of
from tawami.field.layout import Layout
from tawami.field.reduction import Reduction
from tawami.particles.responses import Responses

#: Share of the area of a cell below which the volume of a function counts as zero: far below that of a
#: particle on the edge of the function, whose stiffness the assembly computes to round-off.
LEAST = 1e-60


class Scaling:
    """Scale and kind of the unknowns of a tangent.

    Args:
        layout: Places of the coefficients.
        responses: The particles.
    """

    def __init__(self, layout: Layout, responses: Responses) -> None:
        self._layout, self._responses = layout, responses

    def factors(self, matrix: Any, reduction: Reduction) -> Array:
        """Factors of this rank's unknowns; a collective call.

        Displacement is divided by the square root of the diagonal. eps_v and p are solved for as p/mu,
        divided by the square root of mu sum_p V_p M^2, the size of their coupling with the scaled
        displacement, or of their diagonal if that is larger. Other fields are multiplied by the scale
        that they declare, or divided by the square root of their diagonal, or of that coupling.
        """
        own = reduction.coefficients
        of_u = own < self._layout.num_displacement
        diagonal = diagonal_of(matrix)
        # A softening law makes negative diagonals. The solver reports a zero one (a function without
        # stiffness), in a scale that does not depend on units.
        size = np.abs(np.where(of_u, diagonal, 0.0))
        scale: Array = 1 / np.sqrt(np.where(size > 0, size, self._responses.largest_mu))
        volumetric = self._layout.volumetric
        if volumetric is not None:
            mine = volumetric.holds(own)
            scale[mine] = self._of_volume(own[mine] - volumetric.start, diagonal[mine])
        others = self._responses.form.own_fields
        coupling = None
        for name, field in others.items():
            mine = self._layout.fields[name].holds(own)
            if field.scale is not None:
                scale[mine] = field.scale
                continue
            if coupling is None:
                coupling = self._coupling(matrix, reduction, np.where(of_u, scale, 0.0))
            size = np.maximum(np.abs(diagonal[mine]), coupling[mine])
            largest = ranks.largest(self._layout.grid.comm, float(size.max(initial=0.0)))
            scale[mine] = 1 / np.sqrt(np.where(size > 0, size, largest or 1.0))
        return scale

    def _coupling(self, matrix: Any, reduction: Reduction, of_u: Array) -> Array:
        """Size of the entries that couple each of this rank's unknowns with the scaled displacement.

        It is the product of the norms of row and column, which depends on units as the diagonal does.

        Args:
            of_u: Factors of this rank's unknowns that belong to the displacement; zero for others.
        """
        rows = rows_of(matrix)
        squares = aij(self._layout.grid.comm, rows.multiply(rows), reduction.num_own)
        scales, along, columns = (squares.createVecLeft() for _ in range(3))
        scales.setArray(of_u**2)
        squares.mult(scales, along)
        squares.multTranspose(scales, columns)
        found = np.sqrt(along.array * columns.array)
        for handle in (scales, along, columns, squares):
            handle.destroy()
        return np.asarray(found)

    def _of_volume(self, functions: Indices, diagonal: Array) -> Array:
        """Factors of eps_v or p of some bilinear functions."""
        bulk, mu = (self._responses.constants[name] for name in ("K", "mu"))
        sums = self._sums(np.column_stack([np.ones_like(mu), 1 / bulk, 1 / mu]))
        volume, over_bulk, over_mu = sums[functions].T
        grid = self._layout.grid
        least = LEAST * grid.space.measure(grid.h)
        volume = np.maximum(volume, least)
        mu_i = volume / np.maximum(over_mu, least / self._responses.largest_mu)
        has_eps_v = self._responses.form.kinematics.has_eps_v
        to_field = mu_i * over_bulk / volume if has_eps_v else mu_i
        to_field = np.where(to_field > 0, to_field, 1)
        squares = self._sums(np.ones((len(mu), 1)), squared=True)[functions, 0]
        # in a cell with little of the body the stabilisation is larger than that volume
        size = np.maximum(mu_i * np.maximum(squares, least), to_field**2 * np.abs(diagonal))
        return np.asarray(to_field / np.sqrt(size))

    def _sums(self, columns: Array, *, squared: bool = False) -> Array:
        """Volume-weighted sums over the body on bilinear functions, or their squares."""
        location, volume = self._responses.location, self._responses.particles.volume
        of = self._layout.functions
        return of.sums(location, volume, columns, "bilinear", squared=squared)
