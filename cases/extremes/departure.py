"""Particles that leave the grid: a cloud without internal forces, each particle on a straight line.

Reference: x + v t of each particle tells which particles leave, when and where.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "departure"
SIDE, STEPS = 2.0, 10  # of the grid [m]


def cloud(speed: float, leaving: str) -> tawami.Dynamics:
    """200 particles at random positions that fly apart, too heavy to affect each other.

    The fastest moves by `speed` cells in a step of 1 s.
    """
    h = SIDE / 16
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-SIDE / 2, -SIDE / 2), h=h, cells=(16, 16))
    random = np.random.default_rng(3)
    x = random.uniform(-0.3, 0.3, (200, 2)) * SIDE
    body = tawami.Body(x, np.full(200, 1e-3))
    law = tawami.linear_elastic(E=1.0, nu=0.3)
    scene = tawami.Scene(
        grid,
        body,
        law,
        form="u_finite",
        density=1e25,
        leaving=leaving,  # type: ignore[arg-type]
    )
    # linear in x, so that the grid represents it exactly
    rate = speed * h / (0.3 * SIDE)
    motion = tawami.Dynamics(scene, velocity=rate * x)
    motion.velocity_gradient[:] = rate * np.eye(2)
    return motion


def removed(speed: float) -> float:
    """Number of wrong entries in `scene.left`: particle, step or place, until the cloud has left."""
    motion = cloud(speed, "remove")
    scene = motion.scene
    x = np.array(scene.particles.x)
    v = np.array(motion.velocity)
    try:
        for _ in range(STEPS):
            motion.step(1.0)
    except tawami.InputError as error:
        if "the last particle" not in str(error) or motion.steps == 0:
            raise
    steps = motion.steps
    times = np.arange(1, steps + 1)
    outside = (np.abs(x + times[:, None, None] * v) > SIDE / 2 + 1e-6).any(axis=2)
    departed = outside.any(axis=0)
    first = np.where(departed, outside.argmax(axis=0) + 1, 0)
    reported = {number: (place, time) for number, place, time in scene.left}
    wrong = set(reported) ^ set(np.flatnonzero(departed))
    for number in set(reported) - wrong:
        place, time = reported[number]
        where = x[number] + first[number] * v[number]
        if time != first[number] or np.abs(np.array(place) / where - 1).max() > 1e-3:
            wrong.add(number)
    if len(scene.particles) + len(scene.left) != len(x) or len(reported) != len(scene.left):
        return np.inf
    return float(len(wrong))


def stopped(speed: float) -> float:
    """The error message of the first departure must name particle and time, with nothing changed."""
    motion = cloud(speed, "stop")
    x, v = np.array(motion.scene.particles.x), np.array(motion.velocity)
    for step in range(1, STEPS + 1):
        departed = np.flatnonzero((np.abs(x + step * v) > SIDE / 2 + 1e-6).any(axis=1))
        before = np.array(motion.scene.particles.x)
        try:
            motion.step(1.0)
        except tawami.InputError as error:
            words = f"particle {departed[0]} would leave the grid at {step} s"
            if words not in str(error) or f"and {len(departed) - 1} others" not in str(error):
                raise AssertionError(f"'{error}' instead of '{words}'") from error
            if not np.array_equal(before, motion.scene.particles.x):
                raise AssertionError("the particles moved in spite of the error") from error
            raise
        if len(departed):
            return np.inf
    return 0.0


def attempts(short: bool) -> Iterator[Attempt]:
    """From a fraction of a cell to a million cells per step."""
    for speed in (0.7, 3.0, 1e3) if short else (0.1, 0.7, 1.0, 3.0, 10.0, 100.0, 1e3, 1e6):
        for what, run in (("remove", removed), ("stop", stopped)):
            yield attempted(
                SUBJECT, f"{speed:g} cells a step, {what}", 0.0,
                partial(run, speed),
            )  # fmt: skip
