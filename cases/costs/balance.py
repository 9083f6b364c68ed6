"""Balance of the ranks: particles of the fullest rank compared with the mean, in the collapse of a pile.

The command runs the first steps of the collapse on some numbers of ranks (which share the processors of
this machine), with cells that are divided by their particles, and with cells of which each rank has the
same number (`even`). `most / mean` is the number of particles of the fullest rank over the mean, at the
start and at the end, and the largest after any step. `moves` counts the steps after which cells changed
their rank, and the last column is the time of that, in steps.

The second table has the time that a particle, a cell with particles and one without add to a step on one
rank, by least squares. They are the weights by which cells are divided.

python -m cases.costs.balance
python -m cases.costs.balance --ranks 2,4 --steps 40 --size 0.005
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.common.program import Program, numbers
from cases.common.table import as_csv, as_text
from cases.showcase.collapse import pile
from tawami.base.program import mpirun
from tawami.grid.division import CELL, EMPTY, PARTICLE, Division
from tawami.particles import placement

PROGRAM = Program("cases.costs.balance", __doc__)
WHOLE = numbers(int, lambda n: n > 0, "whole numbers separated by commas, such as 1,2,4")
PROGRAM.option("--ranks", type=WHOLE, default="2,4", help="numbers of ranks")
PROGRAM.option("--steps", type=int, default=100, help="steps")
PROGRAM.option("--size", type=float, default=0.01, help="cell size [m]")
#: Size of a step over the size of a cell [s/m].
PACE = 0.1
COLUMNS = ("ranks", "cells", "start", "worst", "end", "step_s", "moves", "move_steps")
#: Particles per axis, cells of a block and of its grid along each axis, for the weights.
BLOCKS = ((2, 24, 26), (3, 24, 26), (2, 12, 26), (3, 12, 26), (2, 12, 96))


@dataclass(frozen=True)
class Row:
    """A run: most / mean particles of a rank at the start, at worst and at the end; seconds of a step;
    steps after which cells changed their rank, and the time of that in steps.
    """

    ranks: int
    cells: str
    start: float
    worst: float
    end: float
    step_s: float
    moves: int
    move_steps: float


@dataclass(frozen=True)
class Weight:
    """A part of the time of a step: microseconds, and its weight relative to that of a particle."""

    of: str
    us: float
    measured: float
    used: float


def most_over_mean(count: npt.NDArray[Any]) -> float:
    """The largest count over the mean."""
    return float(count.max() / count.mean())


def of_rank(steps: int, size: float, cells: str) -> None:
    """Run on all ranks; the first one prints a row as JSON."""
    comm = MPI.COMM_WORLD
    if cells == "even":
        tawami.Grid.divided_by = lambda grid, cell: grid  # type: ignore[method-assign]
    motion = pile.build("u_epsv_finite", h=size)
    now, scene = motion.scene.configuration, motion.scene

    def uneven() -> float:
        return most_over_mean(np.array(comm.allgather(len(scene.particles))))

    counts, seconds, moves = [uneven()], list[float](), 0
    for _ in range(steps):
        before, began = now.model.grid, perf_counter()
        motion.step(PACE * size)
        seconds.append(perf_counter() - began)
        counts.append(uneven())
        moves += now.model.grid is not before
    step, again = float(np.median(seconds)), moved(now)
    row = Row(comm.size, cells, counts[0], max(counts), counts[-1], step, moves, again / step)
    if comm.rank == 0:
        print(json.dumps(vars(row)))


def moved(now: Any) -> float:
    """Seconds to divide the cells anew, and to move all particles to other ranks and back."""
    grid, particles = now.model.grid, now.domain.particles
    began, location = perf_counter(), now.domain.location
    Division.by_particles(
        grid.comm, grid.cells, grid.window.cells_in_grid(location.cell.astype(np.int64))
    )
    other = placement.migrated(tawami.Grid(grid.comm, **given(grid)), particles)
    placement.migrated(grid, other.particles)
    return perf_counter() - began


def given(grid: tawami.Grid) -> dict[str, Any]:
    """Arguments of another grid of the same cells."""
    return {"origin": grid.origin, "h": grid.h, "cells": grid.cells}


def weights() -> list[Weight]:
    """Times that particles and cells add to a step of a pile, on one rank."""
    counts, seconds, h = [], [], 0.01
    for per_axis, filled, cells in BLOCKS:
        size = (filled * h, filled * h)
        motion = pile.build(
            "u_epsv_finite", h=h, per_axis=per_axis, size=size, cells=(cells, cells)
        )
        times = list[float]()
        for _ in range(8):
            began = perf_counter()
            motion.step(PACE * h)
            times.append(perf_counter() - began)
        counts.append((motion.scene.num_particles, filled**2, cells**2 - filled**2, 1))
        seconds.append(np.median(times))
    found = np.linalg.lstsq(np.array(counts, dtype=float), np.array(seconds), rcond=None)[0]
    used = (PARTICLE, CELL, EMPTY)
    names = ("a particle", "a cell with particles", "a cell without")
    return [
        Weight(name, 1e6 * s, s / found[0], w / PARTICLE)
        for name, s, w in zip(names, found, used, strict=False)
    ]


def measured(ranks: int, steps: int, size: float, cells: str) -> Row:
    """The row of a run on several ranks."""
    words = [sys.executable, "-m", "cases.costs.balance", "--rank", str(steps), str(size), cells]
    command, environment = mpirun(ranks, words)
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(run.stderr)
    return Row(**json.loads(run.stdout.splitlines()[-1]))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print the tables."""
    options = PROGRAM.start(arguments)
    rows = [
        measured(ranks, options.steps, options.size, cells)
        for ranks in options.ranks
        for cells in ("even", "by particles")
    ]
    print("\nparticles of a rank, most / mean; time of a step [s]; of a move [steps]\n")
    print(as_text(rows, COLUMNS))
    print("\ntime that is added to a step; weights, in those of a particle\n")
    print(as_text(weights(), ("of", "us", "measured", "used")))
    PROGRAM.write("balance.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--rank"]:
        tawami.run(lambda: of_rank(int(sys.argv[2]), float(sys.argv[3]), sys.argv[4]), "balance")
    else:
        PROGRAM.run(main)
