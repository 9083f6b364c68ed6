"""Everything that was tried, what happened, and where it ends.

python -m cases.extremes [--short] [--only SUBJECT ...] [--results results/extremes]
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from time import perf_counter

import matplotlib

import tawami
from cases.common import table
from cases.extremes import attempt, stability_map
from cases.extremes.attempt import Attempt
from tawami.base.files import atomic_file, result_folder
from tawami.fem.environment import header

#: Modules of this package, each with `attempts(short)`.
SUBJECTS = (
    "poisson",
    "alpha",
    "inf_sup",
    "particles",
    "slivers",
    "contrast",
    "scales",
    "directions",
    "overload",
    "not_finite",
    "density",
    "time_step",
    "stretch",
    "rotation",
    "friction_angle",
    "impact",
    "sudden_load",
    "corruption",
    "departure",
    "endurance",
)


def tried(name: str, short: bool) -> Iterator[Attempt]:
    """The attempts of a subject; one that breaks off keeps those before, and is wrong."""
    try:
        yield from import_module(f"cases.extremes.{name}").attempts(short)
    except Exception as error:
        says = f"the subject broke off: {type(error).__name__}: {error}"
        yield Attempt(name, "-", "WRONG", None, None, says)


def as_line(row: Attempt) -> str:
    """A row of the table as it is printed."""
    numbers = " ".join("-".rjust(9) if n is None else f"{n:9.2e}" for n in (row.error, row.bound))
    says = row.says if len(row.says) <= 100 else row.says[:97] + "..."
    return f"{row.subject:17s} {row.setting:58s} {row.outcome:8s} {numbers}  {says}".rstrip()


def ends(rows: Sequence[Attempt]) -> Iterator[str]:
    """Where each subject ends: its last survival and its first refusal, in the order of trying; then the
    same for each series of settings, 'series: value', that does not survive as a whole.
    """
    for subject in dict.fromkeys(row.subject for row in rows):
        mine = [row for row in rows if row.subject == subject]
        yield f"{subject}: {len(mine)} tried; {_where(mine)}"
        series = [row.setting.rpartition(":")[0] for row in mine]
        for name in dict.fromkeys(series):
            part = [row for row, of in zip(mine, series, strict=True) if of == name]
            if name and len(part) > 2 and {row.outcome for row in part} != {"survived"}:
                yield f"    {name}: {_where(part, name)}"


def _where(rows: Sequence[Attempt], series: str = "") -> str:
    parts = []
    for outcome, which, word in (
        ("survived", -1, "last"), ("warned", 0, "first"), ("refused", 0, "first"), ("WRONG", 0, "first"),
    ):  # fmt: skip
        found = [row for row in rows if row.outcome == outcome]
        if found:
            place = found[which].setting
            place = place.removeprefix(f"{series}: ") if series else place
            parts.append(f"{len(found)} {outcome}, {word}: {place}")
    return "; ".join(parts)


def study(subjects: Sequence[str], short: bool, file: Path) -> list[Attempt]:
    """Try all of it, print it as it goes, and keep it in a file after every subject."""
    rows: list[Attempt] = []
    for name in subjects:
        start = perf_counter()
        for row in tried(name, short):
            rows.append(row)
            print(as_line(row), flush=True)
        print(f"-- {name}: {perf_counter() - start:.1f} s\n", flush=True)
        with atomic_file(file) as part:
            part.write_text(table.as_csv(rows, attempt.COLUMNS))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Table, where it ends, map; exit code 1 if anything is wrong."""
    parser = argparse.ArgumentParser(prog="python -m cases.extremes", description=__doc__)
    parser.add_argument("--results", default="results/extremes", help="folder for the results")
    parser.add_argument("--short", action="store_true", help="what the tests run")
    parser.add_argument("--only", nargs="+", choices=(*SUBJECTS, "map"), help="some subjects")
    options = parser.parse_args(arguments)
    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    chosen = options.only or (*SUBJECTS, "map")
    rows = study([name for name in chosen if name != "map"], options.short, folder / "extremes.csv")
    print("\n".join(ends(rows)))
    wrong = [row for row in rows if row.wrong]
    for row in wrong:
        print(f"WRONG: {row.subject}, {row.setting}: {row.error}, {row.says}")
    print(f"Results: {folder / 'extremes.csv'}")
    if "map" in chosen:
        stability_map.draw(stability_map.points(options.short), folder / "map.png")
        print(f"Map: {folder / 'map.png'}")
    if wrong:
        sys.exit(1)


if __name__ == "__main__":
    tawami.run(main, "extremes")
