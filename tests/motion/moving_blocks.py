"""Blocks that are set in motion."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

import tawami

G = 10.0


def block(form="u_epsv_finite", *, E=1e5, nu=0.4, **options):
    """A block of 0.5 m in the middle of a grid of 2 m."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.125, cells=(16, 16))
    body = tawami.box(grid, (-0.25, -0.25), (0.25, 0.25), per_axis=2)
    if form == "u_epsv_finite":
        options.setdefault("alpha", 0.01)
    material = tawami.linear_elastic(E=E, nu=nu)
    return tawami.Scene(grid, body, material, form=form, density=1000.0, **options)


def spin(scene, omega):
    x = scene.particles.x
    return omega * np.column_stack([-x[:, 1], x[:, 0]])


def falling_on_the_floor():
    """A block on a floor that it cannot leave or slide on, moving down at 1 m/s."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 8))
    body = tawami.box(grid, (0.25, 0.0), (0.75, 0.5), per_axis=2)
    material = tawami.linear_elastic(E=1e5, nu=0.3)
    scene = tawami.Scene(grid, body, material, form="u_epsv_finite", density=1000.0)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene
