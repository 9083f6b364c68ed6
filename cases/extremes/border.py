"""A pressure on the border of a ring that cuts the cells anywhere, compared with Lamé's solution.

The shift of the ring over the grid includes values at which the border leaves slivers of cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted
from cases.verification import ring

SUBJECT = "border"
SHIFTS = (0.0, 1e-12, 1e-6, 1e-3, 0.25, 0.5, 0.999)
NUS = (0.3, 0.49, 0.4999, 0.499999)
#: Largest error of the displacement. Linear elements of this size err by (h/A)^2/6 = 1 % on the circle.
BOUND = 0.01
#: That of B-bar, whose stress in cut cells is wrong by 60 % (`python/docs/limits.md`).
BBAR = 0.1


def widened(form: str, nu: float, shift: float, n: int = 4, **options: Any) -> float:
    """Error of the displacement in the middle of the wall, over Lamé's.

    Args:
        form: Weak form.
        nu: Poisson's ratio.
        shift: Of the ring along x and y [cells].
        n: Cells per metre.
        options: Of the scene.
    """
    law, place = tawami.linear_elastic(E=ring.E, nu=nu), (shift, shift)
    scene, _, _ = ring.build(n, ring.B + 2 / n, place, law, False, form=form, **options)
    scene.pressure("inner", ring.P)
    a, b, r = ring.A, ring.B, (ring.A + ring.B) / 2
    found = scene.solve().displacement((r + shift / n, shift / n))[0]
    factor = ring.P * a**2 * (1 + nu) / (ring.E * (b**2 - a**2))
    return float(abs(found / (factor * ((1 - 2 * nu) * r + b**2 / r)) - 1))


def tilted(form: str, degrees: float) -> float:
    """Error of the stress of a square under pressure on its four sides, which are turned.

    The stress is -p everywhere, exactly in every patch test.
    """
    turn = np.deg2rad(degrees)
    corners = 0.5 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1.0, -1.0), h=0.125, cells=(16, 16))
    body = tawami.polygon(grid, corners @ rotation.T, per_axis=3, gauss=True)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=ring.E, nu=0.3), form=form)
    for place, component in (((-0.25, 0.0), "y"), ((0.25, 0.0), "y"), ((0.0, 0.25), "x")):
        scene.hold(place, component)
    scene.pressure(lambda x, y: np.ones(np.shape(x), bool), ring.P)
    stress = scene.solve().stress[:, :2]
    return float(np.sqrt(np.mean((stress / ring.P + 1) ** 2)))


def attempts(short: bool) -> Iterator[Attempt]:
    """Shifts, Poisson's ratios and angles."""
    for form in ("u_epsv", "u_p"):
        for shift in SHIFTS[::3] if short else SHIFTS:
            run = partial(widened, form, 0.4999, shift)
            yield attempted(SUBJECT, f"{form}, shifted ring: {shift:g} cells", BOUND, run)
    for form in ("u_epsv", "u", "u_bbar"):
        for nu in NUS[:1] if short else NUS:
            run = partial(widened, form, nu, 0.37)
            bound = BBAR if form == "u_bbar" else BOUND
            yield attempted(SUBJECT, f"{form}, ring: nu = {nu:g}", bound, run)
    for degrees in (0.0, 30.0) if short else (0.0, 1e-9, 1e-3, 1.0, 30.0, 45.0):
        run = partial(tilted, "u_epsv", degrees)
        yield attempted(SUBJECT, f"u_epsv, pressed square: {degrees:g} degrees", 1e-9, run)
