"""Terzaghi's column: degree of consolidation and pore pressure against the series."""

from __future__ import annotations

import tawami
from cases.verification import consolidation

T = 0.1  # c_v t/H^2


def run(n: int, growth: float, **options: float) -> dict[str, float]:
    """Degree of consolidation, and rms error of the pressure over the load, at T.

    Args:
        n: Cells over the height.
        growth: Largest step, as a share of the time so far; the first step and the longest one are
            proportional to it.
        options: Parameters of the form.
    """
    found = consolidation.terzaghi(n, 2.5e-3 * growth, T + 1e-9, growth, growth / 4, **options)
    return {"settlement": found.value[found.T.index(T)], "pressure": found.rms[T]}


CELLS, GROWTHS = (4, 8, 16, 32), (0.16, 0.08, 0.04)
GRIDS = [
    {"n": CELLS, "growth": GROWTHS, "alpha": (0.01,), "alpha_w": (1 / 6,)},
    {"n": CELLS, "growth": (0.08,), "alpha": (0.01,), "alpha_w": (0.0, 0.5)},
    {"n": CELLS, "growth": (0.08,), "alpha": (0.0, 0.1), "alpha_w": (1 / 6,)},
]

STUDY = tawami.Study(
    "consolidation",
    tawami.Series("MPM", run, GRIDS),
    reference={"settlement": consolidation.degree(T), "pressure": 0.0},
    colour="growth",
    marks={"default": {"n": ..., "growth": 0.08, "alpha": 0.01, "alpha_w": 1 / 6}},
)
