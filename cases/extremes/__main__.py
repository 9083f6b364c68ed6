"""Run all attempts, print their outcomes, and where each subject reaches its limit.

python -m cases.extremes
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from time import perf_counter

from cases.common.program import Program
from cases.common.table import as_csv
from cases.extremes import attempt, stability_map
from cases.extremes.attempt import Attempt

#: Modules of this package, each with `attempts(short)`.
SUBJECTS = (
    "poisson",
    "alpha",
    "inf_sup",
    "particles",
    "slivers",
    "border",
    "axisymmetry",
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
    "dilatancy",
    "obstacles",
    "fields",
    "impact",
    "sudden_load",
    "corruption",
    "departure",
    "endurance",
)

PROGRAM = Program("cases.extremes", __doc__)
PROGRAM.option("--short", action="store_true", help="only the attempts that the tests run")
PROGRAM.option("--only", nargs="+", metavar="SUBJECT", help=f"among {', '.join(SUBJECTS)}, map")


def tried(name: str, short: bool) -> Iterator[Attempt]:
    """Attempts of a subject; an exception in between becomes a last one, which is WRONG."""
    try:
        yield from import_module(f"cases.extremes.{name}").attempts(short)
    except Exception as error:
        says = f"the subject broke off: {type(error).__name__}: {error}"
        yield Attempt(name, "-", "WRONG", None, None, says)


def as_line(row: Attempt) -> str:
    """An attempt as a line of the printed table."""
    numbers = " ".join("-".rjust(9) if n is None else f"{n:9.2e}" for n in (row.error, row.bound))
    says = row.says if len(row.says) <= 100 else row.says[:97] + "..."
    return f"{row.subject:17s} {row.setting:58s} {row.outcome:8s} {numbers}  {says}".rstrip()


def ends(rows: Sequence[Attempt]) -> Iterator[str]:
    """Lines with the limit of each subject: the last setting that survives, the first that is rejected.

    A line follows for each series of settings 'series: value' that does not survive completely.
    """
    for subject in dict.fromkeys(row.subject for row in rows):
        mine = [row for row in rows if row.subject == subject]
        yield f"{subject}: {len(mine)} tried; {_limit(mine)}"
        series = [row.setting.rpartition(":")[0] for row in mine]
        for name in dict.fromkeys(series):
            part = [row for row, of in zip(mine, series, strict=True) if of == name]
            if name and len(part) > 2 and {row.outcome for row in part} != {"survived"}:
                yield f"    {name}: {_limit(part, name)}"


def _limit(rows: Sequence[Attempt], series: str = "") -> str:
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


@dataclass(frozen=True)
class Summary:
    """Outcomes of a subject: numbers of attempts, and the first that was warned and refused."""

    subject: str
    tried: int
    green: int
    yellow: int
    refused: int
    wrong: int
    first_yellow: str
    first_refused: str


SUMMARY = (
    "subject", "tried", "green", "yellow", "refused", "wrong", "first_yellow", "first_refused",
)  # fmt: skip


def summary(rows: Sequence[Attempt]) -> list[Summary]:
    """One line for each subject."""
    found = []
    for subject in dict.fromkeys(row.subject for row in rows):
        mine = [row for row in rows if row.subject == subject]
        kinds = {
            outcome: [row.setting for row in mine if row.outcome == outcome]
            for outcome in ("survived", "warned", "refused", "WRONG")
        }
        first = [next(iter(kinds[outcome]), "") for outcome in ("warned", "refused")]
        found.append(Summary(subject, len(mine), *map(len, kinds.values()), *first))
    return found


def study(subjects: Sequence[str], short: bool) -> list[Attempt]:
    """Run all attempts. Print each at once, and write the file after every subject."""
    rows: list[Attempt] = []
    for name in subjects:
        start = perf_counter()
        for row in tried(name, short):
            rows.append(row)
            print(as_line(row), flush=True)
        print(f"-- {name}: {perf_counter() - start:.1f} s\n", flush=True)
        PROGRAM.write("extremes.csv", as_csv(rows, attempt.COLUMNS))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table and the limits, draw the map; exit with code 1 if an attempt is WRONG."""
    options = PROGRAM.start(arguments)
    known = (*SUBJECTS, "map")
    chosen = options.only or known
    for name in chosen:
        if name not in known:
            PROGRAM.error(f"--only {name}: expected one of {', '.join(known)}")
    rows = study([name for name in chosen if name != "map"], options.short)
    limits = "\n".join(ends(rows))
    print(limits)
    PROGRAM.write("limits.txt", limits + "\n")
    PROGRAM.write("summary.csv", as_csv(summary(rows), SUMMARY))
    wrong = [row for row in rows if row.wrong]
    for row in wrong:
        print(f"WRONG: {row.subject}, {row.setting}: {row.error}, {row.says}")
    if "map" in chosen:
        stability_map.draw(stability_map.points(options.short), PROGRAM.folder / "map.png")
    PROGRAM.list_results()
    if wrong:
        sys.exit(1)


if __name__ == "__main__":
    PROGRAM.run(main)
