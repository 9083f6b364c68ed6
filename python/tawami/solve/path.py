"""A path of equilibria: the load factor is an unknown, and a control defines the length of a step.

    R(c) - f - (lambda - lambda_0) f'  = 0,     control(c) = 0

Each iteration solves the same tangent twice, K d_r = -R and K d_l = f'. The change of the increments is
d_r + dlambda d_l, with dlambda from the linearised control (Riks 1979; Crisfield 1981; Batoz and Dhatt
1979 for a point). So the tangent may be indefinite, and a path passes limit points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.field.layout import Layout

#: Displacement of a control point per load factor, relative to the largest, that is ignored.
NO_MOTION = 1e-12
#: Error of the length of a step, relative to it, below which a step is accepted.
LENGTH_TOLERANCE = 1e-3


class Control(Protocol):
    """Control of a step, which gives its load factor."""

    def change(self, u: Array, residual: Array, rate: Array) -> float:
        """Change of the load factor in an iteration; NaN if there is none.

        Args:
            u: Displacement coefficients, increments of the step so far.
            residual: Their change at a fixed load factor.
            rate: Their change per load factor.
        """

    def is_met(self, u: Array) -> bool:
        """Whether a step with these increments has the right length."""


@dataclass(frozen=True)
class PointControl:
    """The displacement of a point.

    Attributes:
        layout: Places of the coefficients.
        indices, weights: Coefficients of one component in the whole grid, and values of their functions
            at the point.
        size: Displacement in the step [m].
    """

    layout: Layout
    indices: Indices
    weights: Array
    size: float

    def _at(self, u: Array) -> float:
        return float(self.weights @ self.layout.at(u, self.indices))

    def change(self, u: Array, residual: Array, rate: Array) -> float:
        """See `Control`; exact, because the displacement is linear."""
        moved = self._at(rate)
        if abs(moved) <= NO_MOTION * self.layout.largest(rate):
            return np.nan
        return (self.size - self._at(u) - self._at(residual)) / moved

    def is_met(self, u: Array) -> bool:
        """See `Control`."""
        return abs(self._at(u) - self.size) <= LENGTH_TOLERANCE * abs(self.size)


@dataclass(frozen=True)
class ArcLength:
    """The length of the increment of the displacement, without the load (cylindrical).

    Attributes:
        inner: Scalar product of two displacement fields [m2].
        ahead: Product of a field with the direction in which the path continues; its sign counts.
        size: Length of the step [m].
    """

    inner: Callable[[Array, Array], float]
    ahead: Callable[[Array], float]
    size: float

    def change(self, u: Array, residual: Array, rate: Array) -> float:
        """See `Control`: a step along the tangent of the path, then consistent linearisation."""
        if self.inner(u, u) == 0:
            length = np.sqrt(self.inner(rate, rate))
            return float(np.copysign(self.size / length, self.ahead(rate))) if length else np.nan
        slope = 2 * self.inner(u, rate)
        if slope == 0:
            return np.nan
        excess = self.inner(u, u) - self.size**2
        return -(excess + 2 * self.inner(u, residual)) / slope

    def is_met(self, u: Array) -> bool:
        """See `Control`."""
        length = float(np.sqrt(self.inner(u, u)))
        return abs(length - self.size) <= LENGTH_TOLERANCE * self.size


@dataclass(frozen=True)
class Path:
    """A step along a path.

    Attributes:
        start: Load factor at the beginning, which the external forces of the step belong to.
        guess: Load factor that belongs to a guess of the increments; that at the beginning without.
        rate: External forces per load factor, without pressures that follow the border, on all
            coefficients [N per metre depth].
        control: Control, which gives the load factor.
    """

    start: float
    rate: Array
    control: Control
    guess: float = np.nan

    def external(self, given: Array, factor: float) -> Array:
        """External forces at a load factor."""
        return given + (factor - self.start) * self.rate
