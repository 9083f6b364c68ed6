"""Unknowns beside the coefficients: the load factor of a path, and those of terms on the border."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tawami.base.arrays import Array
from tawami.solve.equations import Equations


def complete(
    equations: Equations, u: Array, change: Array, solve: Callable[[Array], Array]
) -> tuple[Array, float]:
    """Changes of all coefficients and of the load factor; those of the terms are added to these.

    Args:
        equations: The equations of the step.
        u: Coefficients of the displacement.
        change: Change of all coefficients and multipliers with the other unknowns held.
        solve: Gives K^-1 f, coefficients and multipliers, for forces f on all coefficients.
    """
    path, terms, of_factor, own = equations.path, equations.terms, 0.0, np.zeros(0)
    elimination = None if terms is None else terms.elimination(solve)

    def eliminated(given: Array, residual: Array) -> tuple[Array, Array]:
        assert elimination is not None
        return elimination.solve(given, residual)

    if elimination is not None:
        change, own = eliminated(change, elimination.residual)
    if path is not None:
        rate, own_rate = solve(equations.rate), 0 * own
        if elimination is not None:
            rate, own_rate = eliminated(rate, own_rate)
        of_factor = path.control.change(u, change[: len(u)], rate[: len(u)])
        change, own = change + of_factor * rate, own + of_factor * own_rate
    if elimination is not None:
        elimination.add(own)
    size = len(equations.external)
    if terms is not None and len(change) > size:
        terms.add(change[size:])
    return change[:size], of_factor
