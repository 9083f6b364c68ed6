"""Errors and processor times of several ways, and the gain of one over another at equal time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Row:
    """A run.

    Attributes:
        scene, way: Names.
        size: Size of the run, as the number of cells.
        error: Relative error.
        seconds: Shortest processor time of the repetitions [s].
        gain: Error of the first way at equal time over that of this one, the geometric mean over the
            times that both take; None until both are known.
    """

    scene: str
    way: str
    size: float
    error: float
    seconds: float
    gain: float | None = None


COLUMNS = ("scene", "way", "size", "error", "seconds", "gain")


def compared(
    scene: str,
    ways: Mapping[str, Mapping[str, Any]],
    sizes: Sequence[float],
    run: Callable[..., float],
    repeats: int = 3,
) -> list[Row]:
    """Run each way with each size, in turns, and compare the fronts with that of the first way.

    Args:
        scene: Name of the scene.
        ways: Name of each way, and its arguments of `run`.
        sizes: Sizes from coarse to fine.
        run: Function of a size and these arguments that returns an error.
        repeats: Number of repetitions, of which the shortest counts.
    """
    found: dict[str, list[Row]] = {way: [] for way in ways}
    for size in sizes:
        seconds, errors = dict.fromkeys(ways, math.inf), dict.fromkeys(ways, math.nan)
        for _ in range(repeats):
            for way, options in ways.items():
                begin = process_time()
                errors[way] = abs(run(size, **options))
                seconds[way] = min(seconds[way], process_time() - begin)
        for way, rows in found.items():
            rows.append(Row(scene, way, size, errors[way], seconds[way]))
    first = next(iter(found.values()))
    return [
        Row(
            r.scene, r.way, r.size, r.error, r.seconds, gain(first, rows) if r is rows[-1] else None
        )
        for rows in found.values()
        for r in rows
    ]


def gain(old: Sequence[Row], new: Sequence[Row]) -> float:
    """Error of `old` over that of `new` at equal time: the geometric mean over the times of both.

    Logarithms of the errors are interpolated between the runs. Where no time is common to both, NaN.
    """
    low = max(min(r.seconds for r in rows) for rows in (old, new))
    high = min(max(r.seconds for r in rows) for rows in (old, new))
    if not low < high:
        return math.nan
    at = np.linspace(math.log(low), math.log(high), 50)

    def errors(rows: Sequence[Row]) -> np.ndarray:
        by_time = sorted(rows, key=lambda r: r.seconds)
        seconds, error = (np.log([getattr(r, k) for r in by_time]) for k in ("seconds", "error"))
        return np.interp(at, seconds, error)

    return float(np.exp((errors(old) - errors(new)).mean()))
