"""The whole study of the cantilever: table, figures, VTU files and a report.

python -m cases.cantilever [--results results/cantilever] [--cells 2,4,8,16,32]
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter

import matplotlib
from mpi4py import MPI
from tqdm import tqdm

import tawami
from cases.cantilever import figures, mpm
from cases.cantilever.beam import (
    COLUMNS,
    SUPPORTS,
    V_THEORY,
    P,
    Row,
    point_support_growth,
)  # fmt: skip
from cases.cantilever.study import CELLS, runs
from cases.table import as_csv, as_text
from tawami.base.files import atomic_file, result_folder
from tawami.fem.environment import header
from tawami.results.single import write_grid, write_particles

FIELDS = {
    "displacement only": ("u", None),
    "B-bar": ("u_bbar", None),
    r"$u$-$\varepsilon_v$, $\alpha$ = 0": ("u_epsv", 0.0),
    r"$u$-$\varepsilon_v$, $\alpha$ = 0.1": ("u_epsv", 0.1),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and say where the results are."""
    parser = argparse.ArgumentParser(prog="python -m cases.cantilever", description=__doc__)
    parser.add_argument("--results", default="results/cantilever", help="folder for the results")
    parser.add_argument("--cells", default=",".join(map(str, CELLS)), help="cells over the height")
    options = parser.parse_args(arguments)
    try:
        cells = tuple(int(n) for n in options.cells.split(","))
        if not cells or any(n < 2 or n % 2 for n in cells):
            raise ValueError
    except ValueError:
        parser.error(f"--cells {options.cells}: expected even numbers such as 2,4,8")

    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    start = perf_counter()
    work = list(runs(cells))
    first = MPI.COMM_WORLD.rank == 0
    live = first and sys.stderr.isatty()
    rows = [run() for run in tqdm(work, desc="cantilever", unit="run", disable=not live)]
    solutions = {}
    for support in ("paper", "exact"):
        for title, (method, alpha) in FIELDS.items():
            solution = solutions[support, title] = mpm.solve(method, support, 16, alpha)[1]
            name = method if alpha is None else f"{method}_{alpha:g}"
            write_particles(folder / f"particles_{name}_{support}_n16.vtu", solution)
            write_grid(folder / f"grid_{name}_{support}_n16.vtu", solution)
    if first:
        draw(rows, solutions, folder)
        with atomic_file(folder / "cantilever.csv") as part:
            part.write_text(as_csv(rows, COLUMNS))
        with atomic_file(folder / "report.md") as part:
            part.write_text(report(rows))
    print(as_text(rows, COLUMNS))
    print(paper_support_in_words(rows))
    print(f"\n{len(work)} computations in {perf_counter() - start:.1f} s. Results: {folder}/")
    for name in sorted(path.name for path in folder.iterdir() if not path.name.startswith(".")):
        print(f"  {folder / name}")


def draw(
    rows: Sequence[Row], solutions: Mapping[tuple[str, str], tawami.Solution], folder: Path
) -> None:
    """The figures; solutions by support and title."""
    figures.deflection_error(rows, folder / "deflection_error.png")
    three = {title: solutions["paper", title] for title in list(FIELDS)[1:]}
    figures.mean_stress_paper(three, folder / "mean_stress_paper.png")
    exact = {title: solutions["exact", title] for title in FIELDS}
    figures.mean_stress_exact(exact, folder / "mean_stress_exact.png")


def paper_support_in_words(rows: Sequence[Row]) -> str:
    """Why the support `paper` has no limit, beside what the finest meshes show."""
    growth = 100 * point_support_growth() / V_THEORY
    line = {row.n: row.error_percent for row in rows
            if (row.method, row.support) == ("fem_taylor_hood", "paper")}  # fmt: skip
    measured = ""
    if len(line) > 1:
        coarse, fine = sorted(line)[-2:]
        measured = (
            f" The Taylor-Hood solution grows by {line[fine] - line[coarse]:.3f} % from n = "
            f"{coarse} to {fine}."
        )
    return (
        "\nThe support `paper` has no limit: the single point held at the root carries the whole "
        f"reaction P = {P:g} N, and under a point force the displacement of a plane body is "
        "infinite, growing like ln(1/r); the grid cuts this off at r ~ h. Mirrored at the root it is "
        "Kelvin's force 2 P in a full plane, so that every halving of h adds 2 P (3 - 4 nu) ln 2 / "
        f"(8 pi mu (1 - nu)) = {point_support_growth():.4g} m to the deflection, asymptotically "
        f"{growth:.2f} % of v_theory.{measured} Errors of this support are therefore no measure of "
        "a method: compare methods on the same mesh, or on the support `exact`, whose limit is "
        "eq. (3)."
    )


def report(rows: Sequence[Row]) -> str:
    """The study as a page of Markdown."""
    sections = [
        "# Cantilever: mixed u-eps_v MPM beside B-bar, displacement only and FEM",
        header(),
        f"Beam and supports: `cases/cantilever/beam.py`. v_theory = {V_THEORY:.10f} m, eq. (3).",
        paper_support_in_words(rows).strip(),
        "![error of the tip deflection](deflection_error.png)",
        "![mean stress, support paper](mean_stress_paper.png)",
        "![mean stress, support exact](mean_stress_exact.png)",
    ]
    for support in SUPPORTS:
        mine = [row for row in rows if row.support == support]
        sections += [f"## Support `{support}`", markdown(mine)]
    return "\n\n".join(sections) + "\n"


def markdown(rows: Sequence[Row]) -> str:
    """Rows as a table of Markdown."""

    def text(value: object) -> str:
        return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)

    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + " --- |" * len(COLUMNS)]
    lines += ["| " + " | ".join(text(getattr(r, c)) for c in COLUMNS) + " |" for r in rows]
    return "\n".join(lines)


if __name__ == "__main__":
    tawami.run(main, "cantilever")
