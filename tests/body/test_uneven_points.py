"""Points of which few have most of the area keep their moments when they are thinned."""

import numpy as np
import pytest

from tawami.body.moment_fitting import EXPONENTS, MOST, fewer


@pytest.mark.parametrize("heavy", [1, 5, 27, 200])
def test_moments_of_points_with_uneven_weights(heavy):
    random = np.random.default_rng(heavy)
    x = random.random((400, 2))
    weight = np.full(400, 1e-6)
    weight[:heavy] = 1.0
    some, found = fewer(x, weight, np.ones(400, dtype=bool))
    assert len(some) <= MOST
    assert (found > 0).all()

    def moments(x, weight):
        return np.array([weight @ (x[:, 0] ** i * x[:, 1] ** j) for i, j in EXPONENTS])

    assert np.allclose(moments(some, found), moments(x, weight), rtol=1e-11, atol=0)
