"""The study of the elastica: tip and mean stress over cells, steps, ghost penalty and particles.

python -m cases.verification.elastica
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tqdm import tqdm

from cases.common.program import Program, progress
from cases.common.table import as_csv, as_text
from cases.verification.elastica import figures
from cases.verification.elastica.mpm import COLUMNS, Run, solve
from cases.verification.elastica.strip import LOADS, tip

#: Runs of the study: differences from u_epsv_finite, nu = 0.3, 4 cells, 2 x 2 particles, 20 steps,
#: k = 0.01.
STUDY: dict[str, list[dict[str, Any]]] = {
    "cells": [
        {"form": form, "nu": nu, "n": n}
        for form in ("u_epsv_finite", "u_finite")
        for nu in (0.3, 0.49, 0.499)
        for n in (2, 4, 8)
    ],
    "bbar": [{"form": "u_bbar_finite", "n": n} for n in (2, 4, 8)],
    "steps": [{"steps": steps, "k": k} for k in (1e-3, 1e-2, 1e-1) for steps in (10, 40, 80, 160)],
    "k": [{"k": k} for k in (0.0, 1e-4, 1e-3, 1e-1)],
    "particles": [{"per_axis": 3}, {"per_axis": 4}],
    "slender": [{"slender": 40}],
    "alpha": [{"alpha": 0.1}],
}

PROGRAM = Program("cases.verification.elastica", __doc__)
PROGRAM.option("--steps", type=int, default=160, help="leave out the runs with more steps")
PROGRAM.option("--cells", type=int, default=8, help="leave out the runs with more cells")


def study(most_steps: int, most_cells: int) -> dict[str, list[Run]]:
    """Run the parts of the study, and print why a run ended early."""
    work = [
        (name, load, change)
        for name in STUDY
        for load in LOADS
        for change in STUDY[name]
        if change.get("steps", 0) <= most_steps and change.get("n", 0) <= most_cells
    ]
    runs: dict[str, list[Run]] = {name: [] for name in STUDY}
    for name, load, change in progress(work, desc="elastica"):
        run = solve(load, **change)
        if run.stopped:
            tqdm.write(f"{name}, load {load:g}, {change}: stopped {run.stopped}")
        else:
            runs[name].append(run)
    return runs


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study, print the table, draw the figures."""
    options = PROGRAM.start(arguments)
    for load in LOADS:
        x, y = tip(load)
        print(f"elastica, PL^2/EI = {load:g}: the tip moves ({x:.4f}, {y:.4f}) L")
    runs = study(options.steps, options.cells)
    rows = [run for name in STUDY for run in runs[name]]
    print(as_text(rows, COLUMNS))
    PROGRAM.write("table.csv", as_csv(rows, COLUMNS))

    cells = [*runs["cells"], *runs["bbar"]]
    standard = [run for run in cells if (run.form, run.nu, run.n) == ("u_epsv_finite", 0.3, 4)]
    bent = [run for run in cells if run.n == 4 and (run.nu == 0.499 or run.form == "u_bbar_finite")]
    figures.shapes(bent, PROGRAM.folder / "shapes.png")
    figures.errors(cells, [*runs["steps"], *runs["k"], *standard], PROGRAM.folder / "errors.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
