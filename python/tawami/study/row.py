"""Rows of a study: measured runs, and changes between two settings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from tawami.base.errors import InputError

#: Measured for every run: wall and processor time [s], peak memory [MB], and counts.
COSTS = ("wall_s", "cpu_s", "peak_MB", "newton_iterations", "steps", "unknowns")
#: Changes below this factor are noise; errors below this are round-off.
NOISE, ROUND_OFF = 1.1, 1e-12

Run = TypeVar("Run")


def pareto(
    runs: Iterable[Run], cost: Callable[[Run], float], error: Callable[[Run], float]
) -> list[Run]:
    """Runs that no other run beats in both cost and error, cheapest first."""
    front: list[Run] = []
    for run in sorted(runs, key=lambda r: (cost(r), error(r))):
        if not front or error(run) < error(front[-1]):
            front.append(run)
    return front


def error_of(value: Any, reference: Any) -> float:
    """|value - reference| / |reference|; |value| if the reference is 0."""
    found, expected = (np.asarray(v, dtype=float).ravel() for v in (value, reference))
    if found.shape != expected.shape:
        raise InputError(
            f"a quantity has {found.size} numbers and its reference {expected.size}: expected "
            "the same number"
        )
    size = float(np.linalg.norm(expected))
    return float(np.linalg.norm(found - expected)) / (size or 1.0)


def text_of(knobs: Mapping[str, Any]) -> str:
    """Knobs in a line."""
    return ", ".join(f"{name} {value_text(value)}" for name, value in knobs.items())


def value_text(value: Any) -> str:
    """Value of a knob as text."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def shortened(message: str, most: int = 160) -> str:
    """Beginning of a message."""
    return message if len(message) <= most else f"{message[:most].rstrip()} ..."


@dataclass(frozen=True)
class Row:
    """One run.

    Attributes:
        series: Label of its series.
        knobs: Its setting.
        values: Quantities that are single numbers.
        errors: Error of each quantity with a reference.
        costs: wall_s, cpu_s, peak_MB, newton_iterations, steps, unknowns.
        failure: Error message of a run that failed and has none of these; None if it succeeded.
    """

    series: str
    knobs: Mapping[str, Any]
    values: Mapping[str, float]
    errors: Mapping[str, float]
    costs: Mapping[str, float]
    failure: str | None = None

    def __str__(self) -> str:
        """The row in a line."""
        if self.failure is not None:
            return f"{self.series}: {text_of(self.knobs)}: {self.failure}"
        errors = ", ".join(f"{name} {value:.2g}" for name, value in self.errors.items())
        return (
            f"{self.series}: {text_of(self.knobs)}: errors {errors}; {self.costs['wall_s']:.3g} s"
        )


@dataclass(frozen=True)
class Change:
    """Effect of another value of one knob, all other knobs being equal.

    Attributes:
        knob: Name of the knob.
        before: One of its values.
        after: Another value.
        error: Geometric mean of the ratios of the errors, after over before.
        cost: Geometric mean of the ratios of the costs.
        pairs: Number of pairs of runs.
    """

    knob: str
    before: Any
    after: Any
    error: float
    cost: float
    pairs: int

    def towards_accuracy(self) -> Change:
        """The change, or its reverse if that costs more, or costs the same and has a smaller error."""
        same = 1 / NOISE <= self.cost <= NOISE
        if self.error <= 1 if same else self.cost >= 1:
            return self
        return Change(self.knob, self.after, self.before, 1 / self.error, 1 / self.cost, self.pairs)


def mean_ratio(pairs: Sequence[tuple[float, ...]]) -> float:
    """Geometric mean of the second number over the first."""
    logs = [np.log(max(b, ROUND_OFF)) - np.log(max(a, ROUND_OFF)) for a, b in pairs]
    return float(np.exp(np.mean(logs)))
