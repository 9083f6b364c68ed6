"""Costs of terms on the border: steps of a beam with and without them, in turns; and of walls.

The beam falls with one end held. Two scenes take their steps one after the other; the ratio of their
processor times is taken for each pair of steps. A pile collapses between walls: one body has a border,
the walls of the other, of loose particles, hold functions of the grid.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.costs.bench import timed
from cases.showcase.collapse.pile import HEIGHT, LENGTH, NU, PHI, RHO, E, G

#: Steps before the first that is measured, pairs of steps, and the size of a step [s].
WARM_UP, PAIRS, STEP = 3, 20, 2e-3
#: Length over height of the beam.
SLENDER = 4
#: Friction of the floor under the pile.
FLOOR = 0.5


@dataclass(frozen=True)
class Costs:
    """Costs of a scene compared with those of another.

    Attributes:
        ratio, low, high: Processor time of a step over that of the other scene: median and quartiles.
        total: The same of all steps together.
        iterations: Newton iterations of both.
    """

    ratio: float
    low: float
    high: float
    total: float
    iterations: tuple[int, int]

    def __str__(self) -> str:
        return (
            f"{self.ratio:.3f} ({self.low:.3f} to {self.high:.3f}), iterations {self.iterations[0]} / "
            f"{self.iterations[1]}, of all steps {self.total:.3f}"
        )


def beam(n: int, *, patches: bool = False, load: bool = False, border: bool = True) -> Any:
    """A beam under gravity.

    Args:
        n: Cells over its height.
        patches: Its end is held on patches, inside of the grid, and not on an edge of the grid.
        load: A traction acts on the other end.
        border: The body has a border, which moves with it.
    """
    h, columns = 1 / n, int(patches)
    cells = (SLENDER * n + n // 2 + columns, 2 * n)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-h * columns, -1.0), h=h, cells=cells)
    body = tawami.box(grid, (0.0, -0.5), (SLENDER, 0.5), per_axis=2)
    body = body if border else tawami.Body(body.x, body.volume)
    law = tawami.linear_elastic(E=1e6, nu=0.4)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1e3, alpha=0.01)
    scene.gravity((0.0, -1.0))
    scene.fix("left", "x")
    scene.fix("left", "y")
    if load:
        scene.traction("right", (0.0, -100.0))
    return tawami.Dynamics(scene)


def compared(one: Any, other: Any, pairs: int = PAIRS, dt: float = STEP) -> Costs:
    """Costs of steps of a scene compared with those of another."""
    seconds, iterations = list[list[float]](), [0, 0]
    for number in range(WARM_UP + pairs):
        pair = list[float]()
        for k, motion in enumerate((one, other)):
            start = process_time()
            steps = motion.run(motion.time + dt, dt)
            pair.append(process_time() - start)
            iterations[k] += sum(step.iterations for step in steps) * (number >= WARM_UP)
        seconds.append(pair)
    times = np.array(seconds[WARM_UP:])
    low, ratio, high = np.quantile(times[:, 0] / times[:, 1], [0.25, 0.5, 0.75])
    total = float(np.divide(*times.sum(axis=0)))
    return Costs(ratio, low, high, total, (iterations[0], iterations[1]))


def pile(h: float, *, border: bool) -> Any:
    """The pile of the collapse on a rough floor and along a smooth wall.

    Args:
        h: Cell size [m].
        border: Whether the body has a border.
    """
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=(round(0.6 / h), round(0.14 / h))
    )
    body = tawami.box(grid, (0.0, 0.0), (LENGTH, HEIGHT), per_axis=2)
    body = body if border else tawami.Body(body.x, body.volume)
    rods = tawami.drucker_prager(tawami.linear_elastic(E=E, nu=NU), phi=PHI)
    scene = tawami.Scene(grid, body, rods, form="u_epsv_finite", density=RHO, alpha=0.01)
    scene.gravity((0.0, -G))
    scene.wall("left")
    scene.wall("bottom", FLOOR)
    vertical = -RHO * G * (HEIGHT - scene.particles.x[:, 1])
    scene.particles.stress[:, :3] = np.outer(vertical, (0.5, 1.0, 0.75))
    return tawami.Dynamics(scene)


def print_ratio_of_borders(particles: int, pairs: int = PAIRS) -> None:
    """Print the cost of a border that moves with the collapsing pile on held edges.

    Args:
        particles: Number of particles.
        pairs: Pairs of steps.
    """
    dt = timed.Steps.dt(particles)
    finer = round((particles / 800) ** 0.5)
    motions = [timed.pile(finer, border=border) for border in (True, False)]
    found = compared(*motions, pairs, dt)
    print(f"  collapse of {particles} particles, a border / loose particles: {found}")


def print_ratio_of_walls(h: float, end: float, dt: float = 1e-3) -> None:
    """Print the cost of walls of a body with a border, and both run-outs.

    Args:
        h: Cell size [m].
        end: Time of the end [s].
        dt: Size of a step [s].
    """
    motions = [pile(h, border=border) for border in (True, False)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tawami.EnergyWarning)
        found = compared(*motions, round(end / dt) - WARM_UP, dt)
    ends = [1e3 * np.quantile(motion.scene.particles.x[:, 0], 0.99) for motion in motions]
    print(
        f"  pile between walls to {end:g} s, h = {h:g} m, border / loose particles: {found}, run-out "
        f"{ends[0]:.1f} / {ends[1]:.1f} mm"
    )


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
        moves = compared(beam(n), beam(n, border=False), pairs)
        for name, found in (
            ("a border / loose particles", moves),
            ("traction on its end / no load", traction),
            ("end held on patches / on an edge of the grid", patches),
        ):
            print(f"  {n} cells over its height, {name}: {found}")
    logging.disable(logging.NOTSET)
