"""Calls that fail leave nothing behind, and states that were handed out do not change."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from mpi4py import MPI

import tawami


def disc_on_a_plane():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, -0.25), h=0.25, cells=(8, 9))
    body = tawami.disc(grid, (1, 0.9), 0.9, per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", ghost_penalty="on")
    scene.fix(lambda x, y: y > 1.5, "x")
    scene.fix(lambda x, y: y > 1.5, "y", -0.02)
    return scene


CALLS = {
    "support": lambda scene: scene.fix("outer", "x", "far"),
    "velocity": lambda scene: scene.fix("outer", "x", 1.0, velocity=2.0),
    "traction": lambda scene: scene.traction("outer", (1.0, None)),
    "pressure": lambda scene: scene.pressure("outer", "high"),
    "amplitude": lambda scene: scene.pressure("outer", 1.0, amplitude="fast"),
    "overlap": lambda scene: scene.obstacle(tawami.half_plane((0, 0.5), (0, 1))),
    "motion": lambda scene: scene.obstacle(
        tawami.half_plane((0, 0), (0, 1)), displacement=(1, "a")
    ),
}


@pytest.mark.parametrize("call", CALLS)
def test_a_call_that_fails_leaves_nothing_behind(call):
    scene, other = disc_on_a_plane(), disc_on_a_plane()
    with pytest.raises(tawami.InputError):
        CALLS[call](scene)
    assert len(scene.border.all) == len(other.border.all)
    for one in (scene, other):
        one.obstacle(tawami.half_plane((0, 0), (0, 1)))
    assert scene.configuration.identity() == other.configuration.identity()
    other.configuration.restore(scene.configuration.state())


def test_a_state_that_was_handed_out_stays_as_it_is():
    scene = disc_on_a_plane()
    scene.obstacle(tawami.half_plane((0, 0), (0, 1)), 0.3)
    scene.solve()
    now = scene.configuration
    parts = now.obstacles, now.supports, now.border
    states = [part.state() for part in parts]
    before = copy.deepcopy(states)
    assert np.abs(states[0][0]["pressure"]).max() > 0
    now.obstacles.all[0].change((0.01, 0.01))
    scene.solve()
    after = [part.state() for part in parts]
    np.testing.assert_equal(states, before)
    assert not np.array_equal(after[0][0]["pressure"], before[0][0]["pressure"])
