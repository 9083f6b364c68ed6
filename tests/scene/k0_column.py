"""A column of soil in its K0 state."""

from __future__ import annotations

from mpi4py import MPI

import tawami

RHO, G, HEIGHT, K0 = 2000.0, 9.81, 4.0, 0.5
SOIL = tawami.linear_elastic(E=1e7, nu=0.3)
LAWS = {
    "elastic": SOIL,
    "mohr_coulomb": tawami.mohr_coulomb(SOIL, phi=30.0),
    "drucker_prager": tawami.drucker_prager(SOIL, phi=30.0),
}


def k0(x, y, K0=K0):
    """K0 stress of a column under its weight."""
    vertical = RHO * G * (y - HEIGHT)
    return K0 * vertical, vertical, K0 * vertical, 0.0


def column(law="elastic", form="u_epsv", per_axis=2, **options):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 8))
    body = tawami.box(grid, (0, 0), (2, HEIGHT), per_axis=per_axis, gauss=True)
    material = law if isinstance(law, tawami.Material) else LAWS[law]
    scene = tawami.Scene(grid, body, material, form=form, density=RHO, **options)
    scene.fix("left", "x")
    scene.fix("right", "x")
    scene.fix("bottom", "y")
    scene.gravity((0, -G))
    return scene
