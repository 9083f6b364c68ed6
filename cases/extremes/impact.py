"""An elastic block hits a wall with 1e-6 to 100 times the speed of its pressure waves.

References: the change of momentum equals the impulse of the wall; kinetic plus elastic energy never
grows; the friction of the wall is at most mu times its normal force; the block leaves the wall no faster
than it came. Steps that fail are halved; a run that fails must end with an error message.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "impact"
NU = 0.3
LAW = tawami.linear_elastic(E=block.E, nu=NU)
#: Speed of pressure waves [m/s].
WAVES = float(np.sqrt((LAW.bulk_modulus + 4 / 3 * LAW.shear_modulus) / block.RHO))
#: Bound of the momentum: a reaction is the force at the end of a step, so the sum of impulses is of
#: first order in dt, with 96 steps for six passages of the wave. Energy and friction have no such
#: error.
BALANCE, EXACT = 0.05, 1e-6


def hit(form: str, speed: float, friction: float) -> float:
    """The largest error over its bound; the limit is 1."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=block.H, cells=(40, 16))
    body = tawami.box(grid, (0.5, 0.0), (0.5 + block.SIDE, block.SIDE), per_axis=2)
    options: dict[str, Any] = {"alpha": 0.01} if form == "u_epsv_finite" else {}
    scene = tawami.Scene(grid, body, LAW, form=form, density=block.RHO, **options)
    scene.wall("bottom", friction)
    down = speed * WAVES
    along = 0.5 * down if friction else 0.0
    motion = tawami.Dynamics(scene, velocity=(along, -down))
    start, energy = motion.linear_momentum, motion.kinetic_energy
    impulse, highest = np.zeros(2), [energy]
    last = 0.0

    def record(solution: tawami.Solution) -> None:
        nonlocal impulse, last
        impulse = impulse + (motion.time - last) * solution.reaction("bottom")
        last = motion.time
        highest.append(motion.kinetic_energy + motion.elastic_energy)

    dt = min(0.25 * block.H / WAVES, 0.1 * block.H / down)
    motion.run(6 * block.SIDE / WAVES, dt, each=record)
    change = motion.linear_momentum - start
    size = np.linalg.norm(start)
    if not impulse[1] > size * 0.5:
        return np.inf  # the block did not reach the wall
    return float(max(
        np.abs(change - impulse).max() / size / BALANCE,
        (max(highest) / energy - 1) / EXACT,
        (abs(impulse[0]) - friction * impulse[1]) / size / EXACT,
        (motion.linear_momentum[1] / abs(start[1]) - 1) / EXACT,
    ))  # fmt: skip


def attempts(short: bool) -> Iterator[Attempt]:
    """Each speed, with and without friction."""
    every: tuple[float, ...] = (1e-6, 1e-3, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
    some = (1e-3, 1.0, 10.0)
    for form in block.FINITE[:1] if short else block.FINITE:
        speeds = some if short or form != "u_epsv_finite" else every
        for friction in (0.0, 0.5):
            for speed in speeds:
                yield attempted(
                    SUBJECT, f"{form}, {speed:g} of the waves, friction {friction:g}", 1.0,
                    partial(hit, form, speed, friction),
                )  # fmt: skip
