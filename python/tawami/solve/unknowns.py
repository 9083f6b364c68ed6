"""Unknowns beside the coefficients: the load factor of a path, and those of terms on the border."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tawami.base.arrays import Array
from tawami.solve.equations import Equations


def complete(
    equations: Equations, u: Array, change: Array, solve: Callable[[Array], Array]
) -> tuple[Array, float]:
    """Changes of all coefficients and of the load factor; those of the terms are added to them.

    Args:
        equations: The equations of the step.
        u: Coefficients of the displacement.
        change: Change of all coefficients with these unknowns held.
        solve: Gives K^-1 f for forces f on all coefficients.
    """
    path, terms, of_factor, own = equations.path, equations.terms, 0.0, np.zeros(0)
    elimination = None if terms is None else terms.elimination(solve)
    if elimination is not None:
        change, own = elimination.solve(change, elimination.residual)
    if path is not None:
        rate, own_rate = solve(equations.rate), 0 * own
        if elimination is not None:
            rate, own_rate = elimination.solve(rate, own_rate)
        of_factor = path.control.change(u, change[: len(u)], rate[: len(u)])
        change, own = change + of_factor * rate, own + of_factor * own_rate
    if elimination is not None:
        elimination.add(own)
    return change, of_factor
