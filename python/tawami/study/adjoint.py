"""Limits from the error of one solve, by dual-weighted residuals (`tawami.estimate`)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from tawami.study.estimate import Estimate, Points
from tawami.study.knobs import Knob
from tawami.study.limit import SLOWEST

#: Estimated over true error, at least: an estimate may be off by 1 / LEAST - 1 of its size. Parts of
#: opposite signs may each be off, so that their sizes count.
LEAST = 0.7
#: Part of the value that is round-off.
ROUND_OFF = 1e-9


def combined(
    name: str,
    knobs: Sequence[Knob],
    refined: Estimate,
    points: Points,
    estimated: Mapping[tuple[Any, ...], Mapping[str, Any]],
) -> Estimate:
    """The limit by refinement and by the estimated error of the run where that is least uncertain.

    The less uncertain of the two counts if they agree. Otherwise the bar contains both.

    Args:
        name: Of the quantity.
        knobs: Of the settings; those that neither refine nor repeat may change the problem.
        refined: The limit by refinement of the knobs.
        points: Value of each setting.
        estimated: Parts and order of the error of settings, limit minus value.
    """
    limits = [
        _limit(points[setting], found["parts"].values())
        for setting, found in estimated.items()
        if not found["order"] < SLOWEST  # NaN: irregular
        and all(
            k.refines or k.repeats or v == k.default for k, v in zip(knobs, setting, strict=True)
        )
    ]
    if not (limits and refined.exists):
        return refined
    value, uncertainty = min(limits, key=lambda limit: limit[1])
    if abs(value - refined.value) <= uncertainty + refined.uncertainty:
        if refined.uncertainty <= uncertainty:
            return refined
        return replace(refined, value=value, uncertainty=uncertainty)
    ends = [(v - u, v + u) for v, u in ((value, uncertainty), (refined.value, refined.uncertainty))]
    low, high = min(e[0] for e in ends), max(e[1] for e in ends)
    remark = (
        f"'{name}' converges to {refined.value:.6g} ± {refined.uncertainty:.1g}, and its error in one "
        f"solve leads to {value:.6g} ± {uncertainty:.1g}: the bar contains both."
    )
    return replace(
        refined, value=(low + high) / 2, uncertainty=(high - low) / 2,
        remarks=(*refined.remarks, remark),
    )  # fmt: skip


def _limit(value: float, parts: Collection[float]) -> tuple[float, float]:
    """The limit of a value with the parts of its error, and its uncertainty."""
    return value + sum(parts), (1 / LEAST - 1) * sum(map(abs, parts)) + ROUND_OFF * abs(value)
