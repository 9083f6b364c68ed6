"""Speed and memory of a Newton step, stage by stage.

By default it measures the cantilever for sizes, particles per cell, threads, ranks and both assemblies,
then the import, the Python part of a step, the particles of a level set, and terms on the border.
Every setting runs in a separate process. One run gives a table, a CSV file and ratios.

With --against it compares this checkout with another one that has been set up, interleaved, and prints
the ratio new/old of the processor time of every stage, for steps of the cantilever and of collapsing
piles.
`--old-kernels Prescott` shows the speed of OpenBLAS 0.3.21 on a processor that it does not know.

python -m cases.costs.bench
python -m cases.costs.bench --cells 32,64 --against ../tawami-before
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cases.common.program import Program, numbers
from cases.common.table import as_csv, as_text
from cases.costs.bench import borders, compare, overheads, report
from cases.costs.bench.measure import empty_cells
from cases.costs.bench.setting import ROOT, in_own_process, settings

PROGRAM = Program("cases.costs.bench", __doc__)
WHOLE = numbers(int, lambda n: n > 0, "whole numbers separated by commas, such as 32,64")
PROGRAM.option("--cells", type=WHOLE, default="32,64,128", help="cells over the height")
PROGRAM.option("--per-axis", type=WHOLE, default="2,4", help="particles per cell and axis")
PROGRAM.option("--threads", type=WHOLE, default="1,2", help="threads; with --against the first")
PROGRAM.option("--ranks", type=WHOLE, default="1,2,4", help="numbers of ranks")
PROGRAM.option("--against", type=Path, metavar="CHECKOUT", help="compare with this checkout")
PROGRAM.option(
    "--particles", type=WHOLE, default="800,12800", help="with --against: sizes of piles"
)
PROGRAM.option("--old-kernels", default="", metavar="CORE", help="its OPENBLAS_CORETYPE")
PROGRAM.option("--rounds", type=int, default=5, help="with --against: number of restarts")
PROGRAM.option("--pairs", type=int, default=20, help="with --against: pairs of steps in a round")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the table and the ratios, write the CSV file."""
    options = PROGRAM.start(arguments)
    if options.against:
        against(options)
    else:
        survey(options.cells, options.per_axis, options.threads, options.ranks)
    PROGRAM.list_results()


def against(options: argparse.Namespace) -> None:
    """Compare this checkout with another one."""
    rounds, pairs, threads = options.rounds, options.pairs, options.threads[0]
    if min(rounds, pairs) < 1:
        PROGRAM.error(f"--rounds {rounds} --pairs {pairs}: expected 1 or more")
    other = options.against.resolve()
    print(f"new: {ROOT}\nold: {other}", flush=True)
    rows = list(
        compare.compare(
            other, options.cells, options.particles, rounds=rounds, pairs=pairs, threads=threads,
            kernels=options.old_kernels,
        )
    )  # fmt: skip
    print(
        f"{rounds} x {pairs} pairs of steps (fewer of large scenes), {threads} threads; "
        f"low, high: quartiles of the ratio; OpenBLAS of old: {options.old_kernels or 'as it is'}\n"
    )
    print(as_text(rows, compare.COLUMNS))
    PROGRAM.write("against.csv", as_csv(rows, compare.COLUMNS))
    checkouts = [(compare.python_of(path), path) for path in (ROOT, other)]
    print("\n".join(overheads.lines(overheads.in_turns(checkouts, rounds))))


def survey(
    cells: Sequence[int], per_axis: Sequence[int], threads: Sequence[int], ranks: Sequence[int]
) -> None:
    """Measure all settings of this checkout."""
    print(report.HEADER)
    rows: list[dict[str, Any]] = []
    for setting in settings(cells, per_axis, threads, ranks):
        rows.append(asdict(setting) | in_own_process(setting))
        print(report.line(rows[-1]), flush=True)
    file = io.StringIO()
    writer = csv.DictWriter(file, rows[0])
    writer.writeheader()
    writer.writerows(rows)
    PROGRAM.write("bench.csv", file.getvalue())
    report.print_ratios(rows)
    found = overheads.in_turns([(sys.executable, ROOT)], 3)
    print("\n".join(overheads.lines(found)))
    for assembly in ("dolfinx", "points"):
        empty_cells(max(max(cells) // 4, 8), assembly)
    borders.print_ratios([max(n // 4, 2) for n in cells])
    for particles in (800, 51200):
        borders.print_ratio_of_borders(particles)
    for h, end in ((0.01, 0.3), (0.005, 0.06)):
        borders.print_ratio_of_walls(h, end)


if __name__ == "__main__":
    PROGRAM.run(main)
