"""A block that stands on the bottom of the grid, and laws for it."""

from __future__ import annotations

from scenes import grid_of

import tawami

ELASTIC = {"E": 10.0, "nu": 0.3}


STATIC = ["x", "volume", "material", "number", "stress", "displacement"]


def scene_of(law=None, **options):
    """A block that stands on the bottom."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, law or tawami.linear_elastic(**ELASTIC), **options)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def plastic():
    return tawami.drucker_prager(tawami.linear_elastic(**ELASTIC), phi=30.0, c=1.0)


def tresca():
    return tawami.mohr_coulomb(tawami.linear_elastic(**ELASTIC), phi=0.0, c=1.0)


def moving(**options):
    return tawami.Dynamics(scene_of(density=1.0, **options), velocity=(0.1, 0.0))
