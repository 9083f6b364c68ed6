"""Creep of a block in shear: Kelvin and Voigt's model.

        -> -> ->  tau       side 1 m, mu = 1 MPa, eta = 3 MPa s, tau = 1 kPa
       |         |
    |  |         |  ^       shear stress on all sides, the base held
    v  |_________|  |

    gamma = tau/mu (1 - exp(-t mu/eta)),

and until the stress is taken away at t_1, then gamma(t_1) exp(-(t - t_1) mu/eta). Backward Euler gives
1 - (1 + dt mu/eta)^-n after n steps, whose error is linear in dt.

python -m cases.verification.creep
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

import tawami
from cases.common.figure import save
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from tawami.picture import style

MU, NU, ETA, TAU = 1.0e6, 0.3, 3.0e6, 1.0e3  # [Pa], [-], [Pa s], [Pa]
RELEASE, END = 9.0, 18.0  # [s]


def exact(t: float) -> float:
    """Shear strain over tau/mu."""
    loaded = 1 - np.exp(-min(t, RELEASE) * MU / ETA)
    return float(loaded * np.exp(-max(t - RELEASE, 0.0) * MU / ETA))


def euler(steps: int) -> float:
    """Shear strain over tau/mu at the release by backward Euler."""
    return float(1 - (1 + RELEASE / steps * MU / ETA) ** -steps)


@dataclass(frozen=True)
class Run:
    """A run with a number of steps until the release.

    Attributes:
        steps: Steps until the release, and from there to the end.
        times, strains: Times [s] and shear strains over tau/mu.
        at_release: Shear strain at the release over tau/mu.
        error: Its error [%].
        from_euler: Difference from backward Euler's.
    """

    steps: int
    times: tuple[float, ...]
    strains: tuple[float, ...]
    at_release: float
    error: float
    from_euler: float


COLUMNS = ("steps", "at_release", "error", "from_euler")


def solve(steps: int) -> Run:
    """Shear the block, and release it."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(2, 2))
    block = tawami.box(grid, (0.0, 0.0), (1.0, 1.0), gauss=True)
    law = tawami.linear_elastic(E=2 * MU * (1 + NU), nu=NU)
    scene = tawami.Scene(grid, block, law, form="u_epsv_visco")
    scene.data("eta", ETA)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    loads = [
        scene.traction(edge, (TAU * x, TAU * y))
        for edge, x, y in (("top", 1, 0), ("right", 0, 1), ("left", 0, -1))
    ]
    times, strains = [0.0], [0.0]
    for k in range(1, 2 * steps + 1):
        if k == steps + 1:
            for load in loads:
                load.change((0.0, 0.0))
        times.append(END * k / (2 * steps))
        solution = scene.solve(until=times[-1])
        strains.append(2 * float(solution.strain[:, 3].mean()) * MU / TAU)
    found = strains[steps]
    error = 100 * (found / exact(RELEASE) - 1)
    return Run(steps, tuple(times), tuple(strains), found, error, found - euler(steps))


def draw(runs: Sequence[Run], path: Path) -> None:
    """Draw the strain over time, and the error over the steps."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    t = np.linspace(0, END, 300)
    left.plot(t, [exact(time) for time in t], "k", label="closed form")
    for run, colour in zip(runs[::2], style.LINES, strict=False):
        left.plot(
            run.times, run.strains, "o", color=colour, label=f"{run.steps} steps to the release"
        )
    left.set_xlabel("time [s]")
    left.set_ylabel("shear strain $\\gamma \\mu/\\tau$ [-]")
    steps = np.array([run.steps for run in runs])
    right.loglog(
        steps, [abs(run.error) for run in runs], "o", color=style.VERMILION, label="particles"
    )
    right.loglog(steps, abs(runs[-1].error) * steps[-1] / steps, "k:", label="slope -1")
    right.set_xlabel("steps to the release")
    right.set_ylabel("error of the strain at the release [%]")
    for axes in (left, right):
        axes.grid()
        axes.legend()
    save(figure, path)


PROGRAM = Program("cases.verification.creep", __doc__)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run with several steps, print the table, draw the figure."""
    PROGRAM.start(arguments)
    runs = [solve(steps) for steps in (5, 10, 20, 40, 80)]
    print(as_text(runs, COLUMNS))
    PROGRAM.write("table.csv", as_csv(runs, COLUMNS))
    draw(runs, PROGRAM.folder / "creep.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
