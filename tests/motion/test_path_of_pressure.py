"""Paths and modes with forces on the border that depend on the displacement."""

from __future__ import annotations

import pytest
from mpi4py import MPI

import tawami


def block():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(6, 6))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    law = tawami.linear_elastic(E=1e3, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1.0)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def test_a_path_holds_a_pressure_that_is_carried():
    scene = block()
    scene.pressure("top", 1.0)
    scene.solve()
    with pytest.raises(tawami.InputError, match="there is no new load"):
        tawami.follow(scene, "arc length", size=0.01, to=0.02)
    scene.traction("right", (1.0, 0.0))
    tawami.follow(scene, ((1.0, 0.5), "x"), size=1e-4, to=2e-4)


def test_modes_reject_obstacles():
    scene = block()
    scene.obstacle(tawami.half_plane((0, 1.1), (0, -1)))
    with pytest.raises(tawami.InputError, match="the scene has obstacles"):
        tawami.modes(scene, 1)
