"""Sparse matrices with few entries, such as constraints: products take less time than the checks of
scipy.sparse do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, sums_at


@dataclass(frozen=True)
class Rows:
    """A sparse matrix by its entries, row by row, ascending in each.

    Attributes:
        row, column: Place of each entry.
        values: The entries.
        shape: Numbers of rows and columns.
    """

    row: Indices
    column: Indices
    values: Array
    shape: tuple[int, int]

    @classmethod
    def of(cls, row: Indices, column: Indices, values: Array, shape: tuple[int, int]) -> Rows:
        """A matrix of entries in any order; those in the same place are added."""
        width = max(shape[1], 1)
        keys, slots = np.unique(row.astype(np.int64) * width + column, return_inverse=True)
        return cls(keys // width, keys % width, sums_at(slots, values, len(keys)), shape)

    @classmethod
    def gathered(
        cls, comm: Any, row: Indices, column: Indices, values: Array, shape: tuple[int, int]
    ) -> Rows:
        """The same with the entries of all ranks; a collective call."""
        rows, columns, entries = (ranks.allgathered(comm, p) for p in (row, column, values))
        return cls.of(rows, columns, entries, shape)

    @classmethod
    def stacked(cls, parts: Sequence[Rows]) -> Rows:
        """Rows of one or several matrices with the same columns, one below the other."""
        first = np.cumsum([0, *(part.shape[0] for part in parts)])
        return cls(
            np.concatenate([part.row + a for part, a in zip(parts, first[:-1], strict=True)]),
            np.concatenate([part.column for part in parts]),
            np.concatenate([part.values for part in parts]),
            (int(first[-1]), parts[0].shape[1]),
        )

    def times(self, x: Array) -> Array:
        """A x."""
        return sums_at(self.row, self.values * x[self.column], self.shape[0])

    def transposed_times(self, y: Array) -> Array:
        """A^T y."""
        return sums_at(self.column, self.values * y[self.row], self.shape[1])

    def scaled(self, factors: Array) -> Rows:
        """The matrix with each column multiplied by a factor."""
        return Rows(self.row, self.column, self.values * factors[self.column], self.shape)

    def rows_scaled(self, factors: Array) -> Rows:
        """The matrix with each row multiplied by a factor."""
        return Rows(self.row, self.column, self.values * factors[self.row], self.shape)

    def columns(self, some: slice) -> Rows:
        """Some of the columns."""
        shape = (self.shape[0], some.stop - some.start)
        if some.start == 0 and some.stop == self.shape[1]:
            return self
        mine = (self.column >= some.start) & (self.column < some.stop)
        return Rows(self.row[mine], self.column[mine] - some.start, self.values[mine], shape)

    @property
    def transposed(self) -> Rows:
        """A^T."""
        order = np.argsort(self.column, kind="stable")
        row, column, values = self.column[order], self.row[order], self.values[order]
        return Rows(row, column, values, self.shape[::-1])

    @property
    def csr(self) -> sp.csr_matrix:
        """The matrix for scipy."""
        start = np.searchsorted(self.row, np.arange(self.shape[0] + 1))
        return sp.csr_matrix((self.values, self.column, start), shape=self.shape)

    def same_places(self, other: Rows) -> bool:
        """Whether another matrix has its entries in the same places."""
        same = self.shape == other.shape and len(self.row) == len(other.row)
        return same and all(
            np.array_equal(*pair) for pair in ((self.row, other.row), (self.column, other.column))
        )
