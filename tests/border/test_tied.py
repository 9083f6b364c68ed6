"""Supports by means over patches."""

from __future__ import annotations

import numpy as np
import pytest
from border.contacts import line, rough
from numpy.testing import assert_allclose

from tawami.base.arrays import of_components
from tawami.base.errors import InputError
from tawami.base.rows import Rows
from tawami.base.space import PLANE
from tawami.border.patches import patches
from tawami.border.tied import directions, means

POINTS = line((0.0, 0.0), (2.0, 1.0), 12)


def held(*components):
    """Means of each component over the same patches, of the displacements of the points."""
    groups = patches(POINTS, 0.3)
    every = np.arange(len(POINTS))
    places = of_components(every, 2)
    vectors = directions(PLANE, components, POINTS.normal)
    return [means(groups, POINTS.length, every, d, places, places.size) for d in vectors], groups


@pytest.mark.parametrize("components", [("x",), ("normal",), ("x", "y"), ("normal", "tangent")])
def test_means_are_those_of_the_displacement_along_each_direction(components):
    rows, groups = held(*components)
    u = rough(POINTS)
    for row, d in zip(rows, directions(PLANE, components, POINTS.normal), strict=True):
        expected = groups.means(POINTS.length, (d * u).sum(axis=1))
        assert_allclose(row.times(u.ravel()), expected, rtol=1e-12)


def test_both_pairs_of_components_hold_the_same():
    one, other = (
        Rows.stacked(held(*pair)[0]).csr.toarray() for pair in (("x", "y"), ("normal", "tangent"))
    )
    assert np.linalg.matrix_rank(np.vstack([one, other])) == len(one)


def test_other_components_are_rejected():
    with pytest.raises(
        InputError, match="component = 'z': expected one of 'x', 'y', 'normal', 'tangent'"
    ):
        directions(PLANE, ["z"], POINTS.normal)
