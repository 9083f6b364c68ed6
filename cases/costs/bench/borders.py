"""Costs of terms on the border: steps of a beam with and without them, in turns.

The beam falls with one end held. Two scenes take their steps one after the other; the ratio of their
processor times is taken for each pair of steps.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami

#: Steps before the first that is measured, pairs of steps, and the size of a step [s].
WARM_UP, PAIRS, STEP = 3, 20, 2e-3
#: Length over height of the beam.
SLENDER = 4


@dataclass(frozen=True)
class Costs:
    """Costs of a scene compared with those of another.

    Attributes:
        ratio, low, high: Processor time of a step over that of the other scene: median and quartiles.
        iterations: Newton iterations of both.
    """

    ratio: float
    low: float
    high: float
    iterations: tuple[int, int]


def beam(n: int, *, patches: bool = False, load: bool = False) -> Any:
    """A beam under gravity.

    Args:
        n: Cells over its height.
        patches: Its end is held on patches, inside of the grid, and not on an edge of the grid.
        load: A traction acts on the other end.
    """
    h, columns = 1 / n, int(patches)
    cells = (SLENDER * n + n // 2 + columns, 2 * n)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-h * columns, -1.0), h=h, cells=cells)
    body = tawami.box(grid, (0.0, -0.5), (SLENDER, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.4)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1e3, alpha=0.01)
    scene.gravity((0.0, -1.0))
    scene.fix("left", "x")
    scene.fix("left", "y")
    if load:
        scene.traction("right", (0.0, -100.0))
    return tawami.Dynamics(scene)


def compared(one: Any, other: Any, pairs: int = PAIRS) -> Costs:
    """Costs of steps of a scene compared with those of another."""
    seconds, iterations = list[list[float]](), [0, 0]
    for number in range(WARM_UP + pairs):
        pair = list[float]()
        for k, motion in enumerate((one, other)):
            start = process_time()
            step = motion.step(STEP)
            pair.append(process_time() - start)
            iterations[k] += step.iterations * (number >= WARM_UP)
        seconds.append(pair)
    times = np.array(seconds[WARM_UP:])
    low, ratio, high = np.quantile(times[:, 0] / times[:, 1], [0.25, 0.5, 0.75])
    return Costs(ratio, low, high, (iterations[0], iterations[1]))


def print_ratios(sizes: Sequence[int], pairs: int = PAIRS) -> None:
    """Print the costs of a traction, and of a support on patches.

    Args:
        sizes: Cells over the heights of beams.
        pairs: Pairs of steps of each.
    """
    logging.disable(logging.INFO)  # compiling a form logs many lines
    print(f"\nterms on the border of a beam, {pairs} pairs of dynamic steps (quartiles)")
    for n in sizes:
        traction = compared(beam(n, load=True), beam(n), pairs)
        patches = compared(beam(n, patches=True), beam(n), pairs)
        for name, found in (
            ("traction on its end / no load", traction),
            ("end held on patches / on an edge of the grid", patches),
        ):
            print(
                f"  {n} cells over its height, {name}: {found.ratio:.3f} ({found.low:.3f} to "
                f"{found.high:.3f}), iterations {found.iterations[0]} / {found.iterations[1]}"
            )
    logging.disable(logging.NOTSET)
