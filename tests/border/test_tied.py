"""Supports by means over patches."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from border.contacts import line, rough
from numpy.testing import assert_allclose

from tawami.base.arrays import of_components
from tawami.base.errors import InputError
from tawami.base.space import PLANE
from tawami.border.patches import patches
from tawami.border.tied import Tied, directions, means

POINTS = line((0.0, 0.0), (2.0, 1.0), 12)


def tied(*components):
    """Each component on the same patches; the unknowns are the displacements of the points."""
    groups = patches(POINTS, 0.3)
    places = of_components(np.arange(len(POINTS)), 2)
    vectors = directions(PLANE, components, POINTS.normal)
    rows = [means(groups, POINTS.length, d, places, places.size) for d in vectors]
    num = len(components)
    areas, penalty = groups.sums(POINTS.length), np.linspace(100.0, 200.0, groups.count)
    return Tied(sp.vstack(rows).tocsr(), np.tile(areas, num), np.tile(penalty, num)), groups


def prescribed_means(components, groups, u):
    """Means of displacements along the components, computed from each point."""
    vectors = directions(PLANE, components, POINTS.normal)
    along = [(d * u).sum(axis=1) for d in vectors]
    return np.concatenate([groups.means(POINTS.length, one) for one in along])


def forces(one, u, prescribed=0.0, held=0.0):
    return one.forces(one.multipliers(one.means @ u.ravel() - prescribed, held)).reshape(u.shape)


@pytest.mark.parametrize("components", [("x",), ("normal",), ("x", "y"), ("normal", "tangent")])
def test_a_displacement_that_agrees_causes_no_forces(components):
    one, groups = tied(*components)
    u = 0.3 + POINTS.x @ np.array([[0.1, -0.2], [0.4, 0.7]])
    assert_allclose(forces(one, u, prescribed_means(components, groups, u)), 0, atol=1e-13)


@pytest.mark.parametrize("components", [("y",), ("tangent",), ("normal", "tangent"), ("x", "y")])
def test_the_stiffness_is_the_derivative_of_the_forces(components):
    one, _ = tied(*components)
    u = rough(POINTS)
    change = forces(one, u, held=3.0) - forces(one, 0 * u, held=3.0)
    assert_allclose(one.stiffness @ u.ravel(), -change.ravel(), rtol=1e-12)
    assert np.linalg.eigvalsh(one.stiffness.toarray()).min() > -1e-12


def test_both_pairs_of_components_hold_the_same():
    u = rough(POINTS)
    one, other = tied("x", "y")[0], tied("normal", "tangent")[0]
    assert_allclose(forces(one, u), forces(other, u), rtol=1e-12)


def test_a_uniform_error_gives_the_traction_of_the_penalty():
    one, groups = tied("normal")
    u = 0.01 * POINTS.normal
    expected = -0.01 * (one.penalty[groups.number] * POINTS.length)[:, None] * POINTS.normal
    assert_allclose(forces(one, u), expected, rtol=1e-12)
    assert_allclose(one.multipliers(one.means @ u.ravel(), 0.0), 0.01 * one.penalty)


def test_passes_remove_the_error():
    # springs to ground of stiffness k per area, which a support displaces by g
    (one, _), k, g = tied("y"), 50.0, 0.1
    held = np.zeros(len(one.areas))
    springs = k * np.repeat(POINTS.length, 2)
    for _ in range(12):
        force = forces(one, np.zeros_like(POINTS.x), g, held).ravel()
        u = np.linalg.solve(one.stiffness.toarray() + np.diag(springs), force)
        held = one.multipliers(one.means @ u - g, held)
    assert np.abs(one.means @ u - g).max() < 1e-6
    assert_allclose(held, -k * g, rtol=1e-4)


def test_other_components_are_rejected():
    with pytest.raises(
        InputError, match="component = 'z': expected one of 'x', 'y', 'normal', 'tangent'"
    ):
        directions(PLANE, ["z"], POINTS.normal)
