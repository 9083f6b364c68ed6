"""The part of the grid that a rank knows: its cells and those around them."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.exchange import Exchange, Places, Values
from tawami.base.space import lattice
from tawami.grid.basis import Basis, greville_1d
from tawami.grid.division import Division

#: Cells around those of a rank: a function on a cell next to them has its whole support in the window.
RING = 3


class Window:
    """The smallest box of cells around those of this rank, with `RING` more on each side.

    Cells and functions of the window have numbers of their own, x fastest, as those of the whole grid.
    At its ends functions have no meaning, unless the grid ends there too. On one rank it is the grid.

    Args:
        comm: Communicator.
        origin, h: Lower left corner [m] and side of a cell [m] of the grid.
        rust: The grid for `_rust`.
        division: Cells of each rank.

    Attributes:
        first: Its first cell along each axis.
        cells: Its number of cells along each axis.
        rust: The same for `_rust`.
        rank_of_cell: Rank that owns each of its cells.
        of_cells: The exchange of values of its cells.
    """

    def __init__(
        self, comm: Any, origin: Sequence[float], h: float, rust: _rust.Grid, division: Division
    ) -> None:
        self._comm, self._origin, self._h, self._whole = comm, origin, h, division.cells
        low, high = division.lower, division.upper
        some = (low < high).all(axis=1)[:, None]
        most = np.array(self._whole)
        begin = np.where(some, np.maximum(low - RING, 0), 0)
        end = np.where(some, np.minimum(high + RING, most), np.minimum(1 + RING, most))
        first, last = begin[comm.rank], end[comm.rank]
        self.first: tuple[int, ...] = tuple(first.tolist())
        self.cells: tuple[int, ...] = tuple((last - first).tolist())
        self.rust = rust.window(list(self.first), list(self.cells))
        self.rank_of_cell: Indices = np.full(math.prod(self.cells), comm.rank, dtype=np.int64)
        copies = self._common(low, high, first, last)
        for rank, places in copies.items():
            self.rank_of_cell[places] = rank
        self.of_cells = Exchange(
            comm, copies, self._common(begin, end, low[comm.rank], high[comm.rank])
        )

    def _common(self, low: Indices, high: Indices, first: Indices, last: Indices) -> Places:
        """Cells of this window in a box of each other rank and in a box of this one, by rank."""
        low, high = np.maximum(low, first), np.minimum(high, last)
        found: Places = {}
        for rank in np.flatnonzero((low < high).all(axis=1)).tolist():
            if rank != self._comm.rank:
                along = [np.arange(*ends) for ends in zip(low[rank], high[rank], strict=True)]
                found[rank] = self.numbers(lattice(along))
        return found

    # -- cells -------------------------------------------------------------------

    def numbers(self, index: Indices) -> Indices:
        """Numbers in the window of cells, given their indices (i, j) in the grid."""
        return np.asarray((index - np.array(self.first)) @ _strides(self.cells))

    def indices(self, number: Any) -> Indices:
        """Indices (i, j) in the grid of cells, given their numbers in the window."""
        return np.asarray(_indices(number, self.cells) + np.array(self.first))

    def cells_in_grid(self, number: Any) -> Indices:
        """Numbers in the grid of cells, given their numbers in the window."""
        return np.asarray(self.indices(number) @ _strides(self._whole))

    def found(self, index: Indices) -> Indices:
        """Numbers in the window of cells of this rank, given indices (i, j) or numbers in the grid.

        It is -1 for other cells.
        """
        if index.ndim == 1:
            index = _indices(index, self._whole)
        end = np.add(self.first, self.cells)
        number = np.full(len(index), -1)
        inside = np.flatnonzero(((index >= self.first) & (index < end)).all(axis=1))
        here = self.numbers(index[inside])
        own = self.own[here]
        number[inside[own]] = here[own]
        return number

    def place(self, location: _rust.Location) -> _rust.Location:
        """The same points in cells of the window, given those in cells of the whole grid."""
        if self.cells == self._whole:
            return location
        index = _indices(location.cell.astype(np.int64), self._whole)
        return self.rust.place(self.numbers(index).astype(np.uint32), np.asarray(location.xi))

    def whole(self, values: Values) -> Values:
        """Values of all cells of the grid, on every rank, from those of this rank's cells; a collective
        call.
        """
        if self._comm.size == 1:
            return values
        own = np.flatnonzero(self.own)
        size, place = math.prod(self._whole), self.cells_in_grid(own)
        found = ranks.scattered(self._comm, size, place, values[own])
        return found  # type: ignore[return-value]

    @functools.cached_property
    def own(self) -> Mask:
        """Whether each cell belongs to this rank."""
        return np.asarray(self.rank_of_cell == self._comm.rank)

    @functools.cached_property
    def vertices(self) -> Indices:
        """Numbers in the window of this rank's vertices: those of its cells at their lower ends, and at
        both ends where the grid ends.
        """
        at = _indices(np.arange(math.prod(self.shape("bilinear"))), self.shape("bilinear"))
        cell = np.minimum(at + np.array(self.first), np.array(self._whole) - 1)
        return np.flatnonzero(self.found(cell) >= 0)

    # -- functions ---------------------------------------------------------------

    def shape(self, basis: Basis) -> tuple[int, ...]:
        """Number of functions of a basis along each axis."""
        return tuple(_rust.basis_len(basis, n) for n in self.cells)

    def first_function(self, basis: Basis) -> Indices:
        """Index in the grid of the first function along each axis."""
        return np.array(self.first) * (2 if basis == "biquadratic" else 1)

    def in_grid(self, basis: Basis, function: Any) -> Indices:
        """Numbers of functions in the grid, given those in the window."""
        at = _indices(function, self.shape(basis))
        whole = [_rust.basis_len(basis, n) for n in self._whole]
        return np.asarray((at + self.first_function(basis)) @ _strides(whole))

    def functions(self, basis: Basis, number: Any) -> Indices:
        """Numbers of functions in the window, given those in the grid; -1 outside the window."""
        whole = [_rust.basis_len(basis, n) for n in self._whole]
        at = _indices(number, whole) - self.first_function(basis)
        shape = self.shape(basis)
        inside = ((at >= 0) & (at < shape)).all(axis=-1)
        return np.where(inside, at @ _strides(shape), -1)

    def has_support(self, basis: Basis) -> Mask:
        """Whether the whole support of each function is in the window."""
        margin = 2 if basis == "quadratic_spline" else 1
        along = []
        for n, first, cells, count in zip(
            self._whole, self.first, self.cells, self.shape(basis), strict=True
        ):
            whole = np.ones(count, dtype=bool)
            whole[: margin if first > 0 else 0] = False
            whole[count - margin if first + cells < n else count :] = False
            along.append(whole)
        return np.asarray(lattice(along).all(axis=1))

    def greville(self, basis: Basis) -> Array:
        """Greville points [m] of the functions, functions x axes."""
        along = []
        of_axes = zip(
            self._origin, self._whole, self.first_function(basis), self.shape(basis), strict=True
        )
        for origin, n, first, count in of_axes:
            along.append(origin + self._h * greville_1d(basis, n)[first : first + count])
        return lattice(along)


def _strides(shape: Any) -> Indices:
    return np.cumprod((1, *shape[:-1]))


def _indices(number: Any, shape: Sequence[int]) -> Indices:
    """Positions along each axis of numbers in a lattice of this shape, x fastest."""
    return np.stack(np.unravel_index(number, shape, order="F"), axis=-1)
