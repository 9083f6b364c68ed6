"""Table of a study: error over cost, Pareto fronts, effects of knobs."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tawami.base import checks, csv_file
from tawami.base.errors import InputError
from tawami.base.files import readable_file, reason
from tawami.study.row import COSTS, Change, Row, mean_ratio, pareto


@dataclass(frozen=True)
class Table:
    """Rows of a study.

    Attributes:
        name: Of the study.
        rows: One for each run.
    """

    name: str
    rows: Sequence[Row]

    @property
    def series(self) -> list[str]:
        """Labels of the series, the study's own first."""
        return list(dict.fromkeys(row.series for row in self.rows))

    @property
    def quantities(self) -> list[str]:
        """Names of quantities with errors."""
        return list(dict.fromkeys(name for row in self.rows for name in row.errors))

    @property
    def failed(self) -> list[Row]:
        """Runs that failed."""
        return [row for row in self.rows if row.failure is not None]

    def of(self, series: str | None = None) -> list[Row]:
        """Successful runs of a series; of all series by default."""
        return [r for r in self.rows if r.failure is None and series in (None, r.series)]

    def matching(self, setting: Mapping[str, Any]) -> list[Row]:
        """Successful runs of the study's own series with a setting; `...` as a value stands for any."""
        return [
            row
            for row in self.of(self.series[0])
            if row.knobs.keys() == setting.keys()
            and all(setting[knob] in (..., value) for knob, value in row.knobs.items())
        ]

    # -- error over cost -----------------------------------------------------------

    def front(self, quantity: str, *, cost: str = "wall_s", series: str | None = None) -> list[Row]:
        """Pareto front: runs that no other run of the series beats in both, cheapest first."""
        self.check(quantity, cost)
        return pareto(self.of(series), lambda r: r.costs[cost], lambda r: r.errors[quantity])

    def knees(self, quantity: str, *, cost: str = "wall_s", series: str | None = None) -> list[Row]:
        """Corners of the lower convex hull of the front, in logarithms of cost and error: each is the
        best run for some rate of exchange between the two.
        """
        hull: list[Row] = []
        for row in self.front(quantity, cost=cost, series=series):
            point = _point(row, quantity, cost)
            while len(hull) > 1:
                a, b = (_point(r, quantity, cost) for r in hull[-2:])
                if (b[0] - a[0]) * (point[1] - a[1]) > (b[1] - a[1]) * (point[0] - a[0]):
                    break
                hull.pop()
            hull.append(row)
        return hull

    def knee(self, quantity: str, *, cost: str = "wall_s", series: str | None = None) -> Row:
        """The run of the front farthest below the line between its ends, in logarithms."""
        knees = self.knees(quantity, cost=cost, series=series)
        if not knees:
            raise InputError(f"study '{self.name}': no run of {series or 'any series'} succeeded")
        first, last = (_point(row, quantity, cost) for row in (knees[0], knees[-1]))
        along = last - first

        def depth(row: Row) -> float:
            to = _point(row, quantity, cost) - first
            return float(along[1] * to[0] - along[0] * to[1])

        return max(knees, key=depth)

    def changes(self, quantity: str, *, cost: str = "wall_s") -> list[Change]:
        """Effect of each step of each knob on error and cost of the study's own series."""
        self.check(quantity, cost)
        changes = []
        for knob, groups in self._groups().items():
            values = dict.fromkeys(v for group in groups for v in group)
            ordered = sorted(values) if all(isinstance(v, int | float) for v in values) else values
            for before, after in pairwise(ordered):
                pairs = [(g[before], g[after]) for g in groups if {before, after} <= set(g)]
                if pairs:
                    error = mean_ratio([tuple(r.errors[quantity] for r in pair) for pair in pairs])
                    price = mean_ratio([tuple(r.costs[cost] for r in pair) for pair in pairs])
                    changes.append(Change(knob, before, after, error, price, len(pairs)))
        return changes

    def _groups(self) -> dict[str, list[dict[Any, Row]]]:
        """Of each knob, groups of runs that are equal in all other knobs, by its value."""
        rows = self.of(self.series[0])
        found: dict[str, list[dict[Any, Row]]] = {}
        for knob in dict.fromkeys(name for row in rows for name in row.knobs):
            groups: dict[tuple[Any, ...], dict[Any, Row]] = {}
            for row in rows:
                if knob in row.knobs:
                    others = tuple(sorted((k, str(v)) for k, v in row.knobs.items() if k != knob))
                    groups.setdefault(others, {})[row.knobs[knob]] = row
            found[knob] = list(groups.values())
        return found

    def check(self, quantity: str, cost: str) -> None:
        """Check names.

        Raises:
            InputError: An unknown quantity or cost.
        """
        if not checks.one_of(quantity, self.quantities):
            raise InputError(
                f"quantity {checks.shown(quantity)} of study '{self.name}': expected one of "
                f"{', '.join(map(repr, self.quantities))}"
            )
        checks.choice("cost", cost, COSTS)

    # -- as a file -------------------------------------------------------------------

    def as_csv(self) -> str:
        """Comma-separated: series, knobs, values, errors, costs, failure."""
        groups: list[tuple[str, list[str]]] = [
            (kind, list(dict.fromkeys(name for row in self.rows for name in getattr(row, kind))))
            for kind in ("knobs", "values", "errors", "costs")
        ]
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        columns = [f"{kind}: {name}" for kind, names in groups for name in names]
        writer.writerow(["series", *columns, "failure"])
        for row in self.rows:
            cells = [getattr(row, kind).get(name, "") for kind, names in groups for name in names]
            writer.writerow([row.series, *cells, row.failure or ""])
        return file.getvalue()

    @staticmethod
    def read(path: str | Path) -> Table:
        """Read the table of a CSV file.

        Raises:
            InputError: No such file, or not the file of a study.
        """
        path = readable_file("study", path, "the CSV file that Study.run() writes")
        try:
            content = csv_file.read(path)
        except (OSError, ValueError) as error:
            raise InputError(
                f"study '{path}' cannot be read ({reason(error)}): expected the CSV file that "
                "Study.run() writes"
            ) from None
        head = content.header
        lines = [dict(zip(head, row, strict=True)) for row in content.rows]
        complete = len(set(head)) == len(head) and {"series", "failure"} <= set(head)
        rows = [_from_line(line) for line in lines] if complete else []
        if not rows or not all(_is_complete(row) for row in rows):
            raise InputError(f"study '{path}': expected the CSV file that Study.run() writes")
        return Table(path.stem, rows)


def _from_line(line: Mapping[str, str]) -> Row:
    def part(kind: str) -> dict[str, Any]:
        return {
            name.removeprefix(f"{kind}: "): _value(cell)
            for name, cell in line.items()
            if name.startswith(f"{kind}: ") and cell != ""
        }

    knobs, values, errors, costs = map(part, ("knobs", "values", "errors", "costs"))
    return Row(line["series"], knobs, values, errors, costs, line["failure"] or None)


def _is_complete(row: Row) -> bool:
    """Whether a run failed, or has all costs and only numbers."""
    numbers = (*row.values.values(), *row.errors.values(), *row.costs.values())
    measured = set(COSTS) <= set(row.costs) and all(isinstance(n, int | float) for n in numbers)
    return row.failure is not None or measured


def _value(cell: str) -> Any:
    for kind in (int, float):
        try:
            return kind(cell)
        except ValueError:
            continue
    return {"True": True, "False": False}.get(cell, cell)


def _point(row: Row, quantity: str, cost: str) -> Any:
    """Logarithms of cost and error."""
    return np.log([max(row.costs[cost], 1e-300), max(row.errors[quantity], 1e-300)])
