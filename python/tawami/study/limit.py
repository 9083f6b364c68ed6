"""Limit of a sequence under refinement, with its uncertainty; no reference is needed.

Regular sequences are extrapolated with their observed order p, q(s) = q* + C s^p (Richardson, 1911;
Roache, Annu. Rev. Fluid Mech. 29, 1997, for the observed order on unequal refinements). Others have the
finest value as the limit and the spread of the finest three as the uncertainty. The uncertainty of a
regular sequence is the largest of the last change of the extrapolated value, the effect of rounding the
order to a whole number, and a part of the extrapolation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scipy.optimize import brentq

#: Observed orders of a regular sequence; below the first one there is no sign of a limit.
SLOWEST, FASTEST = 0.3, 8.0
#: Largest difference of two observed orders of a regular sequence.
APART = 1.5
#: Changes below this part of the value are round-off.
ROUND_OFF = 1e-11
#: Part of the value that the error of the finest run may have.
FARTHEST = 0.5
#: Part of the extrapolation that is always uncertain, and with three values only, of which no second
#: order confirms the first.
LEAST, SINGLE = 0.3, 0.5


@dataclass(frozen=True)
class Limit:
    """Limit of a sequence.

    Attributes:
        value: The estimate.
        uncertainty: The limit is expected within value +- uncertainty; infinite without a limit.
        order: Observed order; None if the sequence is not regular.
    """

    value: float
    uncertainty: float
    order: float | None = None

    @property
    def exists(self) -> bool:
        """Whether the sequence shows signs of a limit."""
        return math.isfinite(self.uncertainty)


def sizes_of(values: Sequence[Any]) -> list[float]:
    """Positive sizes that decrease with refinement: those of a knob, or the inverse of a growing number.

    Args:
        values: Of the knob, from coarse to fine; distinct positive numbers in order.
    """
    if values[-1] > values[0]:
        return [1 / v for v in values]
    return [float(v) for v in values]


def limit_of(sizes: Sequence[float], values: Sequence[float]) -> Limit:
    """Estimate the limit of values for a size that goes to 0.

    Args:
        sizes: Decreasing positive sizes.
        values: Value for each of them.
    """
    steps = [b - a for a, b in itertools.pairwise(values)]
    size = max(map(abs, values))
    if len(values) == 1:
        return Limit(values[0], 0.0)
    if all(abs(step) <= ROUND_OFF * size for step in steps[-2:]):
        return Limit(values[-1], 2 * max(map(abs, steps[-2:])))
    if len(values) == 2:
        return Limit(values[-1], abs(steps[-1]))
    orders = [
        _order(sizes[k : k + 3], steps[k : k + 2], ROUND_OFF * size) for k in range(len(steps) - 1)
    ]
    limit = _limit(sizes, values, steps, orders)
    far = abs(limit.value - values[-1]) + limit.uncertainty > FARTHEST * abs(limit.value)
    return Limit(values[-1], math.inf) if far else limit


def _limit(
    sizes: Sequence[float],
    values: Sequence[float],
    steps: Sequence[float],
    orders: Sequence[float | None],
) -> Limit:
    """Limit of at least three values that differ."""
    order, last = orders[-1], abs(steps[-1])
    if order is not None and order < SLOWEST:
        earlier = [p for p in orders[-3:-1] if p is not None]
        if all(p < 2 * SLOWEST for p in earlier):
            return Limit(values[-1], math.inf)
    if order is None and len(steps) > 2 and _grows(steps[-3:]):
        return Limit(values[-1], math.inf)
    before = orders[-2] if len(orders) > 1 else order
    if order is None or before is None or not _regular(order, before):
        shrinks = all(abs(b) <= abs(a) / 2 for a, b in itertools.pairwise(steps[-3:]))
        return Limit(values[-1], last if shrinks else max(values[-3:]) - min(values[-3:]))
    beyond = _remainder(sizes[-2:], order, steps[-1])
    if len(orders) == 1:
        return Limit(values[-1] + beyond, max(SINGLE * abs(beyond), last / 3), order)
    previous = values[-2] + _remainder(sizes[-3:-1], before, steps[-2])
    moved = abs(values[-1] + beyond - previous)
    formal = _remainder(sizes[-2:], max(round(order), 1), steps[-1])
    return Limit(values[-1] + beyond, max(moved, abs(formal - beyond), LEAST * abs(beyond)), order)


def _regular(order: float, before: float) -> bool:
    """Whether two observed orders are possible and nearly the same."""
    possible = min(order, before) >= SLOWEST and max(order, before) <= FASTEST
    return possible and max(order, before) <= min(order, before) + APART


def _remainder(sizes: Sequence[float], order: float, step: float) -> float:
    """Rest of the way to the limit after the last step, Richardson's extrapolation."""
    return float(step / ((sizes[0] / sizes[1]) ** order - 1))


def _order(sizes: Sequence[float], steps: Sequence[float], noise: float) -> float | None:
    """Observed order of three values: None if they go back and forth, 0 if they do not settle."""
    first, last = steps
    if abs(last) <= noise:
        return 2 * FASTEST
    if first * last <= 0:
        return None
    a, b = math.log(sizes[0] / sizes[1]), math.log(sizes[1] / sizes[2])

    def excess(p: float) -> float:
        """Logarithm of (s0^p - s1^p) / (s1^p - s2^p) over the ratio that was measured."""
        model = p * b + math.log(math.expm1(p * a) / math.expm1(p * b))
        return model - math.log(first / last)

    if excess(1e-9) >= 0:
        return 0.0
    fastest = 2 * FASTEST
    return fastest if excess(fastest) <= 0 else float(brentq(excess, 1e-9, fastest))


def _grows(steps: Sequence[float]) -> bool:
    """Whether each step is clearly larger than the one before."""
    return all(abs(b) > 1.2 * abs(a) for a, b in itertools.pairwise(steps))
