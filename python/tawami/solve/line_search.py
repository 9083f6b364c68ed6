"""Line search on the work of the unbalance along a change of the increments.

    g(t) = du . R_u - deps . R_q        at the increments + t (du, deps)

Fields without a role do not count: in general their equations have no energy.

A full Newton step has g(0) < 0 and g(1) near 0. The sign of R_q makes g the slope of the energy in an
elastic body, whose energy is least in u and largest in eps_v. Near a limit load a search that asks for a
smaller residual costs many iterations, so this one acts only where a step overshoots: g(1) has the
other sign, is nearly as large as g(0), and the measure of convergence rose. It serves static steps of
small strain without friction. Elsewhere it was not measured, or finds equilibria far away.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from tawami.base.arrays import Array

#: |g(1) / g(0)| from which a step overshoots, and |g(t) / g(0)| at which the search ends.
OVERSHOT, REDUCED = 0.8, 0.5
#: Largest number of evaluations, and the shortest step as a share of the full one.
MOST, SHORTEST = 8, 0.05


class LineSearch:
    """The work of the unbalance along one change of the increments.

    Args:
        comm: Communicator; all ranks get the same bits.
        change: Change of all increments by a full step.
        residual: Forces out of balance at its beginning.
        signs: Sign of each coefficient in g: 1, -1 or 0.
    """

    def __init__(self, comm: Any, change: Array, residual: Array, signs: Array) -> None:
        self._comm, self._change, self._residual = comm, change, residual
        self._signs = signs

    @functools.cached_property
    def _weights(self) -> Array:
        return self._signs * self._change

    @functools.cached_property
    def _start(self) -> float:
        """The work at the beginning; most steps never ask for it."""
        return self._work(self._residual)

    def _work(self, residual: Array) -> float:
        return float(self._comm.bcast(float(self._weights @ residual)))

    def overshoots(self, residual: Array) -> bool:
        """Whether the full step, which led to this residual, went too far."""
        end = self._work(residual)
        return bool(end * self._start < 0 and abs(end) > OVERSHOT * abs(self._start))

    def length(self, residual_at: Callable[[float], Array], residual: Array) -> float:
        """Share of the step to take, by the secant method of Illinois; it was evaluated last.

        Args:
            residual_at: Residual after a share of the step.
            residual: Residual after the full step.
        """
        other, at_other = 0.0, self._start
        t, at_t = 1.0, self._work(residual)
        for _ in range(MOST):
            newer = max((other * at_t - t * at_other) / (at_t - at_other), SHORTEST)
            at_newer = self._work(residual_at(newer))
            if not np.isfinite(at_newer) or newer == t:
                return newer
            if at_newer * at_t < 0:
                other, at_other = t, at_t
            else:
                at_other *= 0.5
            t, at_t = newer, at_newer
            if abs(at_t) <= REDUCED * abs(self._start):
                break
        return t
