"""Limit of a quantity from runs with several knobs: no reference is needed.

The knob with the largest effect is refined first: lines of runs along it are extrapolated, see
`tawami.study.limit`, with each value of the other knobs. Errors that vanish with this knob, such as that
of the particles or of a stabilisation that scales with h, do not count twice. The limits are then a
sequence in each other knob. Knobs with equally accurate values, as shifts of the grid, give several
values for each size, whose spread measures the noise.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from tawami.study.knobs import Knob
from tawami.study.limit import Limit, limit_of, sizes_of
from tawami.study.row import shortened, text_of, value_text

T = TypeVar("T")
#: Value of a quantity for the values of all knobs, in their order.
Points = Mapping[tuple[Any, ...], float]


@dataclass(frozen=True)
class Estimate:
    """Limit of a quantity.

    Attributes:
        value: The limit, or the finest value without one.
        uncertainty: The limit is expected within value +- uncertainty; infinite without a limit.
        orders: Observed order of knobs that converge regularly.
        remarks: Sentences about knobs that do not converge to one value.
    """

    value: float
    uncertainty: float
    orders: Mapping[str, float] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    @property
    def exists(self) -> bool:
        """Whether there are signs of a limit."""
        return math.isfinite(self.uncertainty)

    @property
    def scale(self) -> float:
        """Number that errors are relative to."""
        return abs(self.value) or 1.0


def centre_of(knobs: Sequence[Knob]) -> tuple[Any, ...]:
    """Defaults of all knobs."""
    return tuple(knob.default for knob in knobs)


def replaced(setting: tuple[Any, ...], k: int, value: Any) -> tuple[Any, ...]:
    """A setting with another value of knob k."""
    return (*setting[:k], value, *setting[k + 1 :])


def line(
    points: Mapping[tuple[Any, ...], T], knobs: Sequence[Knob], k: int, base: tuple[Any, ...]
) -> dict[Any, T]:
    """Values along a knob through a setting, from coarse to fine."""
    places = {value: replaced(base, k, value) for value in knobs[k].values}
    return {value: points[place] for value, place in places.items() if place in points}


def repeated(knobs: Sequence[Knob], base: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
    """A setting with all values of the knobs that repeat."""
    return itertools.product(
        *(k.values if k.repeats else (v,) for k, v in zip(knobs, base, strict=True))
    )


def leading(points: Points, knobs: Sequence[Knob]) -> int:
    """Number of the refining knob with the largest effect at the defaults."""

    def effect(k: int) -> float:
        found = line(points, knobs, k, centre_of(knobs)).values()
        return max(found) - min(found) if found else 0.0

    return max((k for k, knob in enumerate(knobs) if knob.refines), key=effect)


def estimate(
    name: str,
    knobs: Sequence[Knob],
    points: Points,
    failures: Mapping[tuple[Any, ...], str] | None = None,
) -> Estimate:
    """Estimate the limit of a quantity.

    Args:
        name: Of the quantity.
        knobs: Knobs, of which at least one refines.
        points: Values of the runs that succeeded.
        failures: Error messages of runs that failed.
    """
    first, centre = leading(points, knobs), centre_of(knobs)
    main_line = line(points, knobs, first, centre)
    finer = _failed(knobs[first], main_line, line(failures or {}, knobs, first, centre))
    if finer is not None:
        value = next(reversed([*points.values(), *main_line.values()]))
        return Estimate(value, math.inf, remarks=(_fails(name, knobs[first], finer),))
    if len(main_line) < 2:
        return Estimate(
            next(iter(points.values())), math.inf, remarks=(_too_few(name, knobs[first]),)
        )
    main = _limit(points, knobs, first, centre)
    if not main.exists:
        remark = _no_limit(name, knobs[first], main_line)
        return Estimate(main.value, math.inf, remarks=(remark,))
    orders = {} if main.order is None else {knobs[first].name: main.order}
    value, uncertainty, remarks, moves = main.value, main.uncertainty, list[str](), list[float]()
    for k, knob in enumerate(knobs):
        if k == first or not knob.refines:
            continue
        limits = _limits(points, knobs, first, k)
        at_default = line(points, knobs, k, centre)
        rest = _limit(points, knobs, k, centre) if at_default else main
        found = _other(name, knob, limits, main, at_default, rest)
        moves.append(abs(found.value))
        value, uncertainty = value + found.value, uncertainty + found.uncertainty
        orders |= found.orders
        remarks += found.remarks
    for k, knob in enumerate(knobs):
        if not (knob.refines or knob.repeats):
            coarse = {o.name: o.default for o in knobs if o.refines and o is not knobs[first]}
            allowed = uncertainty + sum(moves)
            limits = _limits(points, knobs, first, k)
            remarks += _alternatives(name, knob, limits, main, allowed, coarse)
    uncertainty += sum(sorted(moves)[:-1])  # two knobs together: at most the smaller effect of both
    return Estimate(value, uncertainty, orders, tuple(remarks))


def _limit(points: Points, knobs: Sequence[Knob], k: int, base: tuple[Any, ...]) -> Limit:
    """Limit along knob k; all repetitions of a size count."""
    lines = [line(points, knobs, k, setting) for setting in repeated(knobs, base)]
    values = [v for v in knobs[k].values if any(v in found for found in lines)]
    sizes = sizes_of(values)
    pairs = [(s, f[v]) for s, v in zip(sizes, values, strict=True) for f in lines if v in f]
    return limit_of(*map(list, zip(*pairs, strict=True)))


def _failed(
    knob: Knob, succeeded: Mapping[Any, float], failed: Mapping[Any, Any]
) -> tuple[Any, str] | None:
    """The coarsest value that failed, with its message, if all finer ones failed too."""
    last = max((knob.values.index(v) for v in succeeded), default=-1)
    finer = [v for v in failed if knob.values.index(v) > last]
    return (finer[0], failed[finer[0]]) if finer else None


def _limits(points: Points, knobs: Sequence[Knob], first: int, k: int) -> dict[Any, Limit]:
    """Limits along the first knob for each value of knob k, where there are enough runs."""
    centre, found = centre_of(knobs), dict[Any, Limit]()
    for value in knobs[k].values:
        along = line(points, knobs, first, replaced(centre, k, value))
        if len(along) > 2 or value == centre[k]:
            limit = _limit(points, knobs, first, replaced(centre, k, value))
            if limit.exists:
                found[value] = limit
    return found


def _other(
    name: str,
    knob: Knob,
    limits: Mapping[Any, Limit],
    main: Limit,
    at_default: Mapping[Any, float],
    rest: Limit,
) -> Estimate:
    """Effect of another knob on the limit: shift, uncertainty, order, remarks."""
    values = {value: limit.value for value, limit in limits.items()}
    if len(values) < 2:  # only its effect at the defaults is known
        if not rest.exists:
            return Estimate(0.0, math.inf, remarks=(_no_limit(name, knob, at_default),))
        here = at_default.get(knob.default, rest.value)
        return Estimate(0.0, abs(rest.value - here) + rest.uncertainty)
    finest = list(limits.values())[-3:]
    spread = max(limit.value for limit in finest) - min(limit.value for limit in finest)
    known = max(limit.uncertainty for limit in finest)
    if spread <= known:  # nothing but the uncertainty of the limits themselves
        return Estimate(0.0, 0.0)
    limit = limit_of(sizes_of(list(values)), list(values.values()))
    if not limit.exists and spread <= 3 * known:
        return Estimate(0.0, spread)
    if not limit.exists:
        return Estimate(0.0, math.inf, remarks=(_no_limit(name, knob, values),))
    orders = {} if limit.order is None else {knob.name: limit.order}
    return Estimate(limit.value - main.value, limit.uncertainty, orders)


def _no_limit(name: str, knob: Knob, found: Mapping[Any, float]) -> str:
    sizes = list(found.items())
    steps = ", ".join(f"{v:.5g} at {value_text(k)}" for k, v in sizes)
    return (
        f"'{name}' does not converge with '{knob.name}' ({steps}): the values of '{knob.name}' are too "
        f"coarse, the problem has no limit, or "
        f"'{knob.name}' changes the problem instead of its accuracy."
    )


def _fails(name: str, knob: Knob, finer: tuple[Any, str]) -> str:
    value, message = finer
    return (
        f"'{name}' does not converge with '{knob.name}': runs with {value_text(value)} and finer fail "
        f"({shortened(message)})."
    )


def _alternatives(
    name: str,
    knob: Knob,
    limits: Mapping[Any, Limit],
    main: Limit,
    allowed: float,
    coarse: Mapping[str, Any],
) -> list[str]:
    """Sentences about values of a knob that lead to another limit than its default.

    Args:
        name: Of the quantity.
        knob: Its values are not sizes.
        limits: Limit along the first knob for each of them.
        main: That of the default.
        allowed: Error of the default by all knobs.
        coarse: Knobs that are not refined in these limits.
    """
    others = f", or {text_of(coarse)} is too coarse to tell" if coarse else ""
    return [
        f"'{name}' converges to {limit.value:.5g} with {knob.name} {value_text(value)}, and to "
        f"{main.value:.5g} with {knob.name} {value_text(knob.default)}: "
        f"'{knob.name}' changes the problem{others}."
        for value, limit in limits.items()
        if abs(limit.value - main.value) > 2 * (limit.uncertainty + allowed)
    ]


def _too_few(name: str, knob: Knob) -> str:
    return (
        f"'{name}' has no error estimate: fewer than two runs with values of '{knob.name}' succeeded; "
        "use a larger budget, or values that do not fail."
    )
