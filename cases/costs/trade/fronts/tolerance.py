"""Newton's tolerance: its error and time, next to the error of the discretisation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np

import tawami
from cases.showcase.collapse import pile
from cases.verification import footing
from cases.verification.elastica import mpm as elastica

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
BEST = 1e-10


@dataclass(frozen=True)
class Row:
    """Runs of one scene with one tolerance.

    Attributes:
        scene: Its name.
        tolerance: Of Newton's method.
        iterations: Number of Newton iterations.
        seconds: Shortest processor time of the repetitions [s].
        difference: Relative difference from the run with the tolerance `BEST`.
        finer: Relative difference of that run from one on a grid of half the cell size.
        spurious: Remainder of the balance of energy over the largest kinetic energy, of motions.
    """

    scene: str
    tolerance: float
    iterations: int
    seconds: float
    difference: float
    finer: float
    spurious: float | None


COLUMNS = tuple(Row.__dataclass_fields__)
Found = tuple[float, int, float | None]


def bent(tolerance: float, fine: bool) -> Found:
    """Deflection of the tip of a beam at large strain."""
    n = 4 if fine else 2
    run = elastica.Run(3.0, "u_epsv_finite", 0.3, n, 3, 10, 1e-2, 0.01, 10)
    scene, loaded, _ = elastica.build(run)
    with scene.configuration.tolerance(tolerance):
        steps = tawami.ramp(scene, 0.1, stop="raise")
    down = float(np.array(scene.particles.displacement)[loaded, 1].mean())
    return down, sum(step.iterations for step in steps), None


def pressed(tolerance: float, fine: bool) -> Found:
    """Force of a rough footing on von Mises clay that yields."""
    n = 8 if fine else 4
    run = footing.Run("u_epsv", "von_mises", "quadratic_spline", "rough", n, 0.49, 0.01, 3)
    scene, forces = footing.build(run, 6.0), list[float]()
    with scene.configuration.tolerance(tolerance):
        steps = tawami.ramp(
            scene, 0.1, each=lambda s: forces.append(float(s.reaction("top")[1])), stop="raise"
        )
    return forces[-1], sum(step.iterations for step in steps), None


def collapsed(tolerance: float, fine: bool) -> Found:
    """Run-out of a pile at 0.2 s."""
    motion = pile.build("u_epsv_finite", h=0.01 if fine else 0.02, per_axis=3, tolerance=tolerance)
    kinetic = [0.0]
    steps = motion.run(0.2, 2e-3, each=lambda _: kinetic.append(motion.kinetic_energy))
    spurious = abs(motion.energies.integration) / max(kinetic)
    x = np.array(motion.scene.particles.x)
    return float(np.quantile(x[:, 0], 0.99)), sum(s.iterations for s in steps), spurious


SCENES: dict[str, Callable[[float, bool], Found]] = {
    "large deflection": bent, "footing": pressed, "collapse": collapsed,
}  # fmt: skip


def rows(repeats: int = 3) -> list[Row]:
    """All comparisons, in turns."""
    found = []
    for name, run in SCENES.items():
        best, _, _ = run(BEST, False)
        finer = abs(run(BEST, True)[0] / best - 1)
        seconds, results = dict.fromkeys(TOLERANCES, math.inf), dict[float, Found]()
        for _ in range(repeats):
            for tolerance in TOLERANCES:
                begin = process_time()
                results[tolerance] = run(tolerance, False)
                seconds[tolerance] = min(seconds[tolerance], process_time() - begin)
        for tolerance, (value, iterations, spurious) in results.items():
            difference = abs(value / best - 1)
            found.append(
                Row(name, tolerance, iterations, seconds[tolerance], difference, finer, spurious)
            )
    return found
