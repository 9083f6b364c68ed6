"""What a study found: rows, errors over cost, the front, what buys accuracy and what only costs time."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base import checks
from tawami.base.errors import InputError

if TYPE_CHECKING:
    from tawami.study.study import Study

#: Measured of every run: wall and processor time [s], peak memory [MB], and counts.
COSTS = ("wall_s", "cpu_s", "peak_MB", "newton_iterations", "steps", "unknowns")
#: Changes below this factor are not told from noise; errors below this are round-off.
NOISE, ROUND_OFF = 1.1, 1e-12


def error_of(value: Any, reference: Any) -> float:
    """|value - reference| / |reference|; |value| where the reference is 0."""
    found, expected = (np.asarray(v, dtype=float).ravel() for v in (value, reference))
    if found.shape != expected.shape:
        raise InputError(
            f"a quantity has {found.size} numbers and its reference {expected.size}: expected as many"
        )
    size = float(np.linalg.norm(expected))
    return float(np.linalg.norm(found - expected)) / (size or 1.0)


def text_of(knobs: Mapping[str, Any]) -> str:
    """Knobs in a line."""
    return ", ".join(f"{name} {_short(value)}" for name, value in knobs.items())


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Row:
    """One run.

    Attributes:
        series: Label of its series.
        knobs: Its setting.
        values: Quantities that are single numbers.
        errors: Error of each quantity with a reference.
        costs: wall_s, cpu_s, peak_MB, newton_iterations, steps, unknowns.
        failure: Why it has none of these; None if it has.
    """

    series: str
    knobs: Mapping[str, Any]
    values: Mapping[str, float]
    errors: Mapping[str, float]
    costs: Mapping[str, float]
    failure: str | None = None

    def __str__(self) -> str:
        """In a line."""
        if self.failure is not None:
            return f"{self.series}: {text_of(self.knobs)}: {self.failure}"
        errors = ", ".join(f"{name} {value:.2g}" for name, value in self.errors.items())
        return (
            f"{self.series}: {text_of(self.knobs)}: errors {errors}; {self.costs['wall_s']:.3g} s"
        )


@dataclass(frozen=True)
class Change:
    """What another value of one knob does, all others the same.

    Attributes:
        knob: Name of the knob.
        before: A value of it.
        after: Another value.
        error: Geometric mean of the ratios of the error, after over before.
        cost: The same of the cost.
        pairs: Number of pairs of runs.
    """

    knob: str
    before: Any
    after: Any
    error: float
    cost: float
    pairs: int

    def __str__(self) -> str:
        """In a line."""
        pairs = "1 pair" if self.pairs == 1 else f"{self.pairs} pairs"
        return f"{self.step} (error x {self.error:.2g}, time x {self.cost:.2g}; {pairs})"

    def towards_accuracy(self) -> Change:
        """The change, or its reverse where that costs more, or costs the same and errs less."""
        same = 1 / NOISE <= self.cost <= NOISE
        if self.error <= 1 if same else self.cost >= 1:
            return self
        return Change(self.knob, self.after, self.before, 1 / self.error, 1 / self.cost, self.pairs)

    @property
    def step(self) -> str:
        """Knob and values."""
        return f"{self.knob} {_short(self.before)} to {_short(self.after)}"


@dataclass(frozen=True)
class Table:
    """Rows of a study.

    Attributes:
        name: Of the study.
        rows: One a run.
    """

    name: str
    rows: Sequence[Row]

    @property
    def series(self) -> list[str]:
        """Labels, the study's own first."""
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
        """Runs of a series that did not fail; of all by default."""
        return [r for r in self.rows if r.failure is None and series in (None, r.series)]

    # -- error over cost -----------------------------------------------------------

    def front(self, quantity: str, *, cost: str = "wall_s", series: str | None = None) -> list[Row]:
        """Runs that no other one of the series beats in both, the cheapest first: Pareto's front."""
        self._check(quantity, cost)
        front: list[Row] = []
        for row in sorted(self.of(series), key=lambda r: (r.costs[cost], r.errors[quantity])):
            if not front or row.errors[quantity] < front[-1].errors[quantity]:
                front.append(row)
        return front

    def knees(self, quantity: str, *, cost: str = "wall_s", series: str | None = None) -> list[Row]:
        """Runs of the front that are best for some exchange of accuracy for cost: corners of the
        front's lower hull, both logarithmic.
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
        """The run of the front farthest below the line between the front's ends, both logarithmic."""
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
        """What each knob's next value does to error and cost of the study's own series."""
        self._check(quantity, cost)
        changes = []
        for knob, groups in self._groups().items():
            values = dict.fromkeys(v for group in groups for v in group)
            ordered = sorted(values) if all(isinstance(v, int | float) for v in values) else values
            for before, after in pairwise(ordered):
                pairs = [(g[before], g[after]) for g in groups if {before, after} <= set(g)]
                if pairs:
                    error = _mean_ratio([tuple(r.errors[quantity] for r in pair) for pair in pairs])
                    price = _mean_ratio([tuple(r.costs[cost] for r in pair) for pair in pairs])
                    changes.append(Change(knob, before, after, error, price, len(pairs)))
        return changes

    def dominated(self, quantity: str, *, cost: str = "wall_s") -> list[tuple[str, Any]]:
        """Values of knobs that another value of the same knob beats wherever both were tried, all else
        the same: as good in one, beyond noise better in the other.
        """
        self._check(quantity, cost)

        def beaten(row: Row, others: Iterable[Row]) -> bool:
            def ratios(other: Row) -> tuple[float, float]:
                error = _mean_ratio([(row.errors[quantity], other.errors[quantity])])
                return error, _mean_ratio([(row.costs[cost], other.costs[cost])])

            return any(max(r) <= NOISE and min(r) * NOISE < 1 for r in map(ratios, others))

        found = []
        for knob, groups in self._groups().items():
            compared = [group for group in groups if len(group) > 1]
            for value in dict.fromkeys(v for group in compared for v in group):
                rows = [(group[value], group.values()) for group in compared if value in group]
                if all(beaten(row, others) for row, others in rows):
                    found.append((knob, value))
        return found

    def _groups(self) -> dict[str, list[dict[Any, Row]]]:
        """Of each knob, its values' runs, together those that are alike in all else."""
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

    def in_words(self, quantity: str, *, cost: str = "wall_s") -> str:
        """A paragraph: what buys accuracy, what only costs time, what is dominated, and the knee."""
        turned = [change.towards_accuracy() for change in self.changes(quantity, cost=cost)]
        buys = [c for c in turned if c.error * NOISE < 1]
        wastes = [c for c in turned if c.cost > NOISE and c.error * NOISE >= 1]
        nothing = [c for c in turned if c not in buys and c not in wastes]
        dominated = self.dominated(quantity, cost=cost)
        parts = [
            ("Accuracy is bought by", [str(c) for c in buys]),
            ("Time only is spent by", [str(c) for c in wastes]),
            ("Neither by", [c.step for c in nothing]),
            ("Dominated:", [f"{k} {_short(v)}" for k, v in dominated]),
        ]
        sentences = [f"{head} {'; '.join(items)}." for head, items in parts if items]
        sentences.append(f"The knee: {self.knee(quantity, cost=cost, series=self.series[0])}.")
        if self.failed:
            sentences.append(f"{len(self.failed)} of {len(self.rows)} runs failed.")
        return f"{self.name}, {quantity}: " + " ".join(sentences)

    def _check(self, quantity: str, cost: str) -> None:
        if not checks.one_of(quantity, self.quantities):
            raise InputError(
                f"quantity {checks.shown(quantity)} of study '{self.name}': expected one of "
                f"{', '.join(map(repr, self.quantities))}"
            )
        checks.choice("cost", cost, COSTS)

    def draw(self, path: str | Path, **options: Any) -> None:
        """The picture; see `tawami.study.figure.picture` for what there is to choose."""
        from tawami.study.figure import picture  # matplotlib, which scenes do not need

        picture(self, path, **options)

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
        """The table of a CSV file.

        Raises:
            InputError: No such file, or not that of a study.
        """
        path = checks.path("study", path)
        try:
            with path.open(newline="") as file:
                lines = list(csv.DictReader(file))
        except OSError as error:
            raise InputError(f"study '{path}': {error.strerror}: expected a CSV file") from None
        except (ValueError, csv.Error):
            lines = []
        whole = all(None not in line and None not in line.values() for line in lines)
        named = bool(lines) and {"series", "failure"} <= set(lines[0])
        rows = [_from_line(line) for line in lines] if whole and named else []
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
    """Whether it failed, or has all costs, and numbers."""
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
    """Where a run stands in the picture."""
    return np.log([max(row.costs[cost], 1e-300), max(row.errors[quantity], 1e-300)])


