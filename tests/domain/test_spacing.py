"""Distances of particles that the deformation moves apart."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from cases.extremes import stretch
from tawami.domain.spacing import spacings


@pytest.mark.parametrize(
    ("f", "expected"),
    [
        (np.eye(2), 1.0),
        ([[2.0, 0.0], [0.0, 0.5]], 2.0),
        ([[1.0, 3.0], [0.0, 1.0]], 1.0),  # rows that slide by three places
        ([[1.0, 0.5], [0.0, 1.0]], 1.25**0.5),
        ([[0.5, 0.0], [0.0, 0.5]], 0.5),
        ([[0.0, -3.0], [1.0, 0.0]], 3.0),  # turned and stretched
    ],
)
def test_distances_of_deformed_lattices(f, expected):
    found = spacings(np.array([f, np.eye(2)]), np.array([0.1, 0.2]))
    assert found == pytest.approx([0.1 * expected, 0.2], rel=1e-12)


@pytest.mark.parametrize("per_axis", [2, 3])
def test_a_stretched_block_warns_once_unless_the_advice_was_taken(per_axis):
    """To 1.9 times its length: 0.95 h with two particles in a cell."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-0.1, -0.1), h=0.5, cells=(5, 3))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=per_axis)
    law = tawami.neo_hookean(E=1.0, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_finite", ghost_penalty="on", volumes="fitted")
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y")
    scene.fix("right", "x", 0.9)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tawami.ramp(scene, 0.1)
    told = [str(one.message) for one in caught if one.category is tawami.QuadratureWarning]
    assert len(told) == (per_axis == 2)
    assert all("h apart" in one and "per_axis" in one for one in told)


def test_distances_that_have_doubled_warn():
    """Three particles in a cell, 0.68 h apart, as in the extremes."""
    with pytest.warns(tawami.QuadratureWarning, match="0.68 h apart, 2.1 times as far"):
        assert stretch.pulled(3, "own", 2.0)[0] > 0.1


def test_a_border_that_the_particles_do_not_follow_warns():
    """Few particles at a border that has passed a line of the grid, at 1.35 times the length."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(8, 2))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    law = tawami.neo_hookean(E=1.0, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_finite", ghost_penalty="on")
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y")
    pull = scene.fix("right", "x", 0.0)
    with pytest.warns(tawami.SupportWarning) as caught:
        pull_in_steps(scene, pull)
    told = sorted(str(one.message)[:26] for one in caught)
    assert told == ["a piece of the border is 3", "fix('right'): the border b"]


@pytest.mark.parametrize("off", [0.0, 0.2])
def test_an_error_of_a_stretched_border_names_the_stretch_after_a_warning(off):
    """To 1.6 times the length, with sides on lines of the grid, and as the message advises."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1 - off, -1 - off), h=0.5, cells=(9, 7))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=3 if off else 2)
    law = tawami.neo_hookean(E=1.0, nu=0.3)
    volumes = "fitted" if off else "own"
    scene = tawami.Scene(grid, body, law, form="u_finite", ghost_penalty="on", volumes=volumes)
    scene.fix("left", "x")
    scene.fix(["bottom", "top"], "y")
    pull = scene.fix("right", "x", 0.0)
    if off:
        pull_in_steps(scene, pull, 0.6)
        return
    told = "a piece of the border is .* times as long.*volumes='fitted'.*0.4 h from them"
    with (
        pytest.warns(tawami.SupportWarning, match=told),
        pytest.raises(tawami.SupportError, match=told),
    ):
        pull_in_steps(scene, pull, 1.0)


def pull_in_steps(scene, pull, end=0.4):
    for value in np.arange(0.05, end + 0.01, 0.05):
        pull.change(value)
        scene.solve()
