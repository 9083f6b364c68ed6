"""Prolongation of the unknowns of a field from coarser grids (two-scale relation), grid by grid.

A rank has the functions of its own unknowns and of its held coefficients, by their numbers in the grid.
What other ranks know of a coarse function they tell a rank that its number determines, and ask it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices, sums_at
from tawami.base.exchange import Exchange
from tawami.base.petsc import aij
from tawami.grid.basis import Basis, refinement

#: Number of unknowns from which there is no coarser grid.
COARSEST = 300
#: Share of a coarse function on held functions from which the function is held.
HELD = 0.5
#: Coefficients whose rows are computed together: larger arrays cost new pages of memory.
TOGETHER = 4096


@dataclass(frozen=True)
class GridUnknowns:
    """Coefficients of a field on one grid, on this rank.

    Attributes:
        cells: Number of cells along each axis.
        unknowns: Its unknowns, by the numbers of the coefficients in the field, plus the part of the
            body times the number of all coefficients: each part has functions of its own.
        held: Its held coefficients.
    """

    cells: Sequence[int]
    unknowns: Indices
    held: Indices


def prolongations(comm: Any, basis: Basis, components: int, level: GridUnknowns) -> Iterator[Any]:
    """Matrices from the unknowns of a coarser grid to those of the next finer one, the finest first.

    A coarse cell is 2 x 2 fine ones; at the upper ends of a grid of odd size it may reach beyond. Every
    basis contains that of the coarser grid. Of a coarse function the part on unknowns counts. It is held
    if more than half of it is on held functions. It belongs to the first rank of its part. A collective
    call.

    Args:
        comm: Communicator.
        basis: Functions of the field.
        components: Components of each function.
        level: The finest grid.
    """
    size = ranks.total(comm, len(level.unknowns))
    while size > COARSEST and max(level.cells) > 1:
        step = _Step(comm, basis, components, level)
        coarse = ranks.total(comm, len(step.coarse.unknowns))
        if coarse >= size:
            return
        yield step.matrix
        level, size = step.coarse, coarse


def coarser(cells: Sequence[int]) -> tuple[int, ...]:
    """Size of the next coarser grid."""
    return tuple((n + 1) // 2 for n in cells)


class _Step:
    """From one grid to the next coarser one."""

    def __init__(self, comm: Any, basis: Basis, components: int, fine: GridUnknowns) -> None:
        self._comm, self._components = comm, components
        self._along = [refinement(basis, n) for n in fine.cells]
        self._padded = [_padded(matrix) for matrix in self._along]
        cells = coarser(fine.cells)
        self._fine = [_rust.basis_len(basis, n) for n in fine.cells]
        self._shape = [_rust.basis_len(basis, n) for n in cells]
        self._size = components * int(np.prod(self._shape))
        rows, reached, column, values = self._rows(fine.unknowns)
        owner = self._owners(reached, fine.held)
        used, mine = owner >= 0, owner == comm.rank
        own = reached[mine]
        start = int(sum(comm.allgather(len(own))[: comm.rank]))
        number = np.full(len(reached), -1)
        number[mine] = np.arange(start, start + len(own))
        Exchange.of(
            comm, owner, lambda places: reached[places], lambda n: np.searchsorted(reached, n)
        ).update(number)
        kept = used[column]
        size = ranks.total(comm, len(own))
        places = (rows[kept], number[column[kept]])
        part = sp.csr_matrix((values[kept], places), shape=(len(fine.unknowns), size))
        self.matrix = aij(comm, part, len(own))
        self.coarse = GridUnknowns(cells, own, self._held)

    def _rows(self, coefficients: Indices) -> tuple[Indices, Indices, Indices, Array]:
        """Coarse coefficients in which fine ones lie.

        Returns:
            Places of the fine ones, numbers of the coarse ones, places among these, and values.
        """
        starts = range(0, max(len(coefficients), 1), TOGETHER)
        parts = [self._rows_of(coefficients[start:][:TOGETHER]) for start in starts]
        rows = [start + row for start, (row, _, _, _) in zip(starts, parts, strict=True)]
        reached = np.unique(np.concatenate([numbers for _, numbers, _, _ in parts]))
        columns = [np.searchsorted(reached, numbers)[column] for _, numbers, column, _ in parts]
        values = [value for *_, value in parts]
        return np.concatenate(rows), reached, np.concatenate(columns), np.concatenate(values)

    def _rows_of(self, coefficients: Indices) -> tuple[Indices, Indices, Indices, Array]:
        """The same of some coefficients."""
        part, coefficients = np.divmod(coefficients, self._components * int(np.prod(self._fine)))
        function, component = np.divmod(coefficients, self._components)
        at = np.unravel_index(function, self._fine, order="F")
        number = np.zeros((len(function), 1), dtype=np.int64)
        value = np.ones((len(function), 1))
        strides = np.cumprod((1, *self._shape[:-1]))
        for stride, (columns, weights), index in zip(strides, self._padded, at, strict=True):
            number = (number[:, None, :] + stride * columns[index][:, :, None]).reshape(
                len(function), columns.shape[1] * number.shape[1]
            )
            value = (value[:, None, :] * weights[index][:, :, None]).reshape(number.shape)
        row, column = np.nonzero(value)
        number = self._components * number[row, column] + component[row]
        reached, column_of = np.unique(number + self._size * part[row], return_inverse=True)
        return row, reached, column_of, value[row, column]

    def _owners(self, reached: Indices, held: Indices) -> Indices:
        """Rank that owns each coarse coefficient with a part on unknowns of this rank; -1 if held."""
        comm = self._comm
        _, on_held, column, values = self._rows(held)
        sums = sums_at(column, values, len(on_held))
        asked = self._sent(reached)
        told, shares = self._sent(on_held), self._sent(on_held, sums)
        every = np.unique(np.concatenate([*asked, *told]))
        first, shared = np.full(len(every), comm.size), np.unique(every % self._size)
        of_held = np.zeros(len(shared))
        for rank in reversed(range(comm.size)):
            first[np.searchsorted(every, asked[rank])] = rank
        for numbers, share in zip(told, shares, strict=True):
            of_held[np.searchsorted(shared, numbers)] += share
        is_held = of_held >= HELD * self._totals(shared)
        self._held = shared[is_held]
        answer = np.where(is_held[np.searchsorted(shared, every % self._size)], -1, first)
        answers = comm.alltoall([answer[np.searchsorted(every, numbers)] for numbers in asked])
        return self._together(reached, answers)

    def _totals(self, numbers: Indices) -> Array:
        """Sums of coarse functions over all fine ones."""
        at = np.unravel_index(numbers // self._components, self._shape, order="F")
        total = np.ones(len(numbers))
        for matrix, index in zip(self._along, at, strict=True):
            total *= np.asarray(matrix.sum(axis=0)).ravel()[index]
        return total

    def _sent(self, numbers: Indices, values: Any = None) -> list[Any]:
        """Numbers, or values of them, that the ranks send to those that the numbers determine."""
        given = numbers if values is None else values
        return ranks.parts_to(self._comm, given, self._rank_of(numbers))

    def _rank_of(self, numbers: Indices) -> Indices:
        """Rank that learns what others know of a coarse function; the same for all parts of the body."""
        return np.asarray(numbers % self._size % self._comm.size)

    def _together(self, numbers: Indices, answers: Sequence[Indices]) -> Indices:
        """The answers to all that this rank has sent, in its order."""
        to, found = self._rank_of(numbers), np.empty(len(numbers), dtype=np.int64)
        for rank, answer in enumerate(answers):
            found[to == rank] = answer
        return found


def _padded(matrix: sp.csr_matrix) -> tuple[Indices, Array]:
    """Columns and values of the entries of each row, rows x most entries, padded with zeros."""
    count = np.diff(matrix.indptr)
    width = int(count.max(initial=1))
    columns = np.zeros((matrix.shape[0], width), dtype=np.int64)
    values = np.zeros((matrix.shape[0], width))
    filled = np.arange(width) < count[:, None]
    columns[filled], values[filled] = matrix.indices, matrix.data
    return columns, values
