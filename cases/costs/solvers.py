"""Linear solvers: a factorisation of MUMPS and multigrid, on the cantilever and on collapsing piles.

Each row is a process of its own with one thread: processor time of one step without the making of the
scene, peak memory, and iterations of the linear solver. The growth exponent is the slope of the time in
the number of unknowns, in logarithms, between the coarsest and the finest grid of a solver. A second
table has the iterations of multigrid for a clamped beam by Poisson's ratio, tolerance and grid. A third
one compares the product with the assembled tangent, as scipy does it, with the residual of a linear
problem: laws and form at the particles, without a matrix.

python -m cases.costs.solvers
python -m cases.costs.solvers --cells 32,64,128,256 --particles 800,51200
"""

from __future__ import annotations

import itertools
import json
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from time import process_time
from unittest.mock import patch

import numpy as np

import tawami
from cases.common.program import Program, numbers, progress
from cases.common.table import as_csv, as_text
from cases.costs.bench.timed import Steps, beam, pile
from cases.verification.cantilever.mpm import build
from tawami.solve import measures

PROGRAM = Program("cases.costs.solvers", __doc__)
WHOLE = numbers(int, lambda n: n > 0, "whole numbers separated by commas, such as 32,64")
PROGRAM.option("--cells", type=WHOLE, default="32,64,128,256", help="cells over the beam")
PROGRAM.option("--particles", type=WHOLE, default="800,51200", help="particles of the piles")
PROGRAM.option("--steps", type=int, default=5, help="steps of a pile, of which the median is taken")

#: Poisson's ratios, tolerances, and the finest grid of the second table.
RATIOS, TOLERANCES, MOST = (0.0, 0.3, 0.4999, 0.499999), (1e-4, 1e-8), 128
#: Tolerance of the solve of a linear problem, relative to that of Newton's method.
OF_NEWTON = 0.3
#: Products of which the median is taken.
PRODUCTS = 7
SOLVERS = ("direct", "multigrid", "auto")
COUNTED = ("nu", "tolerance", "n", "iterations")
COLUMNS = ("scene", "solver", "unknowns", "seconds", "MB", "newton", "iterations")


@dataclass(frozen=True)
class Row:
    """A step: processor time [s], peak memory of the process, Newton and linear iterations."""

    scene: str
    solver: str
    unknowns: int
    seconds: float
    MB: int
    newton: int
    iterations: str


def of_beam(n: int, solver: str) -> Row:
    """Solve the cantilever with 2n x n cells."""
    beam(2, linear_solver=solver).solve()  # loads libraries and compiles the form
    scene = beam(n, linear_solver=solver)
    start = process_time()
    solution = scene.solve()
    return row(f"beam {n}", solver, solution, process_time() - start)


def of_pile(particles: int, solver: str, steps: int) -> Row:
    """Take some steps of a pile; the row has the median of their times."""
    motion, times = pile(round((particles / 800) ** 0.5), linear_solver=solver), []
    for _ in range(steps + 1):
        start = process_time()
        solution = motion.step(Steps.dt(particles))
        times.append(process_time() - start)
    return row(f"pile {particles}", solver, solution, float(np.median(times[1:])))


def row(scene: str, solver: str, solution: tawami.Solution, seconds: float) -> Row:
    """The row of a solution."""
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    iterations = "+".join(map(str, solution.krylov))
    return Row(scene, solver, solution.unknowns, seconds, memory, solution.iterations, iterations)


def measured(kind: str, size: int, solver: str, steps: int) -> Row:
    """A row, from a process of its own."""
    code = f"""
import dataclasses, json
from cases.costs import solvers
row = solvers.of_{kind}({size}, {solver!r}{f", {steps}" if kind == "pile" else ""})
print(json.dumps(dataclasses.asdict(row)))
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return Row(**json.loads(done.stdout.splitlines()[-1]))


def rows_of(cells: Sequence[int], particles: Sequence[int], steps: int) -> Iterator[Row]:
    """All rows; the solvers take turns."""
    scenes = [("beam", n) for n in cells] + [("pile", n) for n in particles]
    for kind, size in scenes:
        for solver in SOLVERS:
            yield measured(kind, size, solver, steps)


@dataclass(frozen=True)
class Iterations:
    """Iterations of multigrid to a tolerance of the linear system, on a grid of 2n x n cells."""

    nu: float
    tolerance: float
    n: int
    iterations: int


def iterations(cells: Sequence[int]) -> Iterator[Iterations]:
    """Iterations for the clamped beam, alpha = 0.01, which is solved once."""
    for nu, tolerance, n in itertools.product(RATIOS, TOLERANCES, cells):
        scene = build(
            "u_epsv", "clamped", n, alpha=0.01, material=tawami.linear_elastic(E=3e6, nu=nu),
            linear_solver="multigrid", tolerance=tolerance / OF_NEWTON,
        )  # fmt: skip
        with patch.object(measures, "LINEAR", 1.0):  # to this tolerance and not further
            yield Iterations(nu, tolerance, n, scene.solve().krylov[0])


@dataclass(frozen=True)
class Product:
    """Milliseconds of a product with the tangent, and the memory of the matrix [MB]."""

    n: int
    assembled: float
    matrix_free: float
    MB: float


def product(n: int) -> Product:
    """Products for the cantilever with 2n x n cells; the median of some."""
    scene = beam(n)
    newton, x = scene.configuration.domain.newton, np.zeros(scene.num_coefficients)
    tangent = scene.tangent(x)
    x += np.random.default_rng(0).standard_normal(len(x))

    def milliseconds(multiply: Callable[[], object]) -> float:
        times = []
        for _ in range(PRODUCTS):
            start = process_time()
            multiply()
            times.append(1e3 * (process_time() - start))
        return float(np.median(times))

    memory = 1e-6 * (tangent.data.nbytes + tangent.indices.nbytes + tangent.indptr.nbytes)
    of_matrix, of_particles = lambda: tangent @ x, lambda: newton.internal(x)
    return Product(n, milliseconds(of_matrix), milliseconds(of_particles), memory)


def exponent(rows: Sequence[Row]) -> float:
    """Slope of the time in the number of unknowns, in logarithms, from the first to the last row."""
    first, last = rows[0], rows[-1]
    return float(np.log(last.seconds / first.seconds) / np.log(last.unknowns / first.unknowns))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the table, write it as CSV."""
    options = PROGRAM.start(arguments)
    rows = list(progress(rows_of(options.cells, options.particles, options.steps)))
    print(as_text(rows, COLUMNS))
    for solver in SOLVERS if len(options.cells) > 1 else ():
        mine = [r for r in rows if r.solver == solver and r.scene.startswith("beam")]
        print(f"growth exponent of the beam, {solver}: {exponent(mine):.2f}")
    print(as_text(list(iterations([n for n in options.cells if n <= MOST])), COUNTED))
    products = [product(n) for n in options.cells if n <= MOST]
    print(as_text(products, ("n", "assembled", "matrix_free", "MB")))
    PROGRAM.write("solvers.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
