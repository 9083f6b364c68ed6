"""Sparse matrices of few entries, compared with dense ones."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from tawami.base.rows import Rows


def test_operations_are_those_of_dense_matrices():
    rng = np.random.default_rng(1)
    place = rng.integers(0, 4, 12), rng.integers(0, 6, 12)
    values = rng.standard_normal(12)
    dense = np.zeros((4, 6))
    np.add.at(dense, place, values)
    rows, x, y = Rows.of(*place, values, (4, 6)), rng.standard_normal(6), rng.standard_normal(4)
    assert_allclose(rows.csr.toarray(), dense)
    assert_allclose(rows.times(x), dense @ x)
    assert_allclose(rows.transposed_times(y), dense.T @ y)
    assert_allclose(rows.scaled(x).csr.toarray(), dense * x)
    assert_allclose(rows.rows_scaled(y).csr.toarray(), dense * y[:, None])
    assert_allclose(rows.columns(slice(2, 5)).csr.toarray(), dense[:, 2:5])
    assert_allclose(rows.transposed.csr.toarray(), dense.T)
    assert_allclose(Rows.stacked([rows, rows]).csr.toarray(), np.vstack([dense, dense]))
    assert rows.same_places(rows.scaled(x))
    assert not rows.same_places(rows.transposed)


def test_a_matrix_without_entries_has_zero_products():
    none = np.zeros(0, dtype=np.int64)
    rows = Rows.of(none, none, np.zeros(0), (2, 3))
    assert_allclose(rows.times(np.ones(3)), np.zeros(2))
    assert_allclose(rows.transposed_times(np.ones(2)), np.zeros(3))
