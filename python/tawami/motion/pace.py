"""Steps of a run: how large the next one is, and what is kept of those that were accepted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami.solve.measures import History


@dataclass
class Pace:
    """Where a run is and how large its next step.

    Attributes:
        at: Time [s], or share of the load.
        size: Size of the next step.
        good: Steps of this size that were accepted.
    """

    at: float
    size: float
    good: int = 0


@dataclass(frozen=True)
class Step:
    """What is kept of an accepted step.

    Attributes:
        end: Time [s], or share of the load, at its end.
        size: Its size, likewise.
        history: (momentum, volume) measures of every residual.
        krylov: FGMRES iterations of every linear solve; 0 where the tangent was factorised.
    """

    end: float
    size: float
    history: History
    krylov: tuple[int, ...]

    @property
    def iterations(self) -> int:
        """Newton iterations."""
        return len(self.history) - 1


def packed(steps: Sequence[Step]) -> dict[str, Any]:
    """Steps as a few arrays; NaN for a volume that is not measured."""
    history = [(u, np.nan if q is None else q) for step in steps for u, q in step.history]
    return {
        "end": np.array([step.end for step in steps]),
        "size": np.array([step.size for step in steps]),
        "residuals": np.array([len(step.history) for step in steps], dtype=np.int64),
        "history": np.array(history).reshape(-1, 2),
        "solves": np.array([len(step.krylov) for step in steps], dtype=np.int64),
        "krylov": np.array([k for step in steps for k in step.krylov], dtype=np.int64),
    }


def unpacked(arrays: Mapping[str, Any]) -> list[Step]:
    """The reverse of :func:`packed`."""
    histories = np.split(arrays["history"], np.cumsum(arrays["residuals"])[:-1])
    krylov = np.split(arrays["krylov"], np.cumsum(arrays["solves"])[:-1])
    return [
        Step(
            float(end),
            float(size),
            [(float(u), None if np.isnan(q) else float(q)) for u, q in history],
            tuple(map(int, solves)),
        )
        for end, size, history, solves in zip(
            arrays["end"], arrays["size"], histories, krylov, strict=False
        )
    ]
