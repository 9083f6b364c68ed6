"""Variants of the multigrid solver: iterations and processor time of one linear solve.

The system is that of the cantilever with nu = 0.4999 and 2n x n cells. Each variant changes one part of
the solver in `tawami.solve.multigrid`, with the same matrices and the same tolerance.

python -m cases.costs.preconditioners
python -m cases.costs.preconditioners --cells 32,256
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from time import process_time
from typing import Any

import numpy as np
from petsc4py import PETSc

from cases.common.program import Program, numbers, progress
from cases.common.table import as_csv, as_text
from cases.costs.bench.timed import beam

# internals, because no script chooses the parts of a preconditioner
from tawami.solve import blocks, multigrid

PROGRAM = Program("cases.costs.preconditioners", __doc__)
WHOLE = numbers(int, lambda n: n > 0, "whole numbers separated by commas, such as 32,64")
PROGRAM.option("--cells", type=WHOLE, default="64,128", help="cells over the height of the beam")

#: Options of one sweep forwards, of Chebyshev's iteration with Jacobi's preconditioner, and of GMRES.
FORWARDS = {"pc_sor_local_forward": None}
JACOBI = {"pc_type": "jacobi", "ksp_type": "chebyshev", "ksp_chebyshev_esteig": "0,0.15,0,1.1"}
MODIFIED = {"ksp_gmres_modifiedgramschmidt": None}
Cycle = PETSc.PC.MGType
COLUMNS = ("n", "variant", "iterations", "seconds")


@dataclass(frozen=True)
class Variant:
    """Changes of the solver.

    Attributes:
        smoother: Options of the smoothers of all grids.
        sweeps: Their number of sweeps or steps.
        cycle: Kind of the multigrid cycle.
        gmres: Options of GMRES.
        steps: Steps of Chebyshev's iteration for the volume.
        inodes: Whether products of the matrix go by groups of rows with the same pattern.
    """

    smoother: dict[str, str | None] = field(default_factory=dict)
    sweeps: int = 1
    cycle: Any = Cycle.KASKADE
    gmres: dict[str, str | None] = field(default_factory=dict)
    steps: int = multigrid.STEPS
    inodes: bool = False


VARIANTS = {
    "as it is": Variant(),
    "products by groups of rows": Variant(inodes=True),
    "modified Gram-Schmidt": Variant(gmres=MODIFIED),
    "3 steps for the volume": Variant(steps=3),
    "7 steps for the volume": Variant(steps=7),
    "two sweeps": Variant(sweeps=2),
    "sweep forwards only": Variant(smoother=FORWARDS),
    "sweeps before and after": Variant(cycle=Cycle.MULTIPLICATIVE),
    "forwards before and after": Variant(smoother=FORWARDS, cycle=Cycle.MULTIPLICATIVE),
    "F-cycle, forwards": Variant(smoother=FORWARDS, cycle=Cycle.FULL),
    "2 steps of Chebyshev-Jacobi": Variant(smoother=JACOBI, sweeps=2),
    "4 steps of Chebyshev-Jacobi": Variant(smoother=JACOBI, sweeps=4),
}


@dataclass(frozen=True)
class Row:
    """One linear solve."""

    n: int
    variant: str
    iterations: int
    seconds: float


def solved(n: int, variant: Variant) -> tuple[int, float]:
    """Iterations and processor time [s] of the linear solve of the cantilever."""
    scene = beam(n, linear_solver="multigrid")
    scene.solve()
    handles = scene.configuration.domain.newton._solver._multigrid._handles
    ksp, x = handles["ksp"], handles["x"]
    matrix, _ = ksp.getOperators()
    matrix.setOption(PETSc.Mat.Option.USE_INODES, variant.inodes)
    blocks.set_options(ksp, variant.gmres)
    of_u, of_volume = ksp.getPC().getFieldSplitSubKSP()
    of_volume.setTolerances(max_it=variant.steps)
    cycle = of_u.getPC()
    cycle.setMGType(variant.cycle)
    for level in range(1, cycle.getMGLevels()):
        smoother = cycle.getMGSmoother(level)
        smoother.setTolerances(max_it=variant.sweeps)
        blocks.set_options(smoother, variant.smoother)
    ksp.setGMRESRestart(multigrid.RESTART)
    start = process_time()
    ksp.solve(handles["b"], x)
    if ksp.getConvergedReason() <= 0:
        return multigrid.LIMIT, float(np.nan)
    return ksp.getIterationNumber(), process_time() - start


def rows_of(cells: Sequence[int]) -> Iterator[Row]:
    """All rows."""
    for n in cells:
        for name, variant in VARIANTS.items():
            yield Row(n, name, *solved(n, variant))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the table, write it as CSV."""
    options = PROGRAM.start(arguments)
    rows = list(progress(rows_of(options.cells)))
    print(as_text(rows, COLUMNS))
    PROGRAM.write("preconditioners.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
