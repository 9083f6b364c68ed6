"""The study of Cook's membrane: deflection by the MPM with each form, compared with finite elements.

python -m cases.verification.cook
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from time import perf_counter

from cases.common.program import Program, numbers, progress
from cases.common.table import as_csv, as_text
from cases.verification.cook import fem, figures, mpm
from cases.verification.cook.membrane import COLUMNS, LENGTH, REFERENCE, Row

SIZES = [4.0, 2.0, 1.0, 0.5]
SHOWN = ("u_epsv_0.1", "u_epsv_0.01", "u_bbar", "u")  # methods whose mean stress is drawn
FINE = 1.0  # their cell size

PROGRAM = Program("cases.verification.cook", __doc__)
PROGRAM.option(
    "--sizes",
    type=numbers(
        float, lambda h: h > 0 and (4 / h).is_integer(), "divisors of 4 such as 4,2,1,0.5"
    ),
    default=SIZES,
    help="cell sizes, each a divisor of 4; 4,2,1,0.5 by default",
)


def rows_of(sizes: Sequence[float]) -> list[Row]:
    """Solve with every method, body, Poisson's ratio and cell size."""
    work = [partial(fem.solve, m, nu, round(LENGTH / h))
            for nu in REFERENCE for m in fem.METHODS for h in sizes]  # fmt: skip
    work += [partial(_mpm_row, m, nu, h, body)
             for nu in REFERENCE for body in mpm.BODIES for m in mpm.METHODS for h in sizes]  # fmt: skip
    return [run() for run in progress(work, desc="cook", unit="run")]


def _mpm_row(method: str, nu: float, h: float, body: str) -> Row:
    return mpm.solve(method, nu, h, body)[0]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and list its results."""
    options = PROGRAM.start(arguments)
    start = perf_counter()
    rows = rows_of(options.sizes)
    nu = max(REFERENCE)
    solutions = {method: mpm.solve(method, nu, FINE)[1] for method in SHOWN}
    figures.deflection_error(rows, PROGRAM.folder / "deflection_error.png")
    figures.mean_stress(solutions, nu, FINE, PROGRAM.folder / "mean_stress.png")
    PROGRAM.write("cook.csv", as_csv(rows, COLUMNS))
    print(as_text(rows, COLUMNS))
    print(f"\n{len(rows)} computations in {perf_counter() - start:.1f} s")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
