"""Steps of a run: the size of the next step, and a record of every accepted step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami.base.errors import ConvergenceError
from tawami.solve.measures import History, measured


@dataclass
class Pace:
    """Position of a run, and size of its next step.

    Attributes:
        at: Time [s], or share of the load.
        size: Size of the next step.
        good: Number of accepted steps of this size.
    """

    at: float
    size: float
    good: int = 0


@dataclass(frozen=True)
class Step:
    """Record of an accepted step.

    Attributes:
        end: Time [s], or share of the load, at its end.
        size: Its size [s], or share of the load.
        history: (momentum, volume) measures of every residual; with fields without a role, the largest
            of theirs as well.
        krylov: FGMRES iterations of every linear solve; 0 if the tangent was factorised.
    """

    end: float
    size: float
    history: History
    krylov: tuple[int, ...]

    @property
    def iterations(self) -> int:
        """Number of Newton iterations."""
        return len(self.history) - 1


class Steps(list[Step]):
    """The accepted steps of a ramp or a path, and how it ended.

    Attributes:
        loads: Share of the new loads that is in equilibrium after each step.
        error: Error of the step that failed; None if none did.
    """

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[float] = []
        self.error: ConvergenceError | None = None

    @property
    def complete(self) -> bool:
        """Whether the end was reached."""
        return self.error is None

    @property
    def reached(self) -> float:
        """Share of the new loads that the scene is in equilibrium with."""
        return self.loads[-1] if self.loads else 0.0


def pack(steps: Sequence[Step]) -> dict[str, Any]:
    """Steps as a few arrays for a checkpoint; NaN for a volume that is not measured."""
    history = [[np.nan if m is None else m for m in of] for step in steps for of in step.history]
    return {
        "end": np.array([step.end for step in steps]),
        "size": np.array([step.size for step in steps]),
        "residuals": np.array([len(step.history) for step in steps], dtype=np.int64),
        "history": np.array(history or np.empty((0, 2))),
        "solves": np.array([len(step.krylov) for step in steps], dtype=np.int64),
        "krylov": np.array([k for step in steps for k in step.krylov], dtype=np.int64),
    }


def unpack(arrays: Mapping[str, Any]) -> list[Step]:
    """The reverse of :func:`pack`."""
    histories = np.split(arrays["history"], np.cumsum(arrays["residuals"])[:-1])
    krylov = np.split(arrays["krylov"], np.cumsum(arrays["solves"])[:-1])
    return [
        Step(
            float(end),
            float(size),
            [measured(*of_residual) for of_residual in history],
            tuple(map(int, solves)),
        )
        for end, size, history, solves in zip(
            arrays["end"], arrays["size"], histories, krylov, strict=True
        )
    ]


def check(pace: Mapping[str, Any], steps: Mapping[str, Any]) -> None:
    """Check stored values of a pace, and arrays of :func:`pack`.

    Raises:
        ValueError: A position or a size that is not such a number, or incomplete records of steps.
    """
    size, at, ends = pace["size"], pace["at"], steps["end"]
    if not 0 < size < math.inf or not 0 <= at < math.inf:
        raise ValueError(
            f"the run is at {at} with the step {size}, expected finite positive numbers"
        )
    if {len(ends)} != {len(steps[name]) for name in ("size", "residuals", "solves")}:
        raise ValueError("the records of the steps differ in number")
