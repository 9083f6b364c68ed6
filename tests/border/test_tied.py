"""Supports by means over patches."""

from __future__ import annotations

import numpy as np
import pytest
from border.contacts import line, rough
from numpy.testing import assert_allclose

from tawami.base.errors import InputError
from tawami.base.space import PLANE
from tawami.border.patches import patches
from tawami.border.tied import Tied, directions

POINTS = line((0.0, 0.0), (2.0, 1.0), 12)


def tied(*components):
    groups = patches(POINTS, 0.3)
    along = directions(PLANE, components, POINTS.normal)
    return Tied(groups, POINTS.length, along, np.linspace(100.0, 200.0, groups.count))


def along(one, u):
    return np.einsum("kja,ja->jk", one.directions, u)


@pytest.mark.parametrize("components", [("x",), ("normal",), ("x", "y"), ("normal", "tangent")])
def test_a_displacement_that_agrees_causes_no_forces(components):
    one = tied(*components)
    u = 0.3 + POINTS.x @ np.array([[0.1, -0.2], [0.4, 0.7]])
    forces = one.forces(u, along(one, u), one.zero())
    assert_allclose(forces, 0, atol=1e-13)


@pytest.mark.parametrize("components", [("y",), ("tangent",), ("normal", "tangent"), ("x", "y")])
def test_the_stiffness_is_the_derivative_of_the_forces(components):
    one = tied(*components)
    u, held = rough(POINTS), one.zero() + 3.0
    free = np.zeros((len(POINTS), len(components)))
    change = one.forces(u, free, held) - one.forces(0 * u, free, held)
    assert_allclose(one.stiffness() @ u.ravel(), -change.ravel(), rtol=1e-12)
    assert np.linalg.eigvalsh(one.stiffness().toarray()).min() > -1e-12


def test_both_pairs_of_components_hold_the_same():
    u, free = rough(POINTS), np.zeros((len(POINTS), 2))
    one, other = tied("x", "y"), tied("normal", "tangent")
    assert_allclose(one.forces(u, free, one.zero()), other.forces(u, free, one.zero()), rtol=1e-12)


def test_a_uniform_error_gives_the_traction_of_the_penalty():
    one = tied("normal")
    free = np.zeros((len(POINTS), 1))
    u = 0.01 * POINTS.normal
    forces = one.forces(u, free, one.zero())
    expected = -0.01 * (one.penalty[one.patches.number] * POINTS.length)[:, None] * POINTS.normal
    assert_allclose(forces, expected, rtol=1e-12)
    assert_allclose(one.multipliers(u, free, one.zero())[:, 0], 0.01 * one.penalty)


def test_passes_remove_the_error():
    # springs to ground of stiffness k per area, which a support displaces by g
    one, k, g = tied("y"), 50.0, 0.1
    held = one.zero()
    prescribed = np.full((len(POINTS), 1), g)
    springs = k * np.repeat(POINTS.length, 2)
    for _ in range(12):
        force = one.forces(np.zeros_like(POINTS.x), prescribed, held).ravel()
        u = np.linalg.solve(one.stiffness().toarray() + np.diag(springs), force).reshape(-1, 2)
        held = one.multipliers(u, prescribed, held)
    assert np.abs(one.error(u, prescribed)).max() < 1e-6
    assert_allclose(held, -k * g, rtol=1e-4)


def test_other_components_are_rejected():
    with pytest.raises(
        InputError, match="component = 'z': expected one of 'x', 'y', 'normal', 'tangent'"
    ):
        directions(PLANE, ["z"], POINTS.normal)
