"""Axisymmetry: a thick sphere up to nu = 0.5, slivers along the axis, and rings far from it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "axisymmetry"
A, B, E, P = 1.0, 2.0, 1.0e4, 10.0  # radii [m], modulus and inner pressure [Pa]


def sphere(form: str, c: float, n: int = 4, lift: float = 0.0) -> float:
    """Error of the radial displacement at r = 1.5 m of a sphere under inner pressure, over Lamé's.

    Args:
        form: Weak form.
        c: 1 - 2 nu.
        n: Cells per metre.
        lift: Shift of the centre along the axis [cells].
    """
    nu, cells, z = (1 - c) / 2, round((B + 1) * n), lift / n
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0.0, -cells / n), h=1 / n, cells=(cells, 2 * cells),
        geometry="axisymmetric",
    )  # fmt: skip
    wall = tawami.disc(grid, (0.0, z), B, inner=A)
    scene = tawami.Scene(grid, wall, tawami.linear_elastic(E=E, one_minus_2nu=c), form=form)
    scene.pressure("inner", P)
    scene.hold((1.5, z), "y")
    factor = P * A**3 / (E * (B**3 - A**3))
    exact = factor * (c * 1.5 + (1 + nu) * B**3 / (2 * 1.5**2))
    return float(abs(scene.solve().displacement((1.5, z))[0] / exact - 1))


def far(form: str, radius: float) -> float:
    """Difference of the shortening of a block at a radius from that in plane strain, less their ratio.

    The block, 1 m x 1 m, is pressed from above. The hoop strain u_r/r vanishes as 1/r.
    """

    def shortening(geometry: str, x: float) -> float:
        grid = tawami.Grid(MPI.COMM_WORLD, origin=(x, 0.0), h=0.25, cells=(6, 4), geometry=geometry)
        body = tawami.box(grid, (x, 0.0), (x + 1.0, 1.0))
        scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=0.3), form=form)
        scene.fix("bottom", "y")
        scene.fix("left", "x")
        scene.traction("top", (0.0, -P))
        return float(scene.solve().displacement((x, 1.0))[1])

    plane = shortening("plane_strain", 0.0)
    return abs(shortening("axisymmetric", radius) / plane - 1) * radius


def attempts(short: bool) -> Iterator[Attempt]:
    """Poisson's ratio, shifts along the axis, distances from it."""
    for form in ("u_epsv",) if short else ("u_epsv", "u_p", "u_bbar"):
        for c in (0.4, 1e-4) if short else (0.4, 1e-2, 1e-4, 1e-8, 1e-12, 0.0):
            # Lamé's displacement varies by the factor 2^2 over four cells: (h/r)^2 = 3 %
            run = partial(sphere, form, c)
            yield attempted(SUBJECT, f"{form}, sphere: 1 - 2 nu = {c:g}", 0.03, run)
    for lift in (0.37,) if short else (1e-9, 1e-3, 0.37, 0.5):
        run = partial(sphere, "u_epsv", 2e-4, 4, lift)
        yield attempted(SUBJECT, f"u_epsv, sphere shifted: {lift:g} cells", 0.03, run)
    for radius in (1e3,) if short else (10.0, 1e3, 1e5, 1e7):
        # u_r/r of the block is at most 1/r of the strain along the axis: the bound is its share of E'
        run = partial(far, "u_epsv", radius)
        bound = 1.0 + 1e-9 * radius**2
        yield attempted(SUBJECT, f"u_epsv, block at r = {radius:g} m, difference x r", bound, run)