def _mean_ratio(pairs: Sequence[tuple[float, ...]]) -> float:
    """Geometric mean of the second over the first."""
    logs = [np.log(max(b, ROUND_OFF)) - np.log(max(a, ROUND_OFF)) for a, b in pairs]
    return float(np.exp(np.mean(logs)))


def recommend(
    study: Study | Table | str | Path,
    tolerance: float | Mapping[str, float],
    *,
    cost: str = "wall_s",
) -> Row:
    """The cheapest measured setting within a tolerance.

    One quantity alone may be right because two faults cancel: ask for several.

    Args:
        study: A study that has been run, its table, or the CSV file of one.
        tolerance: Largest error of every quantity, or of each by its name.
        cost: 'wall_s', 'cpu_s' or 'peak_MB'.

    Returns:
        The run; its knobs are the setting.

    Raises:
        InputError: No setting is within the tolerance; the message says which comes nearest.
    """
    if isinstance(study, str | Path):
        table = Table.read(study)
    else:
        from tawami.study.study import Study

        expected = "a study, its table, or the path of its CSV file"
        checks.instance("recommend: study", study, Study | Table, expected)
        table = study.table() if isinstance(study, Study) else study
    if not isinstance(tolerance, Mapping):
        tolerance = dict.fromkeys(table.quantities, tolerance)
    limits = {q: checks.number(f"tolerance of {q}", t, low=0.0) for q, t in tolerance.items()}
    if not limits:
        raise InputError("tolerance = {}: expected a number, or one for each of some quantities")
    for quantity in limits:
        table._check(quantity, cost)
    rows = table.of(table.series[0])

    def excess(row: Row) -> float:
        return max(row.errors[q] / max(limit, 1e-300) for q, limit in limits.items())

    within = [row for row in rows if excess(row) <= 1]
    if within:
        return min(within, key=lambda row: row.costs[cost])
    asked = ", ".join(f"{quantity} {limit:g}" for quantity, limit in limits.items())
    nearest = f": the nearest is {min(rows, key=excess)}" if rows else ": every run failed"
    raise InputError(
        f"no measured setting of study '{table.name}' is within {asked}{nearest}. Allow more, or add "
        "finer settings to the study"
    )
