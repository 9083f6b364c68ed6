"""Border points in the cells of a grid: the functions of the grid there.

A point on a line of the grid belongs to the cell on the side of the body. One in a cell without
particles reads the polynomials of the nearest cell with particles: they still add up to 1 and are exact
for linear fields, so that no force and no moment of a load is lost.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import SupportError
from tawami.base.text import position
from tawami.field.functions import ActiveFunctions
from tawami.grid.basis import Basis
from tawami.grid.grid import Grid

#: Distance by which a point is moved into the body to find its cell [cells].
INWARD = 1e-6
#: Cells along each axis in which a cell with particles is sought.
REACH = 2


class PointsInCells:
    """Points in the cells of a grid.

    Args:
        grid: The grid.
        location: Cells and positions in them.
        cells: Numbers of cells along each axis of the part of the grid that these belong to; the whole
            grid by default.

    Attributes:
        grid, location: As given.
    """

    def __init__(
        self, grid: Grid, location: _rust.Location, cells: Sequence[int] | None = None
    ) -> None:
        self.grid, self.location = grid, location
        self._cells = grid.cells if cells is None else cells
        self._known: dict[Basis, tuple[Indices, Array, Array]] = {}

    def __len__(self) -> int:
        return len(self.location)

    def tabulated(self, basis: Basis) -> tuple[Indices, Array, Array]:
        """The functions on the cell of each point.

        Returns:
            Their numbers (points x functions), values, and gradients [1/m] (points x functions x dim).
        """
        if basis not in self._known:
            self._known[basis] = _rust.functions_at(self.location, basis)
        return self._known[basis]

    def values(self, basis: Basis) -> sp.csr_matrix:
        """The functions of a basis at the points, points x functions."""
        numbers, values, _ = self.tabulated(basis)
        return self._matrix(basis, numbers, values)

    def slopes(self, basis: Basis) -> list[sp.csr_matrix]:
        """Their derivatives along each axis [1/m], points x functions."""
        numbers, _, gradients = self.tabulated(basis)
        return [
            self._matrix(basis, numbers, gradients[..., axis])
            for axis in range(self.grid.space.dim)
        ]

    def _matrix(self, basis: Basis, numbers: Indices, values: Array) -> sp.csr_matrix:
        count = int(np.prod([_rust.basis_len(basis, n) for n in self._cells]))
        start = np.arange(0, numbers.size + 1, numbers.shape[1])
        entries = (np.ascontiguousarray(values).ravel(), numbers.ravel(), start)
        return sp.csr_matrix(entries, shape=(len(numbers), count))


class BorderInCells:
    """Points of a border in the cells of a grid. Making it is a collective call.

    The points are the same on every rank. Functions and fields at a point are evaluated by the rank that
    has its cell.

    Args:
        grid: The grid.
        active: Whether each cell of the window holds particles, on any rank, ny x nx.
        x: Positions [m], points x dim.
        normal: Outward unit normals, points x dim.
        where: Name of the border, for messages.
        torn: Whether points may have no particles near them, as after a body broke.

    Attributes:
        grid: The grid.
        location: Cells of the whole grid and positions in them.
        lost: Whether each point has no particles near it; its cell has no meaning then.

    Raises:
        SupportError: No cell near a point holds particles.
    """

    def __init__(
        self,
        grid: Grid,
        active: Mask,
        x: Array,
        normal: Array,
        where: str = "border",
        *,
        torn: bool = False,
    ) -> None:
        window = grid.window
        cell, self.lost = window.rust.near(
            grid.cells, active.ravel(), window.own, x, normal, INWARD, REACH
        )
        if grid.comm.size > 1:
            found = np.where(cell[:, None] >= 0, np.column_stack([cell, self.lost]), 0)
            cell, lost = np.ascontiguousarray(ranks.sum_of(grid.comm, found).T)
            self.lost = lost > 0
        if self.lost.any() and not torn:
            raise _far_from_particles(grid, x, self.lost, where)
        self.grid, self.location = grid, grid.rust.place_at(cell, x)

    def __len__(self) -> int:
        return len(self.location)

    @functools.cached_property
    def here(self) -> Indices:
        """Number of the cell of each point in the window of this rank, if it belongs to it; else -1."""
        return self.grid.window.found(self.location.cell.astype(np.int64))

    @functools.cached_property
    def own(self) -> Mask:
        """Whether the cell of each point belongs to this rank."""
        return np.asarray(self.here >= 0)

    def sums(self, functions: ActiveFunctions, basis: Basis, values: Array) -> Array:
        """Sums over all points of the functions of a basis times values; a collective call.

        Args:
            functions: The functions of the window.
            basis: The basis.
            values: Values at the points, points x columns.

        Returns:
            Functions of the window x columns.
        """
        mine = np.ascontiguousarray(values[self.own])
        return functions.sums(self.of_rank.location, np.ones(len(mine)), mine, basis)

    @functools.cached_property
    def of_rank(self) -> PointsInCells:
        """The points in cells of this rank, in its window."""
        window, cell = self.grid.window, self.here[self.own].astype(np.uint32)
        location = window.rust.place(cell, np.asarray(self.location.xi)[self.own])
        return PointsInCells(self.grid, location, window.cells)

    def on_all(self, of_rank: Array) -> Array:
        """Values at all points, from those at the points of each rank; a collective call."""
        if self.grid.comm.size == 1:
            return of_rank
        place = np.flatnonzero(self.own)
        return ranks.scattered(self.grid.comm, len(self), place, np.ascontiguousarray(of_rank))

    def at(self, basis: Basis, values: Array) -> Array:
        """A field at all points, points x columns; a collective call.

        Args:
            basis: Its functions.
            values: Of the functions of the window, functions x columns.
        """
        return self.on_all(np.asarray(self.of_rank.values(basis) @ values))

    def functions(self, basis: Basis, some: Indices) -> tuple[Indices, Array]:
        """Functions at some points: their numbers in the whole grid and their values.

        Args:
            basis: The basis.
            some: Numbers of the points, in cells of any rank.

        Returns:
            Points x functions, twice.
        """
        cell = self.location.cell[some]
        location = self.grid.rust.place(cell, np.asarray(self.location.xi)[some])
        numbers, values, _ = _rust.functions_at(location, basis)
        return numbers, values


def _far_from_particles(grid: Grid, x: Array, lost: Mask, where: str) -> SupportError:
    """The error for points without particles near them."""
    return SupportError(
        f"{where}: {lost.sum()} of {len(x)} points of the border are more than {REACH} cells from any "
        f"particle, the first at {position(x[lost][0])} m: expected the border of the body's particles"
    )
