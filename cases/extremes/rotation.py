"""A hundred turns of a free block, and a block that flies across many grid lines.

The block spins with rho omega^2 R^2/E = 1e-3, where R is half its side, in 40 steps per turn. Angular
momentum, linear momentum, energy and shape are compared with the start. The trapezoidal rule itself
reduces sum m x x v by up to twice (omega dt)^2/4 = 1.2 % (see `cases.verification.spinning_disc`).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import numpy.typing as npt

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, Measured, attempted

SUBJECT = "rotation, flight"
Array = npt.NDArray[np.float64]
STEPS = 40  # per turn
SPIN = float(np.sqrt(1e-3 * block.E / block.RHO) / (block.SIDE / 2))  # [rad/s]
#: Bounds of the angular momentum: 1.2 % of the trapezoidal rule, and the loss of the transfer in a turn
#: (8e-5 in ten turns of a disc with 12 cells over its diameter; this block has four).
MOMENTUM, TRANSFER = 0.012, 1e-4
#: Bound of the energy, which should not grow at all.
ENERGY = 0.0015
#: Bound of the shape, over half the side: measured are 2e-4 in the first turns and half of it later.
SHAPE = 5e-4


def turning(form: str, nu: float, per_axis: int = 3) -> tawami.Dynamics:
    """The block, which spins about its middle."""
    law = tawami.linear_elastic(E=block.E, nu=nu)
    scene = block.scene(form, law=law, cells=(8, 8), per_axis=per_axis, shift=(0.13, 0.07))
    motion = block.spinning(scene, SPIN)
    motion.velocity[:] -= motion.linear_momentum / block.MASS  # its middle is not the origin
    return motion


def spinning(form: str, turns: int, nu: float = 0.3, steps: int = STEPS) -> Measured:
    """The largest error over its bound with `steps` per turn; the limit is 1."""
    motion = turning(form, nu)
    scene = motion.scene
    begin, dt = np.array(scene.particles.x), 2 * np.pi / SPIN / steps
    about = begin.mean(axis=0)
    angular, energy = motion.angular_momentum(about), motion.kinetic_energy
    highest = 0.0
    for _ in range(turns * steps):
        motion.step(dt)
        highest = max(highest, motion.kinetic_energy + motion.elastic_energy)
    momentum = abs(1 - motion.angular_momentum(about) / angular)
    speed = SPIN * block.SIDE / 2
    linear = float(np.abs(motion.linear_momentum).max()) / (block.MASS * speed)
    shape = shape_error(begin, np.array(scene.particles.x)) / (block.SIDE / 2)
    worst = float(max(
        momentum / (MOMENTUM + TRANSFER * turns),
        (highest / energy - 1) / ENERGY,
        shape / (SHAPE * (turns + 1)),
        linear / (1e-14 * steps * turns),
    ))  # fmt: skip
    kinetic, elastic = motion.kinetic_energy / energy, motion.elastic_energy / energy
    return worst, (
        f"angular momentum {momentum:.1e}, shape {shape:.1e}, highest energy "
        f"{highest / energy - 1:+.1e}, kinetic {kinetic:.3f} and elastic {elastic:.4f} at the end"
    )


def shape_error(before: Array, now: Array) -> float:
    """Largest distance [m] from the nearest rigid motion (Kabsch 1976)."""
    a, b = before - before.mean(axis=0), now - now.mean(axis=0)
    left, _, right = np.linalg.svd(b.T @ a)
    return float(np.linalg.norm(b - a @ (left @ right).T, axis=1).max())


def flying(form: str, step: float) -> float:
    """Fly freely over 60 cells, `step` of them in a step: errors of path and velocity, stress over E."""
    scene = block.scene(form, cells=(128, 12), shift=(-58.3, 0.21))
    velocity = np.array([1.0, 0.02])
    motion = tawami.Dynamics(scene, velocity=velocity)
    before, dt = np.array(scene.particles.x), step * block.H
    for _ in range(round(60 / step)):
        motion.step(dt)
    error = np.array(scene.particles.x) - before - motion.time * velocity
    return float(max(
        np.abs(error).max() / motion.time,
        np.abs(motion.velocity - velocity).max(),
        np.abs(scene.particles.stress).max() / block.E,
    ))  # fmt: skip


def attempts(short: bool) -> Iterator[Attempt]:
    """One to a hundred turns, and flights with short and long steps."""
    for form in block.FINITE[:1] if short else ("u_epsv_finite", "u_finite"):
        for turns in (1, 3) if short else (1, 10, 100) if form == "u_epsv_finite" else (1, 30):
            yield attempted(
                SUBJECT, f"{form}, {turns} turns", 1.0,
                partial(spinning, form, turns),
            )  # fmt: skip
    for nu in (0.49,) if short else (0.49, 0.4999):
        yield attempted(
            SUBJECT, f"{block.FINITE[0]}, nu = {nu:g}, 160 steps a turn, 3 turns", 1.0,
            partial(spinning, block.FINITE[0], 3, nu, 160),
        )  # fmt: skip
    for form in block.FINITE[:1] if short else block.FINITE:
        for step in (0.31, 7.3) if short else (0.31, 1.0, 7.3, 30.0):
            # round-off of positions, relative to the size of the grid
            yield attempted(
                SUBJECT, f"{form}, flies 60 cells by {step:g} a step", 1e-12,
                partial(flying, form, step),
            )  # fmt: skip
