"""Orderings of MUMPS: processor time, memory and fill of one factorisation.

The tangents are those of the cantilever (symmetric: LDL^T) and of a pile of sand in motion (unsymmetric:
LU), scaled as the solver scales them. `analysis` is the part that a second factorisation saves.

python -m cases.costs.ordering
python -m cases.costs.ordering --cells 64,256 --pile-cells 10,40
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from cases.common.program import Program, numbers, progress
from cases.common.table import as_csv, as_text
from cases.costs.bench.timed import beam, pile

# internals, because no script chooses the ordering
from tawami.base.timing import Stopwatch
from tawami.solve import direct

PROGRAM = Program("cases.costs.ordering", __doc__)
WHOLE = numbers(int, lambda n: n > 0, "whole numbers separated by commas, such as 32,64")
PROGRAM.option("--cells", type=WHOLE, default="4,8,16,32,64,128", help="cells over the beam")
PROGRAM.option("--pile-cells", type=WHOLE, default="10,40", help="cells over the pile")
PROGRAM.option("--repeat", type=int, default=5, help="repetitions, of which the median is taken")

#: ICNTL(7) of the orderings that every MUMPS has.
ORDERINGS = {"AMD": 0, "AMF": 2, "PORD": 4, "QAMD": 6}
COLUMNS = (
    "scene", "unknowns", "method", "ordering", "analysis_ms", "numeric_ms", "total_ms", "solve_ms",
    "million_entries", "MB",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One ordering of a tangent: medians of the processor time [ms], entries of the factors, memory."""

    scene: str
    unknowns: int
    method: str
    ordering: str
    analysis_ms: float
    numeric_ms: float
    total_ms: float
    solve_ms: float
    million_entries: float
    MB: int


class Factorisation(direct.DirectSolver):
    """Factorisations of one scaled matrix, timed."""

    def __init__(self, matrix: Any, symmetric: bool) -> None:
        super().__init__(MPI.COMM_SELF, Stopwatch())
        self.matrix, self.symmetric = matrix, symmetric

    def timed(self) -> tuple[float, float, float]:
        """Seconds of a factorisation with analysis, of one without, and of a solve."""
        self.forget()
        self._handles["x"], self._handles["b"] = self.matrix.createVecs()
        times = []
        for _ in range(2):
            self.matrix.stateIncrease()
            start = process_time()
            self._mumps(self.matrix, direct.ROOM[0])
            times.append(process_time() - start)
        self._handles["b"].set(1.0)
        start = process_time()
        self._handles["factor"].solve(self._handles["b"], self._handles["x"])
        return times[0], times[1], process_time() - start

    def info(self, number: int) -> int:
        """INFOG of MUMPS."""
        return int(self._handles["factor"].getMumpsInfog(number))


def tangents(cells: Sequence[int], pile_cells: Sequence[int]) -> Iterator[tuple[str, Any, bool]]:
    """Name, scaled tangent and its symmetry of each scene."""
    for n in cells:
        scene = beam(n, linear_solver="direct")
        scene.solve()
        yield f"beam {n}", *last_tangent(scene.configuration.domain.newton)
    for n in pile_cells:
        motion = pile(n // 10, linear_solver="direct")
        newton = motion.scene.configuration.domain.newton  # that of the cells before the step
        motion.step(1e-3)
        yield f"pile {n}", *last_tangent(newton)


def last_tangent(newton: Any) -> tuple[Any, bool]:
    """The last factorised tangent, scaled, and its symmetry."""
    matrix, symmetric = newton._solver._analysed
    return matrix.copy(), symmetric


def rows_of(scene: str, matrix: Any, symmetric: bool, repeat: int) -> Iterator[Row]:
    """One row for each ordering."""
    size, method = matrix.getSize()[0], "LDL^T" if symmetric else "LU"
    chosen = direct.OPTIONS[7]
    try:
        for name, number in ORDERINGS.items():
            direct.OPTIONS[7] = number
            solver = Factorisation(matrix, symmetric)
            times = np.median([solver.timed() for _ in range(repeat)], axis=0)
            total, numeric, solve = (1e3 * float(seconds) for seconds in times)
            assert solver.info(7) == number
            fill = solver.info(29)
            yield Row(
                scene, size, method, name, total - numeric, numeric, total, solve,
                fill / 1e6 if fill > 0 else -float(fill), solver.info(22),
            )  # fmt: skip
            solver.forget()
    finally:
        direct.OPTIONS[7] = chosen


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the table, write it as CSV."""
    options = PROGRAM.start(arguments)
    scenes = tangents(options.cells, options.pile_cells)
    rows = [row for scene in progress(scenes) for row in rows_of(*scene, options.repeat)]
    print(as_text(rows, COLUMNS))
    PROGRAM.write("ordering.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
