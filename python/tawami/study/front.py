"""Result of a trade: errors with their uncertainties, the front, a setting for a tolerance, words."""

from __future__ import annotations

import csv
import io
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.study.estimate import Estimate, centre_of, leading, line
from tawami.study.knobs import Knob
from tawami.study.row import shortened, text_of, value_text

#: Rows of the printed table.
MOST = 8


@dataclass(frozen=True)
class Run:
    """One run of a trade.

    Attributes:
        knobs: Its setting.
        values: Quantities.
        errors: Relative error of each quantity, estimated; NaN without a limit.
        uncertainties: The relative error is expected within errors +- uncertainties.
        wall_s: Wall time without compilation [s].
        peak_MB: Peak memory [MB].
        failure: Error message of a run that failed and has no values; None if it succeeded.
    """

    knobs: Mapping[str, Any]
    values: Mapping[str, float]
    errors: Mapping[str, float]
    uncertainties: Mapping[str, float]
    wall_s: float = math.nan
    peak_MB: float = math.nan
    failure: str | None = None

    @property
    def error(self) -> float:
        """Largest relative error of a quantity."""
        return max(self.errors.values())

    @property
    def bound(self) -> float:
        """Relative error of every quantity that is not expected to be exceeded."""
        return max(e + self.uncertainties[q] for q, e in self.errors.items())


