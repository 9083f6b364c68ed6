"""A pressure that follows the border within a step (Nanson: n dA = cof(f) n0 dA0, f = I + grad u).

    f_i = - p sum_b N_i cof(f) n0 dA0

At small strain it is a dead load. In axisymmetry dA contains 2 pi (r + u_r).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Indices, of_components
from tawami.border.points import transformed
from tawami.field.border import BorderInCells
from tawami.field.layout import Layout


class FollowerPressure:
    """A pressure on border points, as forces that depend on the displacement (`tawami.solve.terms`).

    Each rank evaluates the points in its cells.

    Args:
        layout: Places of the coefficients.
        cells: The points in the cells.
        x: Positions at the start of the step [m], points x dim.
        area: Outward normals times lengths in the plane then [m], points x dim.
        pressure: At each point [Pa].
        rate: Pressure per load factor of a path [Pa].
    """

    #: It prescribes no displacement.
    prescribed = 0.0

    def __init__(
        self,
        layout: Layout,
        cells: BorderInCells,
        x: Array,
        area: Array,
        pressure: Array,
        rate: Array | float = 0.0,
    ) -> None:
        self._layout, self._space = layout, layout.grid.space
        #: Whether it changes along a path.
        self.grows = bool(np.any(rate))
        mine = cells.own
        self._x, self._area, self._start = x[mine], area[mine], pressure[mine]
        self._pressure, self._rate = self._start, np.broadcast_to(rate, pressure.shape)[mine]
        self._tabulated = cells.of_rank.tabulated(layout.basis)

    def load(self, share: float) -> None:
        """Add a share of the loads of a path to the pressure at the start of the step."""
        self._pressure = self._start + share * self._rate

    def accept(self) -> None:
        """See `Term`: there is nothing to keep."""

    def _at(self, coefficients: Array) -> tuple[Array, Array, Array]:
        """f^-T and cof(f) n0 dA0 in the plane at the points, and their thickness."""
        numbers, values, gradients = self._tabulated
        u = self._space.vectors(coefficients[: self._layout.num_displacement])[numbers]
        f = np.einsum("pfi,pfj->pij", u, gradients) + np.eye(self._space.dim)
        inverse = np.linalg.inv(f).transpose(0, 2, 1)
        moved = self._x + np.einsum("pf,pfi->pi", values, u)
        return inverse, transformed(self._area, f), self._space.thickness(moved)

    def forces(self, coefficients: Array) -> Array:
        """See `Term`."""
        self._inverse, self._now, self._thickness = self._at(coefficients)
        return self._of(self._pressure)

    @property
    def rate(self) -> Array:
        """Derivative of the last forces by the load factor of a path."""
        return self._of(self._rate)

    def _of(self, pressure: Array) -> Array:
        """Forces of a pressure at the last displacement, as :meth:`forces`."""
        numbers, values, _ = self._tabulated
        on_points = -(pressure * self._thickness)[:, None] * self._now
        forces = np.zeros(self._layout.size)
        np.add.at(
            forces, of_components(numbers, self._space.dim), values[:, :, None] * on_points[:, None]
        )
        return forces

    def stiffness(self, far: Indices) -> sp.csr_matrix:
        """See `Term`: d(cof(f) a)_i = (B_jl b_i - B_il b_j) df_jl, B = f^-T and b = cof(f) a."""
        numbers, values, gradients = self._tabulated
        slope = np.einsum("pjl,pi->pijl", self._inverse, self._now)
        slope -= np.einsum("pil,pj->pijl", self._inverse, self._now)
        by_u = np.einsum("pijl,pgl->pijg", slope, gradients) * self._thickness[:, None, None, None]
        if self._space.hoop:
            by_u[:, :, 0] += 2 * np.pi * self._now[:, :, None] * values[:, None]
        local = np.einsum("p,pf,pijg->pfigj", self._pressure, values, by_u)
        size = self._layout.size + len(far)
        width = self._space.dim * numbers.shape[1]
        of = of_components(numbers, self._space.dim).reshape(len(numbers), width)
        rows, columns = np.repeat(of, width, axis=1), np.tile(of, width)
        entries = (local.ravel(), (rows.ravel(), columns.ravel()))
        return sp.coo_matrix(entries, shape=(size, size)).tocsr()
