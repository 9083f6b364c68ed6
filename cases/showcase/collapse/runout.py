"""Run-out of piles from low to high, compared with the exponents of experiments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cases.showcase.collapse.pile import G, solve

#: Height over length of the piles, and cells along their length: each has about as many particles.
ASPECTS = {0.5: 28, 1.0: 20, 1.5: 16, 2.0: 14, 3.0: 12, 4.0: 10}


@dataclass(frozen=True)
class Runout:
    """Run-out of a pile.

    Attributes:
        aspect: Height over length.
        spread: Increase of the length, over the length.
    """

    aspect: float
    spread: float


def runout(aspect: float, cells: int, *, end: float = 4.0) -> Runout:
    """Run the collapse of a pile of length 0.1 m to the time `end` sqrt(height/g)."""
    length = 0.1
    h, height = length / cells, aspect * length
    time = end * np.sqrt(height / G)
    run = solve("u_epsv_finite", h=h, dt=1e-3, end=time, every=10**9, size=(length, height))
    return Runout(aspect, run.runout[-1] / length - 1)


def exponents(piles: Sequence[Runout]) -> tuple[float, float]:
    """Slopes of log spread over log aspect, for aspects up to 1.5 and from 1.5."""
    low, high = (
        np.array([(p.aspect, p.spread) for p in piles if where(p.aspect)])
        for where in (lambda a: a <= 1.5, lambda a: a >= 1.5)
    )
    slopes = [np.polyfit(*np.log(part).T, 1)[0] for part in (low, high)]
    return float(slopes[0]), float(slopes[1])


def runouts() -> Iterator[Runout]:
    """Run the piles from low to high."""
    for aspect, cells in ASPECTS.items():
        yield runout(aspect, cells)
