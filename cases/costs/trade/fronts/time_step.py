"""Steps of one size, and steps whose size follows an estimate of Newmark's local error.

The displacement of a step differs from one that is linear in the acceleration by

    e = (beta - 1/6) dt^2 (a1 - a0)

(Zienkiewicz and Xie 1991). With the rms of e over the mass, relative to that of the displacement, the
next step is dt (tolerance / e)^(1/3), at most twice and at least half the last one.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

import tawami
from cases.costs.trade.fronts.measure import Row, compared
from cases.showcase.collapse import pile
from cases.verification.vibrating_beam import beam as timoshenko
from cases.verification.vibrating_beam import mpm

#: Tolerance for as many steps as the size says, times its cube; chosen so that both take about as long.
TOLERANCES = {"beam": 1.2, "pile": 40.0}
#: Numbers of steps of the reference, on the same grid.
REFERENCES = {"beam": 3200, "pile": 4800}
PERIOD = 2 * np.pi / timoshenko.first_bending(0.3)
ENDS = {"beam": 1.25 * PERIOD, "pile": 0.3}  # [s]


def build(scene: str) -> tawami.Dynamics:
    """The motion at its start."""
    if scene == "pile":
        return pile.build("u_epsv_finite", h=0.02, per_axis=3)
    return mpm.build(0.3, "u_epsv_finite", "affine_flip", n=2, per_axis=3, alpha=0.01)


def adaptive(motion: tawami.Dynamics, end: float, dt: float, tolerance: float) -> int:
    """Run with steps that follow the estimate; the number of steps."""
    start, largest, steps = np.array(motion.scene.particles.x), 0.0, 0
    while end - motion.time > 1e-9 * end:
        a = np.array(motion.acceleration)
        size = min(dt, end - motion.time)
        try:
            motion.step(size)
        except tawami.ConvergenceError:
            dt = size / 2
            continue
        steps += 1
        moved = np.asarray(motion.scene.particles.x) - start
        largest = max(largest, rms(motion, moved))
        error = abs(motion.beta - 1 / 6) * size**2 * rms(motion, motion.acceleration - a)
        ratio = tolerance * largest / max(error, 1e-300)
        dt = size * float(np.clip(ratio ** (1 / 3), 0.5, 2.0))
    return steps


def rms(motion: tawami.Dynamics, vector: np.ndarray) -> float:
    """Root mean square over the mass of one vector per particle."""
    return float(np.sqrt(motion.mass @ (vector**2).sum(axis=1) / motion.mass.sum()))


@functools.cache
def reference(scene: str) -> np.ndarray:
    """Positions at the end with many small steps."""
    motion = build(scene)
    motion.run(ENDS[scene], ENDS[scene] / REFERENCES[scene])
    return np.array(motion.scene.particles.x)


def error(steps: float, scene: str, estimate: bool) -> float:
    """rms error of the positions at the end, relative to the displacement."""
    motion = build(scene)
    start, end = np.array(motion.scene.particles.x), ENDS[scene]
    if estimate:
        adaptive(motion, end, end / steps / 4, TOLERANCES[scene] / steps**3)
    else:
        motion.run(end, end / steps)
    x, exact = np.array(motion.scene.particles.x), reference(scene)
    return rms(motion, x - exact) / rms(motion, exact - start)


def rows() -> list[Row]:
    """All comparisons."""
    found = []
    for scene, sizes in {"beam": (12, 25, 50, 100), "pile": (75, 150, 300)}.items():
        reference(scene)
        ways: dict[str, dict[str, Any]] = {
            way: {"scene": scene, "estimate": way == "estimate"} for way in ("constant", "estimate")
        }
        found += compared(scene, ways, sizes, error, repeats=2)
    return found
