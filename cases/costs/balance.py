"""Balance of the ranks: particles of the fullest rank compared with the mean, in the collapse of a pile.

dolfinx divides the cells of the grid among the ranks when the grid is made, whether they hold particles
or not. The command runs the first steps of the collapse on some numbers of ranks (which share the
processors of this machine). `most / mean` is the number of particles of the fullest rank over the mean,
at the start and at the end. `divided` is the same for cells divided by their particles at the end
(recursive bisection along the longer side). The last column is the time of another grid, in steps.

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

PROGRAM = Program("cases.costs.balance", __doc__)
WHOLE = numbers(int, lambda n: n > 0, "whole numbers separated by commas, such as 1,2,4")
PROGRAM.option("--ranks", type=WHOLE, default="1,2,4", help="numbers of ranks")
PROGRAM.option("--steps", type=int, default=20, help="steps")
PROGRAM.option("--size", type=float, default=0.01, help="cell size [m]")
DT = 1e-3  # [s]
COLUMNS = ("ranks", "start", "end", "divided", "step_s", "new_grid_steps")


@dataclass(frozen=True)
class Row:
    """A run: most / mean particles of a rank at the start, at the end, and of divided cells; seconds of
    a step; and the time of another grid in steps.
    """

    ranks: int
    start: float
    end: float
    divided: float
    step_s: float
    new_grid_steps: float


def most_over_mean(count: npt.NDArray[Any]) -> float:
    """The largest count over the mean."""
    return float(count.max() / count.mean())


def divided(weight: npt.NDArray[Any], parts: int) -> list[float]:
    """Sums of the weights of cells (y by x) in equal parts, by recursive bisection."""
    if parts == 1:
        return [float(weight.sum())]
    axis = int(np.argmax(weight.shape))
    sums = np.cumsum(weight.sum(axis=1 - axis))
    share = parts // 2 / parts
    cut = 1 + int(np.argmin(np.abs(sums[:-1] - share * sums[-1])))
    first, last = np.split(weight, [cut], axis=axis)
    return divided(first, parts // 2) + divided(last, parts - parts // 2)


def of_rank(steps: int, size: float) -> None:
    """Run on all ranks; the first one prints a row as JSON."""
    comm = MPI.COMM_WORLD
    motion = pile.build("u_epsv_finite", h=size)
    scene = motion.scene

    def count() -> float:
        return most_over_mean(np.array(comm.allgather(len(scene.particles))))

    start = count()
    motion.step(DT)  # compiles and analyses
    began = perf_counter()
    for _ in range(steps):
        motion.step(DT)
    step = (perf_counter() - began) / steps
    nx, ny = scene.grid.cells
    cells = scene.particles_per_cell.reshape(ny, nx)
    began = perf_counter()
    grid = tawami.Grid(comm, origin=scene.grid.origin, h=size, cells=(nx, ny))
    _ = grid.window
    other = perf_counter() - began
    parts = most_over_mean(np.array(divided(cells, comm.size)))
    row = Row(comm.size, start, count(), parts, step, other / step)
    if comm.rank == 0:
        print(json.dumps(vars(row)))


def measured(ranks: int, steps: int, size: float) -> Row:
    """The row of a run on several ranks."""
    words = [sys.executable, "-m", "cases.costs.balance", "--rank", str(steps), str(size)]
    command, environment = mpirun(ranks, words)
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(run.stderr)
    return Row(**json.loads(run.stdout.splitlines()[-1]))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print the table."""
    options = PROGRAM.start(arguments)
    rows = [measured(ranks, options.steps, options.size) for ranks in options.ranks]
    print("\nparticles of a rank, most / mean; time of a step [s]; another grid [steps]\n")
    print(as_text(rows, COLUMNS))
    PROGRAM.write("balance.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--rank"]:
        tawami.run(lambda: of_rank(int(sys.argv[2]), float(sys.argv[3])), "balance")
    else:
        PROGRAM.run(main)
