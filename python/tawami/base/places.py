"""Places of the entries of sparse matrices that are made again and again with other values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Indices, sums_at


class Places:
    """Places of entries, several of which may be the same.

    Args:
        rows, columns: Of each entry.
        shape: Numbers of rows and columns.
    """

    def __init__(self, rows: Indices, columns: Indices, shape: tuple[int, int]) -> None:
        keys, self._slots = np.unique(
            rows.astype(np.int64) * shape[1] + columns, return_inverse=True
        )
        start = np.searchsorted(keys, shape[1] * np.arange(shape[0] + 1))
        entries = (np.zeros(len(keys)), keys % shape[1], start)
        self._zero = sp.csr_matrix(entries, shape=shape)

    def matrix(self, values: Array) -> sp.csr_matrix:
        """The matrix of these values; all of them share the arrays of their places."""
        zero = self._zero
        data = sums_at(self._slots, values, zero.nnz)
        made = sp.csr_matrix((data, zero.indices, zero.indptr), shape=zero.shape)
        made.indices, made.indptr = zero.indices, zero.indptr  # it made others
        return made


class Added:
    """The sum of matrices, which has an entry wherever one of them has one, zeros too."""

    def __init__(self) -> None:
        self._last: Sequence[sp.csr_matrix] = ()

    def of(self, matrices: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
        """The sum of at least one matrix."""
        if len(matrices) == 1:
            return matrices[0]
        known = len(matrices) == len(self._last)
        pairs = zip(matrices, self._last, strict=False)
        if not (known and all(share_places(one, last) for one, last in pairs)):
            parts = [matrix.tocoo() for matrix in matrices]
            rows, columns = (
                np.concatenate([getattr(part, name) for part in parts]) for name in ("row", "col")
            )
            self._places = Places(rows, columns, parts[0].shape)
        self._last = matrices
        return self._places.matrix(np.concatenate([matrix.data for matrix in matrices]))


def share_places(a: sp.csr_matrix, b: sp.csr_matrix) -> bool:
    """Whether two matrices share the arrays of the places of their entries."""
    return a.indices is b.indices and a.indptr is b.indptr


def same_places(a: sp.csr_matrix | None, b: sp.csr_matrix) -> bool:
    """Whether two matrices have entries in the same places."""
    if a is None or a.nnz != b.nnz:
        return False
    if share_places(a, b):
        return True
    return np.array_equal(a.indptr, b.indptr) and np.array_equal(a.indices, b.indices)
