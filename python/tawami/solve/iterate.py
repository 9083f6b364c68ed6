"""The iterates of a step, and the forces that they give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tawami.base.arrays import Array
from tawami.field.reduction import Reduction
from tawami.solve.inertia import Inertia

#: Gives the friction on the body from the forces of supports and walls, functions x dim each.
Friction = Callable[[Array], Array]


@dataclass(frozen=True)
class Forces:
    """Forces on all coefficients [N per metre depth], at one iterate.

    Attributes:
        internal: Of the stress, and the residual of the volume equation.
        external: Of the loads.
        border: Of terms on the border that depend on the solution; None without any.
        inertia: Of a dynamic step.
        acceleration: Of each displacement coefficient at the end of a dynamic step [m/s2].
        reactions: Forces of supports and walls that would balance the others.
        residual: Forces out of balance, without the impulse of the supports and without friction.
    """

    internal: Array
    external: Array
    border: Array | None
    inertia: Array | None
    acceleration: Array | None
    reactions: Array
    residual: Array


class Iterate:
    """Increments of all fields in one Newton iteration.

    Args:
        reduction: Unknowns of the step.
        guess: Increments to start from; zero by default.
        inertia: Inertia of a dynamic step.
        factor: Load factor to start from; NaN where it is no unknown.

    Attributes:
        coefficients: The increments.
        factor: The load factor.
    """

    def __init__(
        self,
        reduction: Reduction,
        guess: Array | None,
        inertia: Inertia | None,
        factor: float = np.nan,
    ) -> None:
        self.factor = factor
        unknowns = np.zeros(reduction.num_own) if guess is None else guess[reduction.coefficients]
        self._inertia, self._layout = inertia, reduction.layout
        self.coefficients: Array = reduction.expanded(unknowns) + reduction.offset
        #: u - dt v, which is updated by itself to keep its digits.
        self._deviation = None if inertia is None else inertia.deviation(self.coefficients)

    @property
    def u(self) -> Array:
        """Coefficients of the displacement."""
        return self.coefficients[: self._layout.num_displacement]

    def add(self, change: Array, of_factor: float = 0.0) -> None:
        """Go to the next iterate."""
        self._before, self._change = (self.coefficients, self._deviation), change
        self.coefficients = self.coefficients + change
        self.factor += of_factor
        if self._deviation is not None:
            self._deviation = self._deviation + change[: len(self._deviation)]

    def shorten(self, share: float) -> None:
        """Take a share of the last change, in a step at a given load."""
        coefficients, deviation = self._before
        self.coefficients = coefficients + share * self._change
        if deviation is not None:
            self._deviation = deviation + share * self._change[: len(deviation)]

    def forces(
        self, internal: Array, external: Array, friction: Friction | None, border: Array | None
    ) -> Forces:
        """All forces at this iterate.

        Args:
            internal: Internal forces at :attr:`coefficients`.
            external: External forces.
            friction: Friction of the walls.
            border: Forces on the border at :attr:`coefficients`.
        """
        residual = internal - external if border is None else internal - external - border
        reactions, inertial, acceleration = residual, None, None
        if self._inertia is not None and self._deviation is not None:
            acceleration = self._inertia.acceleration(self._deviation)
            inertial = self._inertia.force(acceleration, len(residual))
            residual += inertial
            reactions = residual.copy()
            reactions[: len(self._inertia.impulse)] += self._inertia.impulse
        if friction is not None:
            n, space = self._layout.num_displacement, self._layout.grid.space
            residual = residual.copy()
            residual[:n] -= friction(space.vectors(reactions[:n])).ravel()
        return Forces(internal, external, border, inertial, acceleration, reactions, residual)
