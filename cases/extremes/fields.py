"""Extra fields: consolidation over many orders of permeability and time, and a heated wall.

Terzaghi's degree of consolidation depends on c_v t/H^2 only. In the first step after loading the body
is undrained, and the water carries the load: p = q.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import tawami
from cases.extremes.attempt import Attempt, Measured, attempted
from cases.verification import consolidation, heated_wall

SUBJECT = "extra fields"
T = 0.1  # c_v t/H^2


def drained(exponent: int, form: str = "u_epsv_pw") -> Measured:
    """Error of the degree of consolidation at T after 40 steps, for a permeability of 10^exponent m2."""
    scene = consolidation.column(8)
    scene.data("kappa", 10.0**exponent)
    c_v = consolidation.c_v(consolidation.NU_COLUMN) * 10.0**exponent / consolidation.KAPPA
    M = consolidation.lame(consolidation.NU_COLUMN)[1]
    for k in range(1, 41):
        solution = scene.solve(until=T * (k / 40) ** 2 / c_v)
    settlement = -float(solution.strain[:, 1].mean())
    U = settlement * M / consolidation.LOAD
    return abs(U / consolidation.degree(T) - 1), f"U = {U:.9f}"


def undrained(first: float, alpha_w: float | None = None) -> Measured:
    """Excess of the largest pressure over the load after one step of c_v t/H^2 = first."""
    options = {} if alpha_w is None else {"alpha_w": alpha_w}
    peak = consolidation.terzaghi(8, first, first, **options).peak
    return abs(peak - 1), f"largest pressure {peak:.3f} q"


def heated(first: float) -> Measured:
    """Excess of the temperatures over those of the faces after one step of D t/H^2 = first."""
    scene = heated_wall.build(8)
    theta = scene.solve(until=first * heated_wall.UNIT).field("theta") / heated_wall.THETA
    excess = float(max(theta.max() - 1, -theta.min(), 0.0))
    return excess, f"from {theta.min():.3f} to {theta.max():.3f} of the face"


def attempts(short: bool) -> Iterator[Attempt]:
    """Permeabilities, first steps of water and of heat."""
    # backward Euler errs by about half a step of the last size, 2.5 % of the time
    for exponent in (-12, -20) if short else (-2, -6, -12, -16, -20, -25, -30):
        run = partial(drained, exponent)
        yield attempted(SUBJECT, f"consolidation, permeability: 1e{exponent} m2", 0.03, run)
    # without its stabilisation the pressure of the first step exceeds the load by a quarter and more
    for first in (1e-3, 1e-5) if short else (1e-2, 1e-3, 1e-4, 1e-5, 1e-7, 1e-10):
        run = partial(undrained, first)
        yield attempted(SUBJECT, f"consolidation, first step: {first:g} of H^2/c_v", 0.1, run)
    for first in (1e-4,) if short else (1e-1, 1e-2, 1e-3, 1e-4, 1e-6):
        run = partial(heated, first)
        yield attempted(SUBJECT, f"heat, first step: {first:g} of H^2/D", 0.1, run)
    for value in ("nan", "inf"):
        yield attempted(SUBJECT, f"kappa = {value}", None, partial(wrong, float(value)))


def wrong(kappa: float) -> float:
    """A permeability that is not finite."""
    scene = consolidation.column(4)
    scene.data("kappa", kappa)
    solution: tawami.Solution = scene.solve(until=1.0)
    return float(solution.field("p_w").max())
