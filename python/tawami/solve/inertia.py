"""Inertia of a step on the grid, in the increments u of its displacement (Newmark 1959).

    a = slope (u - dt v) - back,    slope = 1/(beta dt^2),    back = (1/(2 beta) - 1) a at the beginning

In a short step u is nearly dt v, in a long one dt v is large compared with u. So neither u nor u - dt v
has all digits by itself: Newton's method updates both.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array
from tawami.base.petsc import add_diagonal, add_rows
from tawami.field.layout import Layout
from tawami.field.reduction import Reduction

#: Distance from 1 to the next floating-point number.
EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Inertia:
    """Forces m_i a_i of the lumped mass.

    Attributes:
        mass: Mass of each displacement coefficient [kg per metre depth].
        slope: Derivative of the acceleration with respect to u [1/s2].
        coasting: Increments without acceleration, dt v [m].
        back: Part of the acceleration that comes from the beginning of the step [m/s2].
        impulse: Impulse by which the supports impose their velocities at the beginning of the step,
            divided by the length of the step [N per metre depth].
        layout: Places of the coefficients.
    """

    mass: Array
    slope: float
    coasting: Array
    back: Array
    impulse: Array
    layout: Layout

    def deviation(self, coefficients: Array) -> Array:
        """u - dt v of the first iterate; a collective call.

        It is 0 where the difference is only round-off, as in functions that constraints tie to others.
        """
        deviation = coefficients[: len(self.mass)] - self.coasting
        round_off = 8 * EPSILON * self.layout.largest(self.coasting)
        deviation[np.abs(deviation) <= round_off] = 0.0
        return np.asarray(deviation)

    def acceleration(self, deviation: Array) -> Array:
        """Acceleration of each displacement coefficient at the end of the step [m/s2]."""
        return np.asarray(self.slope * deviation - self.back)

    def force(self, acceleration: Array, size: int) -> Array:
        """Forces of an acceleration on all `size` coefficients [N per metre depth]."""
        forces = np.zeros(size)
        forces[: len(acceleration)] = self.mass * acceleration
        return forces

    def adder(self, reduction: Reduction) -> Callable[[Any], None]:
        """A function that adds S^T (slope M) S to a reduced tangent; a call for all ranks."""
        mass = self.force(np.full(len(self.mass), self.slope), len(reduction.offset))
        diagonal = reduction.diagonal(mass)
        if diagonal is not None:
            return functools.partial(add_diagonal, values=diagonal)
        own = sp.diags(np.where(self.layout.own, mass, 0.0)).tocsr()

        return functools.partial(add_rows, rows=reduction.of_window(own))
