"""The study of the cantilever: table, figures, VTU files and a report.

It compares the mixed u-eps_v form (alpha = 0 to 0.5) with B-bar, displacement only and finite
elements, for three supports, by the tip deflection and the mean stress.

python -m cases.verification.cantilever
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter

import tawami
from cases.common.program import Program, numbers, progress
from cases.common.table import as_csv, as_text
from cases.verification.cantilever import figures, mpm
from cases.verification.cantilever.beam import COLUMNS, Row
from cases.verification.cantilever.report import paper_support, report
from cases.verification.cantilever.study import CELLS, runs
from tawami.results.single import write_grid, write_particles

#: Methods whose fields are drawn: form and alpha, by the title of the panel.
FIELDS = {
    "displacement only": ("u", None),
    "B-bar": ("u_bbar", None),
    r"$u$-$\varepsilon_v$, $\alpha$ = 0": ("u_epsv", 0.0),
    r"$u$-$\varepsilon_v$, $\alpha$ = 0.1": ("u_epsv", 0.1),
}

PROGRAM = Program("cases.verification.cantilever", __doc__)
PROGRAM.option(
    "--cells",
    type=numbers(int, lambda n: n >= 2 and n % 2 == 0, "even numbers such as 2,4,8"),
    default=CELLS,
    help=f"cells over the height, {','.join(map(str, CELLS))} by default",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and list its results."""
    options = PROGRAM.start(arguments)
    start = perf_counter()
    work = list(runs(options.cells))
    rows = [run() for run in progress(work, desc="cantilever", unit="run")]
    draw(rows, fields(PROGRAM.folder), PROGRAM.folder)
    PROGRAM.write("cantilever.csv", as_csv(rows, COLUMNS))
    PROGRAM.write("report.md", report(rows))
    print(as_text(rows, COLUMNS))
    print(f"\n{paper_support(rows)}")
    print(f"\n{len(work)} computations in {perf_counter() - start:.1f} s")
    PROGRAM.list_results()


def fields(folder: Path) -> dict[tuple[str, str], tawami.Solution]:
    """Solutions at 32 x 16 cells by support and title, also written as VTU files."""
    solutions = {}
    for support in ("paper", "exact"):
        for title, (method, alpha) in FIELDS.items():
            solution = solutions[support, title] = mpm.solve(method, support, 16, alpha)[1]
            name = method if alpha is None else f"{method}_{alpha:g}"
            write_particles(folder / f"particles_{name}_{support}_n16.vtu", solution)
            write_grid(folder / f"grid_{name}_{support}_n16.vtu", solution)
    return solutions


def draw(
    rows: Sequence[Row], solutions: Mapping[tuple[str, str], tawami.Solution], folder: Path
) -> None:
    """Draw the figures; solutions by support and title."""
    figures.deflection_error(rows, folder / "deflection_error.png")
    three = {title: solutions["paper", title] for title in list(FIELDS)[1:]}
    figures.mean_stress_paper(three, folder / "mean_stress_paper.png")
    exact = {title: solutions["exact", title] for title in FIELDS}
    figures.mean_stress_exact(exact, folder / "mean_stress_exact.png")


if __name__ == "__main__":
    PROGRAM.run(main)
