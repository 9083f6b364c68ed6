"""The bearing capacity of a rigid circular footing on weightless Tresca clay, smooth and rough.

    axis        R = 1 m
     |=============|                       the half plane r > 0 of an axisymmetric grid, 3 m x 2 m
     o                               o     right edge smooth, bottom held; the axis holds itself
     o            clay               o     s_u = 1 kPa, mu = 667 s_u, nu = 0.499, Tresca (phi = 0)
     o_______________________________o

Under the displacement of the footing its mean pressure grows to

    q = 5.69 s_u  with a smooth base (Shield 1955, J. Mech. Phys. Solids 4, 10),
    q = 6.05 s_u  with a rough base  (Eason and Shield 1960, Z. angew. Math. Phys. 11, 33).

As under the strip footing (`cases.verification.footing`) the base is a part of the border of the ground,
r < R, so that the radius is exact on every grid. With 2, 4 and 8 cells over R, q is 5.7, 2.5 and 1.4 %
too large with a rough base, and 9.8, 3.3 and 1.9 % with a smooth one.

python -m cases.verification.circular_footing
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Literal

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.common.program import Program, progress
from cases.common.table import as_csv, as_text

Array = npt.NDArray[np.float64]

RADIUS, WIDTH, DEPTH = 1.0, 3, 2  # of footing and ground [m]
S_U, RIGIDITY = 1.0e3, 667.0  # undrained strength [Pa], mu/s_u [-]
SETTLEMENT = 10.0  # of the footing at the end, in units of s_u R/mu
Base = Literal["smooth", "rough"]
EXACT: dict[Base, float] = {"smooth": 5.69, "rough": 6.05}
COLUMNS = ("base", "form", "n", "last", "error", "growth", "steps", "seconds")


@dataclass
class Run:
    """A run and its records.

    Attributes:
        base: Base of the footing.
        form: Weak form.
        n: Cells over its radius.
        settlement: Settlement, in units of s_u R/mu, at the start and after every step.
        q: Mean pressure over s_u.
        seconds: Wall time.
    """

    base: Base
    form: str
    n: int
    settlement: list[float] = field(default_factory=lambda: [0.0])
    q: list[float] = field(default_factory=lambda: [0.0])
    seconds: float = 0.0

    @property
    def last(self) -> float:
        """Pressure at the end, over s_u."""
        return self.q[-1]

    @property
    def error(self) -> float:
        """Error of the pressure at the end [%]."""
        return 100 * (self.last / EXACT[self.base] - 1)

    @property
    def growth(self) -> float:
        """Growth of the pressure over the last quarter of the settlement [%]."""
        before = np.interp(0.75 * self.settlement[-1], self.settlement, self.q)
        return float(100 * (self.last / before - 1))

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.q) - 1


def under_footing(r: Array, z: Array) -> npt.NDArray[np.bool_]:
    """Whether points of the border are under the footing."""
    return (z == 0) & (r < RADIUS)


def solve(base: Base, n: int, form: str = "u_epsv", step: float = 0.05) -> Run:
    """Press the footing down, in steps of at most the share `step` of the settlement."""
    begin, run = perf_counter(), Run(base, form, n)
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0.0, -DEPTH), h=RADIUS / n, cells=(WIDTH * n, DEPTH * n),
        geometry="axisymmetric",
    )  # fmt: skip
    ground = tawami.box(grid, (0.0, -DEPTH), (WIDTH, 0.0), per_axis=2, gauss=True)
    elastic = tawami.linear_elastic(E=2 * RIGIDITY * S_U * 1.499, nu=0.499)
    clay = tawami.mohr_coulomb(elastic, phi=0.0, c=S_U)
    scene = tawami.Scene(grid, ground, clay, form=form, tolerance=1e-5)
    for edge, component in (("right", "x"), ("bottom", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    scene.fix(under_footing, "y", -SETTLEMENT * RADIUS / RIGIDITY)
    if base == "rough":
        scene.fix(under_footing, "x")

    def record(solution: tawami.Solution) -> None:
        force = -solution.reaction("top")[1]  # of the whole footing [N]
        run.q.append(force / (np.pi * RADIUS**2 * S_U))
        run.settlement.append(-solution.displacement((1e-6, 0.0))[1] * RIGIDITY / RADIUS)

    tawami.ramp(scene, step, each=record, stop="raise")
    run.seconds = perf_counter() - begin
    return run


PROGRAM = Program("cases.verification.circular_footing", __doc__)
PROGRAM.option("--cells", type=int, default=16, help="most cells over the radius")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run both bases on finer and finer grids, and print the table."""
    options = PROGRAM.start(arguments)
    cells = [n for n in (2, 4, 8, 16) if n <= options.cells]
    work = [(base, n) for base in EXACT for n in cells]
    rows = [solve(*one) for one in progress(work, desc="circular footing")]
    rows.append(solve("rough", cells[0], form="u"))
    print(as_text(rows, COLUMNS))
    PROGRAM.write("table.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
