"""Plastic bodies at, and beyond, what they carry."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from tawami.base.arrays import Array, Mask


def pulled(nu: float, up: float) -> tawami.Scene:
    """A block of 4 x 4 cells on a rough base, which a rough plate pulls up."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 4))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=3)
    elastic = tawami.linear_elastic(E=1e3, nu=nu)
    scene = tawami.Scene(grid, body, tawami.mohr_coulomb(elastic, phi=20.0, c=1.0))
    for component in ("x", "y"):
        scene.fix("bottom", component)
    scene.fix("top", "x")
    scene.fix("top", "y", up)
    return scene


def footing(x: Array, y: Array) -> Mask:
    """The first metre of the top."""
    return np.asarray((y == 2) & (x < 1))


def pressed(nu: float, psi: float, **options: Any) -> tawami.Scene:
    """A smooth strip footing of 1 m on 4 m x 2 m, under about 1.05 times its limit load."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(8, 4))
    body = tawami.box(grid, (0, 0), (4, 2), per_axis=3)
    phi = 20.0 if psi else 0.0
    elastic = tawami.linear_elastic(E=1e3, nu=nu)
    law = tawami.mohr_coulomb(elastic, phi=phi, c=1.0, psi=psi)
    scene = tawami.Scene(grid, body, law, **options)
    for edge in ("left", "right", "bottom"):
        scene.fix(edge, "x")
    scene.fix("bottom", "y")
    scene.traction(footing, (0.0, -16.0 if phi else -5.6))
    return scene
