"""The collapse of a pile with each form, and of piles of other shapes.

python -m cases.showcase.collapse                     with each form, to 0.8 s
python -m cases.showcase.collapse --aspects           run-out of piles 0.5 to 4 times as high as long
python -m cases.showcase.collapse --incompressible    nu = 0.4999, alpha = 0.1, to 0.4 s
python -m cases.showcase.collapse --movie             the mixed form alone, as a moving picture
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np

import tawami
from cases.common.program import Program
from cases.common.table import as_text
from cases.showcase.collapse import figures
from cases.showcase.collapse.pile import FORMS, Run, build, solve
from cases.showcase.collapse.runout import exponents, runouts

PROGRAM = Program("cases.showcase.collapse", __doc__)
PROGRAM.option("--end", type=float, default=0.8, help="time of the end [s]")
PROGRAM.option("--dt", type=float, default=1e-3, help="size of a step [s]")
PROGRAM.option("--cell", type=float, default=0.01, help="size of a cell [m]")
PROGRAM.option("--aspects", action="store_true", help="compare piles of other shapes")
PROGRAM.option("--incompressible", action="store_true", help="nu = 0.4999 to 0.4 s")
PROGRAM.option("--movie", action="store_true", help="write a moving picture of the mean stress")

COLUMNS = (
    "form", "end", "steps", "smallest_step", "mean_iterations", "most_iterations", "run_out",
    "roughness", "seconds",
)  # fmt: skip


def row(run: Run) -> SimpleNamespace:
    """A run as a line of the table; the roughness of the mean stress is the median over time."""
    return SimpleNamespace(
        form=run.form,
        end=run.time[-1],
        steps=len(run.dt),
        smallest_step=min(run.dt),
        mean_iterations=float(np.mean(run.iterations)),
        most_iterations=max(run.iterations),
        run_out=run.runout[-1],
        roughness=float(np.median(run.roughness[1:])),
        seconds=run.seconds,
    )


def compare_forms(h: float, dt: float, end: float) -> None:
    """Run the collapse with each form, print the table, draw the figures."""
    print(build("u_epsv_finite", h=h).header(), flush=True)
    runs = []
    for form in FORMS:
        try:
            run = solve(form, h=h, dt=dt, end=end)
        except (tawami.ConvergenceError, tawami.SingularError) as error:
            if form == "u_epsv_finite":
                raise
            print(f"{form:14} stopped early: {str(error)[:200]} ...", flush=True)
        else:
            runs.append(run)
            print(f"{form:14} {run.energies[-1]}", flush=True)
    print(as_text([row(run) for run in runs], COLUMNS))
    figures.film(runs, PROGRAM.folder / "film.png")
    figures.profiles(runs, PROGRAM.folder / "profiles.png", h)
    figures.histories(runs, PROGRAM.folder / "histories.png")


def compare_aspects() -> None:
    """Compare the run-outs of piles from low to high."""
    piles = []
    for pile in runouts():
        piles.append(pile)
        print(f"a = {pile.aspect:4.2f}: run-out {pile.spread:.3f} of the length", flush=True)
    low, high = exponents(piles)
    print(f"exponents: {low:.2f} up to a = 1.5, {high:.2f} from there on")
    figures.runouts(piles, PROGRAM.folder / "runouts.png")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the collapse, print its numbers, draw it."""
    options = PROGRAM.start(arguments)
    if options.incompressible:
        run = solve("u_epsv_finite", nu=0.4999, alpha=0.1, end=min(options.end, 0.4))
        print(as_text([row(run)], COLUMNS))
        return
    if options.movie:
        run = solve("u_epsv_finite", h=options.cell, dt=options.dt, end=options.end, every=10)
        figures.movie(run, PROGRAM.folder / "collapse.gif")
    elif options.aspects:
        compare_aspects()
    else:
        compare_forms(options.cell, options.dt, options.end)
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
