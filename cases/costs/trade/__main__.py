"""The studies, one after the other; what has been run is not run again.

python -m cases.costs.trade [NAME ...] [--sample N] [--results results/trade]
python -m cases.costs.trade --words          what the shipped results say, without running anything
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import tawami
from cases.costs.trade import cantilever, collapse, cook, self_weight, spinning_disc
from tawami.base.files import atomic_file
from tawami.fem.environment import header
from tawami.study import Table

CASES = (cantilever, cook, collapse, self_weight, spinning_disc)
STUDIES = {case.STUDY.name: case.STUDY for case in CASES}
#: Results that come with the repository.
SHIPPED = Path(__file__).parent


def in_words(table: Table) -> str:
    """A paragraph a quantity, and what failed."""
    paragraphs = [table.in_words(quantity) for quantity in table.quantities]
    failed = [f"Failed: {str(row)[:300]}" for row in table.failed]
    return "\n\n".join([f"# {table.name}", *paragraphs, *failed]) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run studies and say what they say."""
    parser = argparse.ArgumentParser(prog="python -m cases.costs.trade", description=__doc__)
    parser.add_argument("studies", nargs="*", help=f"among {', '.join(STUDIES)}; all by default")
    parser.add_argument("--results", default="results/trade", help="folder for the results")
    parser.add_argument("--sample", type=int, help="run so many settings, drawn at random")
    parser.add_argument("--words", action="store_true", help="of the shipped results, run nothing")
    options = parser.parse_args(arguments)
    names = options.studies or list(STUDIES)
    for name in names:
        if name not in STUDIES:
            parser.error(f"study {name}: expected one of {', '.join(STUDIES)}")
    print(header(), flush=True)
    for name in names:
        if options.words:
            table = Table.read(SHIPPED / f"{name}.csv")
        else:
            study = STUDIES[name]
            study.path = Path(options.results) / name
            table = study.run(sample=options.sample)
            with atomic_file(study.path / f"{name}.md") as part:
                part.write_text(in_words(table))
            print(f"\nResults: {study.path}/{name}.csv, {name}.md, {name}.png")
        print(f"\n{in_words(table)}")


if __name__ == "__main__":
    tawami.run(main, "trade")
