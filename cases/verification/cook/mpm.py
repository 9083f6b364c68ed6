"""Cook's membrane by the material point method, on squares that its slanted sides cut.

The grid ends at the clamp and at the loaded side. Support and traction act on the border of the membrane
there.
"""

from __future__ import annotations

from dataclasses import replace

import shapely
from mpi4py import MPI

import tawami
from cases.verification.cook.membrane import (
    CORNERS,
    HEIGHT,
    LENGTH,
    MIDDLE,
    SHEAR,
    E,
    Row,
)

#: Name: form and its parameters.
METHODS = {
    "u_epsv_0.1": {"form": "u_epsv", "alpha": 0.1},
    "u_epsv_0.01": {"form": "u_epsv", "alpha": 0.01},
    "u_epsv_projection": {"form": "u_epsv", "alpha": 0.1, "stabilisation": "projection"},
    "u_bbar": {"form": "u_bbar"},
    "u": {"form": "u"},
}
BODIES = ("even", "gauss", "lattice")


def body_of(grid: tawami.Grid, kind: str) -> tawami.Body:
    """The membrane as particles.

    even      2 x 2 in full cells, Gauss points of triangles in cut cells
    gauss     3 x 3 Gauss points in full cells, the same in cut cells: all integrals exact
    lattice   2 x 2 in every cell, without those outside the membrane
    """
    if kind == "even":
        return tawami.polygon(grid, CORNERS, per_axis=2)
    if kind == "gauss":
        return tawami.polygon(grid, CORNERS, per_axis=3, gauss=True)
    if kind == "lattice":
        body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
        inside = shapely.contains_xy(shapely.Polygon(CORNERS), *body.x.T)
        return replace(body[inside], border=tawami.polyline(CORNERS))
    raise tawami.InputError(f"body '{kind}': expected one of {', '.join(map(repr, BODIES))}")


def build(method: str, nu: float, h: float, body: str = "even") -> tawami.Scene:
    """The membrane as a scene on squares of side h, which divides 4."""
    return scene_of(nu, h, body, **METHODS[method])


def scene_of(nu: float, h: float, body: str, **options: object) -> tawami.Scene:
    """The membrane with any form and options of `Scene`."""
    cells = (round(LENGTH / h), round(HEIGHT / h))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=cells)
    material = tawami.linear_elastic(E=E, nu=nu)
    scene = tawami.Scene(grid, body_of(grid, body), material, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, SHEAR))
    return scene


def solve(method: str, nu: float, h: float, body: str = "even") -> tuple[Row, tawami.Solution]:
    """Solve the membrane."""
    scene = build(method, nu, h, body)
    solution = scene.solve()
    row = Row(
        method=method,
        body=body,
        nu=nu,
        h=h,
        deflection=solution.displacement(MIDDLE)[1],
        particles=scene.num_particles,
        unknowns=solution.unknowns,
        condition=solution.condition,
    )
    return row, solution
