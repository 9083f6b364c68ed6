"""Unknowns of a rank: those that it owns, and others that its coefficients depend on."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.exchange import Exchange
from tawami.base.petsc import aij, rows_of
from tawami.base.rows import Rows
from tawami.field.layout import Layout


class Unknowns:
    """Unknowns of all fields, or of one: coefficients = S unknowns.

    Unknowns are numbered rank by rank.

    Attributes:
        layout: Places of the coefficients.
        number: Number over all ranks of each unknown that this rank knows; its own come first,
            ascending.
        place: Coefficient that each of them is; -1 outside the window.
        selection: S, coefficients x known unknowns.
        size: Number of unknowns of all ranks.
        own: Numbers of the unknowns whose rows belong to this rank.
        coefficients: Coefficient that each of this rank's unknowns is.
    """

    selection: sp.csr_matrix

    def _set(self, layout: Layout, number: Indices, place: Indices, own: slice, size: int) -> None:
        self.layout, self._comm = layout, layout.grid.comm
        self.number, self.place, self.own, self.size = number, place, own, size
        self.coefficients = place[: self.num_own]
        if self._comm.size == 1:
            owner = np.zeros(0, dtype=np.int64)
        else:
            ends = np.array(self._comm.allgather(own.stop))
            owner = np.searchsorted(ends, number, side="right")
        self.exchange = Exchange.of(
            self._comm, owner, lambda places: number[places], lambda numbers: numbers - own.start
        )

    @property
    def num_own(self) -> int:
        """Number of unknowns whose rows belong to this rank."""
        return int(self.own.stop - self.own.start)

    def known(self, own: Array) -> Array:
        """Values of all unknowns that this rank knows, from those of its own; a collective call."""
        if len(self.number) == self.num_own and self._comm.size == 1:
            return own
        values = np.zeros(len(self.number), dtype=own.dtype)
        values[: self.num_own] = own
        return self.exchange.update(values)

    @functools.cached_property
    def _transposed(self) -> sp.csc_matrix:
        return self.selection.T

    def same_unknowns(self, other: Any) -> bool:
        """Whether others have the same S, so that matrices are alike; a collective call."""
        return False

    def reached_by(self, cells: Any) -> Mask:
        """Whether each coefficient belongs to a function with one of these cells in its support."""
        return self.layout.reached_by(cells)

    # -- matrices ------------------------------------------------------------------

    def reduced(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """S^T A S in the unknowns that this rank knows, A on the coefficients of the window."""
        return (self._transposed @ matrix @ self.selection).tocsr()

    def of_window(self, matrix: sp.csr_matrix, far: Indices | None = None) -> sp.csr_matrix:
        """This rank's rows of S^T A S, A the sum over the ranks of matrices on their windows.

        A collective call.

        Args:
            matrix: That of this rank.
            far: Numbers in the whole grid of coefficients that follow those of the window in it; None
                on all ranks if no rank has any.
        """
        if self._comm.size == 1:
            return self.reduced(matrix)
        if far is None:
            part, number = self.reduced(matrix), self.number
        else:
            s, number = self._wider(far)
            part = _product(s, matrix).tocsr()
        own = (self.num_own, self.size)
        numbers = PETSc.LGMap().create(number.astype(PETSc.IntType), comm=self._comm)
        # by name: their position depends on the version of petsc4py
        unassembled = PETSc.Mat().createIS(
            (own, own), lgmapr=numbers, lgmapc=numbers, comm=self._comm
        )
        local = aij(PETSc.COMM_SELF, part, len(number))
        unassembled.setISLocalMat(local)
        unassembled.assemble()
        found = unassembled.convert("aij", PETSc.Mat())
        rows = rows_of(found)
        for handle in (numbers, local, unassembled, found):
            handle.destroy()
        return rows

    def of_constraints(self, gradients: Rows) -> Rows:
        """B S, constraints x unknowns of all ranks; a collective call.

        Args:
            gradients: The columns of B of this rank's coefficients; the others are zero.
        """
        found = (gradients.csr @ self.selection).tocoo()
        shape, number = (gradients.shape[0], self.size), self.number[found.col]
        return Rows.gathered(self._comm, found.row, number, found.data, shape)

    def _wider(self, far: Indices) -> tuple[sp.csr_matrix, Indices]:
        """S with further rows, of coefficients with these numbers in the whole grid, and the numbers of
        its columns; a collective call.
        """
        in_grid = np.unique(ranks.allgathered(self._comm, far))
        place = self._places_of(in_grid)
        mine = np.flatnonzero(place >= 0)
        mine = mine[self.layout.own[self._first + place[mine]]]
        rows = self.selection[place[mine]].tocoo()
        of, number, weight = (
            ranks.allgathered(self._comm, part)
            for part in (in_grid[mine[rows.row]], self.number[rows.col], rows.data)
        )
        asked = np.isin(of, far)
        row, others = np.searchsorted(far, of[asked]), number[asked]
        numbers = np.concatenate([self.number, np.setdiff1d(others, self.number)])
        order = np.argsort(numbers)
        column = order[np.searchsorted(numbers, others, sorter=order)]
        known = self.selection.tocoo()
        top, shape = known.shape[0], (known.shape[0] + len(far), len(numbers))
        parts = ((known.data, weight[asked]), (known.row, top + row), (known.col, column))
        data, at, of_number = (np.concatenate(part) for part in parts)
        return sp.csr_matrix((data, (at, of_number)), shape=shape), numbers

    #: First coefficient of the rows of S.
    _first = 0

    def _places_of(self, in_grid: Indices) -> Indices:
        """Rows of S of coefficients of the whole grid; -1 outside the window."""
        return self.layout.places(in_grid)


def _product(s: sp.csr_matrix, matrix: sp.csr_matrix) -> sp.coo_matrix:
    """S^T A S; if the entries of S are single ones, with an entry for each of A, zeros too."""
    count = np.diff(s.indptr)
    if count.max(initial=0) > 1 or (s.data != 1.0).any():
        return (s.T @ matrix @ s).tocoo()
    column = np.full(s.shape[0], -1)
    column[count > 0] = s.indices
    entries = matrix.tocoo()
    row, col = column[entries.row], column[entries.col]
    kept = (row >= 0) & (col >= 0)
    return sp.coo_matrix((entries.data[kept], (row[kept], col[kept])), shape=(s.shape[1],) * 2)
