"""Inertia of a step on the grid, in the increments u of its displacement.

    a = slope (u - dt v) - back,    slope = 1/(beta dt^2),    back = (1/(2 beta) - 1) a at the beginning

In a short step u is nearly `dt v`, in a long one nearly 0 beside it: in u alone the digits of u - dt v
are lost, in u - dt v alone those of u. Newton's method adds to both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
#: Between 1 and the next number.
EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Inertia:
    """Forces `m_i a_i` of the lumped mass.

    Attributes:
        mass: Of each displacement coefficient [kg per metre depth].
        slope: [1/s2]
        course: Increments without acceleration, dt v [m].
        back: [m/s2]
        impulse: Of the supports at the beginning of the step, over its length: what changed the
            velocities that came from the particles into those they prescribe [N per metre depth].
    """

    mass: Array
    slope: float
    course: Array
    back: Array
    impulse: Array

    def off_course(self, coefficients: Array) -> Array:
        """u - dt v of the first iterate; 0 where only round-off is between them, as for functions that
        constraints make of others.
        """
        off = coefficients[: len(self.mass)] - self.course
        off[np.abs(off) <= 8 * EPSILON * np.abs(self.course).max(initial=0.0)] = 0.0
        return np.asarray(off)

    def acceleration(self, off: Array) -> Array:
        """At the end of the step, from u - dt v [m]: of each displacement coefficient [m/s2]."""
        return np.asarray(self.slope * off - self.back)

    def force(self, acceleration: Array, size: int) -> Array:
        """On all coefficients, of which there are `size`."""
        forces = np.zeros(size)
        forces[: len(acceleration)] = self.mass * acceleration
        return forces
