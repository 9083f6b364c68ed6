"""Dilatant soil up to nu = 0.4999, and steps so large that Newton's method needs its line search.

The force at which the block of `cases.verification.dilatancy` flows is one of strength and not of
elasticity: it does not depend on nu. One step and ten steps end at the same force.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial

import tawami
from cases.extremes.attempt import Attempt, Measured, attempted
from cases.verification.dilatancy import block
from tawami.base.timing import tally

SUBJECT = "dilatancy"


@cache
def force(psi: float, nu: float) -> float:
    """Force on the top at the end of ten steps, over its width and c."""
    return arrived(block.solve(psi, nu))


def arrived(run: block.Run) -> float:
    """Force of a run that reached its end.

    Raises:
        ConvergenceError: It did not.
    """
    if run.arrived < 1:
        raise tawami.ConvergenceError(f"ended at {run.arrived:.2g} of the displacement", [])
    return run.reaction


def stiff(psi: float, nu: float) -> Measured:
    """Difference of the force from that with nu = 0.3."""
    found = force(psi, nu)
    return abs(found / force(psi, 0.3) - 1), f"Q = {found:.4f} c B"


def few(psi: float, nu: float, steps: int) -> Measured:
    """Difference of the force after few steps from that after ten; and the line searches."""
    before = tally.line_searches
    found = arrived(block.solve(psi, nu, steps))
    searches = tally.line_searches - before
    return abs(found / force(psi, nu) - 1), f"{searches} iterations with a line search"


def attempts(short: bool) -> Iterator[Attempt]:
    """Angles of dilation with Poisson's ratios, and numbers of steps."""
    for psi in (10.0,) if short else block.PSI:
        for nu in (0.4999,) if short else (0.45, 0.49, 0.4999, 0.499999):
            # the elastic part of the shortening is a tenth of the whole
            run = partial(stiff, psi, nu)
            yield attempted(SUBJECT, f"psi = {psi:g} degrees: nu = {nu:g}", 0.1, run)
    for psi in (20.0,) if short else block.PSI:
        for steps in (2,) if short else (5, 2, 1):
            run = partial(few, psi, 0.49, steps)
            yield attempted(SUBJECT, f"psi = {psi:g} degrees, steps: {steps}", 0.05, run)
