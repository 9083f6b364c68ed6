"""Distances of particles that the deformation moves apart."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.scene.spacing import spacings


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


@pytest.mark.parametrize("volumes", ["own", "fitted"])
def test_a_stretched_block_warns_once_unless_the_advice_was_taken(volumes):
    """To 1.5 times its length, with two particles in a cell: 0.75 h."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-0.1, -0.1), h=0.25, cells=(9, 6))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    law = tawami.neo_hookean(E=1.0, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_finite", ghost_penalty="on", volumes=volumes)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y")
    scene.fix("right", "x", 0.6)
    if volumes == "fitted":
        tawami.ramp(scene, 0.1)
        return
    with pytest.warns(tawami.QuadratureWarning, match="0.7. h apart.*volumes=.fitted.") as caught:
        tawami.ramp(scene, 0.1)
    assert len(caught) == 1


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
    with pytest.warns(tawami.SupportWarning, match="fix..right..: the border bends") as caught:
        pull_in_steps(scene, pull)
    assert len(caught) == 1


def pull_in_steps(scene, pull):
    for value in np.arange(0.05, 0.41, 0.05):
        pull.change(value)
        scene.solve()
