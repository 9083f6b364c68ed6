"""Gains in error at equal time of ways to integrate, stabilise, step and iterate.

python -m cases.costs.trade.fronts [NAME ...]
"""

from __future__ import annotations

from collections.abc import Sequence

from cases.common.program import Program
from cases.common.table import as_text
from cases.costs.trade.fronts import alpha, measure, time_step, tolerance, volumes

SUBJECTS = {
    "volumes": (volumes.rows, measure.COLUMNS),
    "alpha": (alpha.rows, measure.COLUMNS),
    "dt": (time_step.rows, measure.COLUMNS),
    "tolerance": (tolerance.rows, tolerance.COLUMNS),
}
PROGRAM = Program("cases.costs.trade.fronts", __doc__, files=False)
PROGRAM.option("subjects", nargs="*", help=f"among {', '.join(SUBJECTS)}; all by default")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    options = PROGRAM.start(arguments)
    for name in options.subjects or SUBJECTS:
        if name not in SUBJECTS:
            PROGRAM.error(f"{name}: expected one of {', '.join(SUBJECTS)}")
        rows, columns = SUBJECTS[name]
        print(f"# {name}\n{as_text(rows(), columns)}\n", flush=True)


if __name__ == "__main__":
    PROGRAM.run(main)
