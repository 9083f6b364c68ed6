"""A load a thousand times too large, in a dynamic step and in a ramp.

A dynamic step is halved until it succeeds; its result must satisfy the momentum equation. A ramp
must end with an error message at the share of the load that it reached, and leave the scene in
equilibrium there.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from mpi4py import MPI

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "sudden load"
PERIOD = 4 * block.SIDE / np.sqrt(block.E / block.RHO)  # of a bar of the length of the block [s]
FORCE = 0.05 * block.E * block.SIDE  # strains the block by about 5 % [N per metre depth]
#: Bound of the momentum: Newton's tolerance, 1e-6 of the forces, in a sum over 100 functions.
BOUND = 1e-5


def pushed(form: str, factor: float) -> float:
    """Pull the right column of the block for a tenth of the period: error of the momentum, over F t."""
    scene = block.scene(form, cells=(64, 32), leaving="stop")
    x = np.array(scene.particles.x)
    scene.load(x[:, 0] > x[:, 0].max() - 1e-9, (factor * FORCE, 0.0))
    motion = tawami.Dynamics(scene)
    begin = block.state(motion)
    try:
        motion.run(0.1 * PERIOD, 0.1 * PERIOD)
    except tawami.TawamiError:
        if motion.steps == 0 and block.changed(begin, motion):
            raise AssertionError("the particles changed in spite of the error") from None
        expected = factor * FORCE * motion.time
        if abs(motion.linear_momentum[0] - expected) > BOUND * max(expected, 1e-300):
            raise AssertionError("the momentum before the error is wrong") from None
        raise
    expected = factor * FORCE * motion.time
    return float(np.abs(motion.linear_momentum - [expected, 0.0]).max() / expected)


def ramped(form: str, factor: float) -> float:
    """Pull the right column of the held block in 10 increments: error of the reaction, over the load."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=block.H, cells=(12, 4))
    body = tawami.box(grid, (0, 0), (block.SIDE, block.SIDE), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=block.E, nu=0.3), form=form)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    pull = scene.load(body.x[:, 0] > 0.4, (factor * FORCE, 0.0))
    reactions = [0.0]

    def wrong() -> float:
        """Difference of the last reaction and the carried share of the load, over the load."""
        # internal, because `ramp(..., stop="raise")` does not return the share that it reached
        share = pull.terms[0].share.carried
        if not np.isfinite(scene.particles.stress).all():
            return np.inf
        return float(abs(reactions[-1] / (factor * FORCE) + share))

    try:
        tawami.ramp(
            scene,
            0.1,
            each=lambda solution: reactions.append(solution.reaction("left")[0]),
            stop="raise",
        )
    except tawami.TawamiError:
        if not wrong() < 1e-5:
            raise AssertionError(f"the reaction is off by {wrong():.1e}") from None
        raise
    return wrong()


def attempts(short: bool) -> Iterator[Attempt]:
    """Loads from small ones to a million times too large, dynamic and by a ramp."""
    for form in block.FINITE[:1] if short else block.FINITE:
        for factor in (1.0, 1e3) if short else (1e-6, 1.0, 10.0, 100.0, 1e3, 1e6):
            yield attempted(
                SUBJECT, f"{form}, dynamic, {factor:g} times", BOUND,
                partial(pushed, form, factor),
            )  # fmt: skip
            # Newton's tolerance
            yield attempted(
                SUBJECT, f"{form}, ramp, {factor:g} times", 1e-5,
                partial(ramped, form, factor),
            )  # fmt: skip