@dataclass(frozen=True)
class Trade:
    """Runs of a script with several settings, and the errors that they are estimated to have.

    Attributes:
        name: Of the script or function.
        knobs: Its knobs.
        estimates: Limit of each quantity with its uncertainty.
        runs: Runs, also those that failed.
        tolerance: Relative error that the recommended setting stays below.
    """

    name: str
    knobs: Sequence[Knob]
    estimates: Mapping[str, Estimate]
    runs: Sequence[Run]
    tolerance: float

    @property
    def succeeded(self) -> list[Run]:
        """Runs that succeeded, fastest first."""
        return sorted((r for r in self.runs if r.failure is None), key=lambda r: r.wall_s)

    @property
    def converges(self) -> bool:
        """Whether every quantity has a limit."""
        return all(estimate.exists for estimate in self.estimates.values())

    @property
    def default(self) -> Run | None:
        """Run with the defaults of the script; None if it failed or was not run."""
        defaults = {knob.name: knob.default for knob in self.knobs}
        return next((run for run in self.succeeded if run.knobs == defaults), None)

    def front(self) -> list[Run]:
        """Runs that no faster run is as accurate as, fastest first; empty without a limit."""
        front: list[Run] = []
        for run in self.succeeded if self.converges else []:
            if not front or run.bound < front[-1].bound:
                front.append(run)
        return front

    def recommended(self, tolerance: float | None = None) -> Run:
        """The fastest run with all errors within a tolerance, uncertainties included.

        Args:
            tolerance: Relative; that of the trade by default.

        Raises:
            InputError: No limit, or no run is within the tolerance.
        """
        tolerance = self.tolerance if tolerance is None else tolerance
        checks.number("tolerance", tolerance, low=checks.LEAST)
        front = self.front()
        if not front:
            raise InputError(f"'{self.name}' has no setting within a tolerance: {self._remarks()}")
        within = [run for run in front if run.bound <= tolerance]
        if not within:
            best = front[-1]
            raise InputError(
                f"no run of '{self.name}' is within {_percent(tolerance)}: the best, "
                f"{text_of(best.knobs)}, is within {_percent(best.bound)}; "
                "use a larger tolerance or a larger budget"
            )
        return within[0]

    def _found(self) -> Run | None:
        """The recommended run; None without one."""
        return next((run for run in self.front() if run.bound <= self.tolerance), None)

    # -- words -----------------------------------------------------------------------

    def sentence(self) -> str:
        """Words for the cost of a tolerance and of half the error, and for knobs that gain nothing."""
        parts = [self._remarks()] if self._remarks() else []
        if self.converges:
            parts.append(self._costs())
            parts += [f"{text} gains nothing here." for text in self._useless()]
        else:
            limits = [q for q, estimate in self.estimates.items() if estimate.exists]
            parts += [f"'{q}' alone has a limit: see --quantity {shlex.quote(q)}." for q in limits]
        failed = [run for run in self.runs if run.failure is not None]
        if failed:
            first = f"{text_of(failed[0].knobs)}: {shortened(str(failed[0].failure))}"
            parts.append(f"{len(failed)} of {len(self.runs)} runs failed, the first with {first}.")
        return " ".join(parts)

    def _remarks(self) -> str:
        return " ".join(remark for e in self.estimates.values() for remark in e.remarks)

    def _costs(self) -> str:
        run, front = self._found(), self.front()
        if run is None:
            best = front[-1]
            text = (
                f"No run is within {_percent(self.tolerance)}; the best, {text_of(best.knobs)}, is "
                f"within {_percent(best.bound)} and takes {best.wall_s:.2g} s"
            )
        else:
            text = f"{_percent(self.tolerance)} costs {run.wall_s:.2g} s ({text_of(run.knobs)})"
        rest = front[front.index(run) :] if run else front
        gain = math.log(rest[0].bound / rest[-1].bound) if rest[-1].bound > 0 else 0.0
        if gain > math.log(1.5):
            factor = (rest[-1].wall_s / rest[0].wall_s) ** (math.log(2) / gain)
            text += f"; halving the error costs {factor:.2g} times as much"
        return f"{text}."

    def _useless(self) -> list[str]:
        """Values of knobs beyond which no quantity changes by a tenth of the tolerance."""
        useless = []
        names = [knob.name for knob in self.knobs]
        runs = {tuple(run.knobs[n] for n in names): run for run in self.succeeded}
        points = {q: {s: run.values[q] for s, run in runs.items()} for q in self.estimates}
        for k, knob in enumerate(self.knobs):
            lines = {q: line(points[q], self.knobs, k, centre_of(self.knobs)) for q in points}
            leads = any(leading(points[q], self.knobs) == k for q in points)
            values = list(next(iter(lines.values())))
            if not knob.refines or leads or len(values) < 2:
                continue
            for n, value in enumerate(values[:-1]):
                if all(self._same(q, list(found.values())[n:]) for q, found in lines.items()):
                    useless.append(f"{knob.name} finer than {value_text(value)}")
                    break
        return useless

    def _same(self, quantity: str, values: Sequence[float]) -> bool:
        return max(values) - min(values) <= self.tolerance / 10 * self.estimates[quantity].scale

    def chosen(self) -> list[tuple[str, Run]]:
        """At most eight runs, fastest first, with marks: the front, the default, the recommended."""
        marks = {id(self.default): "default", id(self._found()): "recommended"}
        if self.default is not None and self.default is self._found():
            marks = {id(self.default): "default, recommended"}
        runs = self.front() or self.succeeded
        special = [run for run in self.succeeded if id(run) in marks]
        others = [run for run in runs if run not in special]
        most = MOST - len(special)
        if len(others) > most:
            places = np.linspace(0, len(others) - 1, most).round().astype(int)
            others = [others[k] for k in places]
        rows = sorted([*special, *others], key=lambda run: run.wall_s)
        return [(marks.get(id(run), ""), run) for run in rows]

    def __str__(self) -> str:
        """Table of at most eight rows, and a sentence."""
        head = ["setting", *self.estimates, "time", "memory", ""]
        rows = [head]
        for mark, run in self.chosen():
            values = [self._with_error(q, run) for q in self.estimates]
            rows.append(
                [text_of(run.knobs), *values, f"{run.wall_s:.2g} s", f"{run.peak_MB:.0f} MB", mark]
            )
        if self.converges:
            limits = [f"{e.value:.6g} ± {e.uncertainty:.1g}" for e in self.estimates.values()]
            rows.append(["limit", *limits, "", "", ""])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        return "\n".join([*lines, "", self.sentence()])

    def _with_error(self, quantity: str, run: Run) -> str:
        value, estimate = run.values[quantity], self.estimates[quantity]
        if not estimate.exists:
            return f"{value:.5g}, no limit"
        bound = run.errors[quantity] + run.uncertainties[quantity]
        return f"{value:.5g} ± {_percent(bound)}"

    def as_csv(self) -> str:
        """Comma-separated: knobs, values, errors, uncertainties, time, memory, failure."""
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        names, quantities = [knob.name for knob in self.knobs], list(self.estimates)
        columns = [f"{q}{end}" for q in quantities for end in ("", ", error", ", uncertainty")]
        writer.writerow([*names, *columns, "wall_s", "peak_MB", "failure"])
        for run in self.runs:
            numbers = [
                part.get(q, "")
                for q in quantities
                for part in (run.values, run.errors, run.uncertainties)
            ]
            costs = ["", ""] if run.failure else [run.wall_s, run.peak_MB]
            writer.writerow([*(run.knobs[n] for n in names), *numbers, *costs, run.failure or ""])
        return file.getvalue()


def _percent(part: float) -> str:
    return f"{100 * part:.2g} %"
