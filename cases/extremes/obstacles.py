"""A block on a rigid obstacle: force balance, Coulomb's law and positions in the cells.

The force on the obstacle is the weight of the block, and on an incline the block slides if the friction
is less than the slope.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, Measured, attempted

SUBJECT = "obstacles"
G, RHO, SIDE = 9.81, 1000.0, 0.5  # [m/s2], [kg/m3], [m]


def resting(
    form: str, lift: float, modulus: float = 1e6, nu: float = 0.3, slope: float = 0.0,
    friction: float = 0.0, h: float = 0.125,
) -> Measured:  # fmt: skip
    """Error of the force on the obstacle under the block, over the weight.

    Args:
        form: Weak form.
        lift: Height of the obstacle above a grid line [cells].
        modulus: Young's modulus [Pa].
        nu: Poisson's ratio.
        slope: Of gravity from the normal of the obstacle [degrees].
        friction: Of the obstacle.
        h: Side of a cell [m].
    """
    n = round(SIDE / h)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-SIDE, -2 * h), h=h, cells=(4 * n, n + 4))
    low = lift * h
    corners = [(0.0, low), (SIDE, low), (SIDE, low + SIDE), (0.0, low + SIDE)]
    body = tawami.polygon(grid, corners, per_axis=3)
    law = tawami.linear_elastic(E=modulus, nu=nu)
    scene = tawami.Scene(grid, body, law, form=form, density=RHO)
    if friction == 0:  # only the translation along the plane is free
        scene.hold((SIDE / 2, low + SIDE / 2), "x")
    turn = np.deg2rad(slope)
    scene.gravity((G * np.sin(turn), -G * np.cos(turn)))
    plane = scene.obstacle(tawami.half_plane((0.0, low), (0.0, 1.0)), friction)
    force = np.array(scene.solve().contact(plane).force)
    weight = RHO * G * SIDE**2
    expected = weight * np.array([np.sin(turn) if friction else 0.0, -np.cos(turn)])
    return float(np.abs(force - expected).max() / weight), f"force {force[1] / weight:.6f} of W"


def attempts(short: bool) -> Iterator[Attempt]:
    """Positions in the cells, stiffness, slopes with friction, sizes of cells."""
    # Newton's tolerance is 1e-6 of the forces
    for form in ("u_epsv",) if short else ("u_epsv", "u", "u_bbar", "u_epsv_finite"):
        for lift in (0.0, 0.37) if short else (0.0, 1e-12, 1e-6, 1e-3, 0.37, 0.5, 0.999):
            run = partial(resting, form, lift)
            yield attempted(SUBJECT, f"{form}, height of the plane: {lift:g} cells", 1e-5, run)
    for modulus in (1e6,) if short else (1e5, 1e8, 1e11, 1e14):
        run = partial(resting, "u_epsv", 0.37, modulus, 0.4999)
        yield attempted(SUBJECT, f"u_epsv, nu = 0.4999: E = {modulus:g} Pa", 1e-5, run)
    for degrees in (10.0,) if short else (0.01, 1.0, 10.0, 21.0, 21.7):
        run = partial(resting, "u_epsv", 0.37, slope=degrees, friction=0.4)
        yield attempted(SUBJECT, f"u_epsv, friction 0.4, slope: {degrees:g} degrees", 1e-5, run)
    for degrees in (30.0,) if short else (22.0, 30.0, 60.0):
        run = partial(resting, "u_epsv", 0.37, slope=degrees, friction=0.4)
        yield attempted(SUBJECT, f"u_epsv, friction 0.4, slides: {degrees:g} degrees", None, run)
    for h in (0.25,) if short else (0.25, 0.0625, 0.03125):
        run = partial(resting, "u_epsv", 0.37, h=h)
        yield attempted(SUBJECT, f"u_epsv, side of a cell: {h:g} m", 1e-5, run)
