"""Run the studies one after the other. Settings that have been run are not run again.

python -m cases.costs.trade [NAME ...]
python -m cases.costs.trade --words          the results that come with the repository, without running
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cases.common.program import Program
from cases.costs.trade import (
    cantilever,
    collapse,
    consolidation,
    cook,
    penetration,
    ring,
    self_weight,
    spinning_disc,
)
from tawami.base.files import atomic_file
from tawami.study import Table, verdict
from tawami.study.peers import comparison, read_peers

CASES = (
    cantilever, cook, ring, consolidation, penetration, collapse, self_weight, spinning_disc,
)  # fmt: skip
STUDIES = {case.STUDY.name: case.STUDY for case in CASES}
#: Folder of the results that come with the repository, and of results of other codes.
SHIPPED = Path(__file__).parent
PEERS = SHIPPED / "peers"

PROGRAM = Program("cases.costs.trade", __doc__, files=False)
PROGRAM.option("studies", nargs="*", help=f"among {', '.join(STUDIES)}; all by default")
PROGRAM.option("--results", default="results/trade", help="folder of the results")
PROGRAM.option("--sample", type=int, help="run only this many settings, drawn at random")
PROGRAM.option("--words", action="store_true", help="print the shipped results, run nothing")


def in_words(table: Table) -> str:
    """Changes that reduce the error or only cost time, and the default compared with other codes."""
    text = f"# {table.name}\n\n{verdict(table)}\n"
    peers = peers_of(table.name)
    if peers is None:
        return text
    default = STUDIES[table.name].marks["default"]
    return f"{text}\n{comparison(table, read_peers(peers), default)}\n"


def peers_of(name: str) -> Path | None:
    """Results of other codes for a study; None without such results."""
    path = PEERS / f"{name}.csv"
    return path if path.exists() else None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run studies and print their results."""
    options = PROGRAM.start(arguments)
    names = options.studies or list(STUDIES)
    for name in names:
        if name not in STUDIES:
            PROGRAM.error(f"study {name}: expected one of {', '.join(STUDIES)}")
    for name in names:
        if options.words:
            table = Table.read(SHIPPED / f"{name}.csv")
        else:
            study = STUDIES[name]
            study.path = Path(options.results) / name
            study.peers = peers_of(name)
            table = study.run(sample=options.sample)
            with atomic_file(study.path / f"{name}.md") as part:
                part.write_text(in_words(table))
            print(f"\nResults in {study.path}: {name}.csv, {name}.md, {name}.png")
        print(f"\n{in_words(table)}")


if __name__ == "__main__":
    PROGRAM.run(main)
