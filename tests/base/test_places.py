"""Places of entries that stay while their values change."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tawami.base.places import Added, Places, share_places


def test_matrices_of_the_same_places_share_them():
    rows, columns = np.array([2, 0, 0, 2]), np.array([1, 3, 0, 1])
    places = Places(rows, columns, (3, 4))
    one, two = places.matrix(np.arange(4.0)), places.matrix(np.ones(4))
    expected = sp.coo_matrix((np.arange(4.0), (rows, columns)), shape=(3, 4)).toarray()
    np.testing.assert_array_equal(one.toarray(), expected)
    assert share_places(one, two)
    added = Added()
    other = sp.csr_matrix(np.eye(3, 4))
    sums = [added.of([matrix, other]) for matrix in (one, two)]
    assert share_places(*sums)
    np.testing.assert_array_equal(sums[1].toarray(), two.toarray() + other.toarray())
