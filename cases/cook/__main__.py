"""Cook's membrane: deflection by mixed, B-bar and displacement-only MPM beside FEM.

python -m cases.cook [--results results/cook] [--sizes 4,2,1,0.5]
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from functools import partial
from time import perf_counter

import matplotlib
from mpi4py import MPI
from tqdm import tqdm

import tawami
from cases.cook import fem, figures, mpm
from cases.cook.membrane import COLUMNS, LENGTH, REFERENCE, Row
from cases.table import as_csv, as_text
from tawami.base.files import atomic_file, result_folder
from tawami.fem.environment import header

SHOWN = ("u_epsv_0.1", "u_epsv_0.01", "u_bbar", "u")  # methods whose mean stress is drawn


def rows_of(sizes: Sequence[float]) -> list[Row]:
    """Every method, body, Poisson's ratio and cell size."""
    work = [partial(fem.solve, m, nu, round(LENGTH / h))
            for nu in REFERENCE for m in fem.METHODS for h in sizes]  # fmt: skip
    work += [lambda run=(m, nu, h, body): mpm.solve(*run)[0]
             for nu in REFERENCE for body in mpm.BODIES for m in mpm.METHODS for h in sizes]  # fmt: skip
    live = MPI.COMM_WORLD.rank == 0 and sys.stderr.isatty()
    return [run() for run in tqdm(work, desc="cook", unit="run", disable=not live)]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and say where the results are."""
    parser = argparse.ArgumentParser(prog="python -m cases.cook", description=__doc__)
    parser.add_argument("--results", default="results/cook", help="folder for the results")
    parser.add_argument("--sizes", default="4,2,1,0.5", help="cell sizes, each a divisor of 4")
    options = parser.parse_args(arguments)
    try:
        sizes = [float(h) for h in options.sizes.split(",")]
        if not all(h > 0 and (4 / h).is_integer() for h in sizes):
            raise ValueError
    except ValueError:
        parser.error(f"--sizes {options.sizes}: expected divisors of 4 such as 4,2,1,0.5")

    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    start = perf_counter()
    rows = rows_of(sizes)
    nu, h = max(REFERENCE), 1.0
    solutions = {method: mpm.solve(method, nu, h)[1] for method in SHOWN}
    if MPI.COMM_WORLD.rank == 0:
        figures.deflection_error(rows, folder / "deflection_error.png")
        figures.mean_stress(solutions, nu, h, folder / "mean_stress.png")
        with atomic_file(folder / "cook.csv") as part:
            part.write_text(as_csv(rows, COLUMNS))
    print(as_text(rows, COLUMNS))
    print(f"\n{len(rows)} computations in {perf_counter() - start:.1f} s. Results: {folder}/")


if __name__ == "__main__":
    tawami.run(main, "cook")
