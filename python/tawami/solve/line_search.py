"""Line search on the work of the unbalance along a change of the increments.

    g(t) = du . R_u - deps . R_q        at the increments + t (du, deps)

Fields without a role do not count: in general their equations have no energy. The unknowns of terms on
the border do: g has the work of their equations as well.

A full Newton step has g(0) < 0 and g(1) near 0. The sign of R_q makes g the slope of the energy in an
elastic body, whose energy is least in u and largest in eps_v. Near a limit load a search that asks for a
smaller residual costs many iterations, so this one acts only where a step overshoots: g(1) has the
other sign, is nearly as large as g(0), and the measure of convergence rose. It serves static steps of
small strain without friction of walls, and all steps with obstacles. Elsewhere it was not measured, or
finds equilibria far away. Contact has kinks where patches open and close. Between them full steps may go
to and fro without end, and the measure does not tell: after some iterations g(1) alone decides.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.timing import tally
from tawami.solve.equations import Equations
from tawami.solve.iterate import Forces
from tawami.solve.measures import Measured

Evaluated = tuple[Forces, Measured]

#: |g(1) / g(0)| from which a step overshoots, the same with contact, and |g(t) / g(0)| at which the
#: search ends.
OVERSHOT, KINKED, REDUCED = 0.8, 0.5, 0.5
#: Iterations of full steps with contact in motions. Steps of a collapse need 7 on average, and with a
#: search from the first on 8, with twice as many evaluations. Large static steps need it at once.
PATIENCE = 10
#: Largest number of evaluations, and shares of the full step: the shortest that is tried where particles
#: turn inside out, and that of the secant method. Patches that close are 200 times as stiff as a cell.
MOST, SHORTEST, LEAST = 12, 0.05, 0.005
#: Distance of the next step of the secant method from both ends of its interval, relative to its length.
MARGIN = 0.1


class LineSearch:
    """The work of the unbalance along one change of the increments.

    Args:
        dot: Scalar product of vectors of coefficients, the same on all ranks.
        change: Change of all increments by a full step.
        residual: Forces out of balance at its beginning.
        signs: Sign of each coefficient in g: 1, -1 or 0.
        equations: The equations; their terms know the change of their own unknowns.
        number: Number of iterations before.
    """

    def __init__(
        self,
        dot: Callable[[Array, Array], float],
        change: Array,
        residual: Array,
        signs: Array,
        equations: Equations,
        number: int,
    ) -> None:
        terms = equations.terms
        self._is_static = equations.inertia is None
        self._is_kinked = not equations.is_smooth and (self._is_static or number >= PATIENCE)
        self._dot, self._change, self._residual = dot, change, residual
        self._signs, self._terms = signs, terms

    @functools.cached_property
    def _weights(self) -> Array:
        return self._signs * self._change

    @functools.cached_property
    def _start(self) -> float:
        """The work at the beginning; most steps never ask for it."""
        of_terms = 0.0 if self._terms is None else self._terms.first_work
        return self._work(self._residual, of_terms)

    def _work(self, residual: Array, of_terms: float) -> float:
        return self._dot(self._weights, residual) + of_terms

    def _at_last_forces(self, residual: Array) -> float:
        return self._work(residual, 0.0 if self._terms is None else self._terms.work)

    def advance(
        self, evaluate: Callable[[float], Evaluated], rose: Callable[[Measured], bool]
    ) -> Evaluated:
        """Forces and measures after a share of the step that neither inverts a particle nor overshoots.

        Args:
            evaluate: Gives them after a share of the step; the last share is the one that is taken.
            rose: Whether a measure is larger than that at the beginning.

        Raises:
            InvertedError: The shortest step turns a particle inside out.
        """
        share = 1.0
        while True:
            try:
                forces, measured = evaluate(share)
                break
            except _rust.InvertedError:
                share *= 0.5
                if share < SHORTEST:
                    raise
        if share < 1 or not (self._is_kinked or (self._is_static and rose(measured))):
            return forces, measured
        end, limit = self._at_last_forces(forces.residual), KINKED if self._is_kinked else OVERSHOT
        if end * self._start >= 0 or abs(end) <= limit * abs(self._start):
            return forces, measured
        tally.line_searches += 1
        return self._shortened(evaluate, end)

    def _shortened(self, evaluate: Callable[[float], Evaluated], end: float) -> Evaluated:
        """Forces and measures at a length by the secant method of Illinois.

        Args:
            evaluate: As in :meth:`advance`.
            end: The work after the full step.
        """
        other, at_other = 0.0, self._start
        t, at_t = 1.0, end
        for _ in range(MOST):
            secant = (other * at_t - t * at_other) / (at_t - at_other)
            near, far, margin = min(t, other), max(t, other), MARGIN * abs(t - other)
            newer = max(min(max(secant, near + margin), far - margin), LEAST)
            forces, measured = evaluate(newer)
            at_newer = self._at_last_forces(forces.residual)
            if not np.isfinite(at_newer) or newer == t:
                break
            if at_newer * at_t < 0:
                other, at_other = t, at_t
            else:
                at_other *= 0.5
            t, at_t = newer, at_newer
            if abs(at_t) <= REDUCED * abs(self._start):
                break
        return forces, measured
