"""The study of the vibrating beam: table and figures.

Five periods of the first bending mode. The period is compared with Timoshenko's theory (beam.py) and
with finite elements (fem.py), the sum of kinetic and elastic energy with its value at the start.

python -m cases.verification.vibrating_beam
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from cases.common.program import Program, progress
from cases.verification.vibrating_beam import fem, figures
from cases.verification.vibrating_beam.beam import AMPLITUDE, NUS, D, L, first_bending
from cases.verification.vibrating_beam.mpm import TRANSFERS, Run, solve

#: Runs of the study: differences from affine FLIP, u_epsv_finite, 4 cells, 2 x 2 particles, 50 steps,
#: alpha = 0.01.
STUDY: dict[str, list[dict[str, Any]]] = {
    "transfer": [{"transfer": transfer} for transfer in TRANSFERS],
    "steps": [{"steps": steps} for steps in (12, 25, 100)],
    "cells": [{"n": 2}, {"n": 8}],
    "form": [{"form": "u_finite"}],
    "particles": [{"per_axis": 3}],
    "alpha": [{"alpha": alpha} for alpha in (0.0, 0.1)],
}
COLUMNS = (
    "  nu form          transfer    cells particles steps alpha |"
    "  period [s] of Timoshenko      of FEM  expected |  energy at end highest | crossed      s"
)

PROGRAM = Program("cases.verification.vibrating_beam", __doc__)


def row(run: Run, period_fem: float) -> str:
    """A run as a line of the table; periods as differences from the two references."""
    theory = 2 * np.pi / first_bending(run.nu)
    alpha = f"{run.alpha:5.2f}" if run.form == "u_epsv_finite" else "     "
    return (
        f"{run.nu:4} {run.form:13} {run.transfer:11} {run.n:5} {run.per_axis:6}^2 {run.steps:6} "
        f"{alpha} | {run.period:11.4f} {100 * (run.period / theory - 1):+11.2f} % "
        f"{100 * (run.period / period_fem - 1):+9.2f} % {100 * run.expected:+7.2f} % | "
        f"{100 * run.energy[-1]:12.2f} % {run.energy.max():8.5f} | {100 * run.crossed:5.0f} % "
        f"{run.seconds:6.1f}"
    )


def periods_of_fem() -> dict[float, float]:
    """Period [s] by finite elements for each Poisson's ratio; prints it next to Timoshenko's."""
    periods = {}
    for nu in NUS:
        periods[nu] = 2 * np.pi / fem.solve(nu, 32).omega[0]
        theory = 2 * np.pi / first_bending(nu)
        print(
            f"nu = {nu:4}: period {theory:.4f} s by Timoshenko, {periods[nu]:.4f} s by finite "
            f"elements ({100 * (periods[nu] / theory - 1):+.2f} %)"
        )
    return periods


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study, print the table, draw the figures."""
    PROGRAM.start(arguments)
    print(f"L/D = {L / D:g}, amplitude L/{L / AMPLITUDE:g}, five periods")
    periods = periods_of_fem()
    print(f"\n{COLUMNS}", flush=True)
    runs: dict[str, list[Run]] = {name: [] for name in STUDY}
    work = [(name, nu, change) for name in STUDY for nu in NUS for change in STUDY[name]]
    for name, nu, change in progress(work, desc="beam"):
        run = solve(nu, **change)
        runs[name].append(run)
        tqdm.write(row(run, periods[nu]))
        sys.stdout.flush()
    standard = [run for run in runs["transfer"] if run.transfer == "affine_flip"]
    figures.motion(runs["transfer"], periods, PROGRAM.folder / "motion.png")
    figures.accuracy(
        runs["steps"] + standard, runs["cells"] + standard, periods, PROGRAM.folder / "accuracy.png"
    )
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
