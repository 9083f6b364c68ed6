"""The motion of an obstacle in one step: prescribed, or by equations of its own.

Statics: force + contact = 0. Dynamics, by Newmark's method, with contact as in `tawami.motion.newmark`:

    m (slope (q - dt w) - back) = force + factor c1 - (factor - 1) c0,    factor = 1/(2 beta)

q is the motion in the step, w and a are velocity and acceleration at its start, c0 and c1 the contact
forces at its start and end.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tawami.base.arrays import Array, Mask
from tawami.border.rigid import Pose

#: Share of slope m q below which the inertia m slope (q - dt w) is round-off; it is solved to 1e-6.
DIGITS = 1e-9


@dataclass(frozen=True)
class Times:
    """A step of Newmark's method.

    Attributes:
        gamma, beta: Its parameters.
        dt: Length [s].
    """

    gamma: float
    beta: float
    dt: float

    @property
    def factor(self) -> float:
        """Factor of contact forces at the end of the step, 1/(2 beta)."""
        return 0.5 / self.beta

    @property
    def slope(self) -> float:
        """Derivative of the acceleration by the motion [1/s2]."""
        return 1 / (self.beta * self.dt**2)

    def corrected(self, jump: Array) -> tuple[Array, Array]:
        """Parts of acceleration and velocity at the end that a change of contact forces adds.

        Args:
            jump: Contact forces at the end, less those at the start, by the mass [m/s2].

        Returns:
            Parts [m/s2], [m/s] beyond Newmark's formulas with slope (u - dt v) - back.
        """
        a = -(self.factor - 1) * jump
        return a, self.dt * (self.gamma * a + (1 - self.gamma) * jump)


@dataclass
class ObstacleMotion:
    """Motion of one obstacle in a step.

    Attributes:
        start: Pose at the start.
        change: Prescribed motion in the step, translations [m], then rotations [rad].
        free: Which motions are unknown.
        force: Forces and moments at the end of the step, without contact [N per metre depth].
        mass: Mass or moment of inertia of each motion [kg per metre depth].
        rates: Velocity and acceleration at the start.
        times: The step; None in statics.
    """

    start: Pose
    change: Array
    free: Mask
    force: Array
    mass: Array
    rates: tuple[Array, Array]
    times: Times | None = None
    unknown: Array = field(init=False)

    def __post_init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Go back to the first guess."""
        coasting = np.zeros_like(self.change) if self.times is None else self._coasting
        self.unknown = np.where(self.free, coasting, self.change)
        self._before, self.last_change = self.unknown, np.zeros(int(self.free.sum()))

    @property
    def _coasting(self) -> Array:
        assert self.times is not None
        return np.asarray(self.times.dt * self.rates[0])

    @property
    def factor(self) -> float:
        """Factor of the contact forces at the end of the step."""
        return 1.0 if self.times is None else self.times.factor

    @property
    def slope(self) -> float:
        """Derivative of accelerations by displacements [1/s2]; 0 in statics."""
        return 0.0 if self.times is None else self.times.slope

    @property
    def pose(self) -> Pose:
        """Present pose."""
        return self.start.moved(self.unknown)

    def add(self, change: Array) -> None:
        """Go to the next iterate of the free motions."""
        self._before, self.last_change = self.unknown, change
        self.shorten(1.0)

    def shorten(self, share: float) -> None:
        """Take a share of the last change."""
        self.unknown = self._before.copy()
        self.unknown[self.free] += share * self.last_change

    @property
    def _acceleration(self) -> Array:
        """slope (q - dt w) - back."""
        assert self.times is not None
        back = (self.times.factor - 1) * self.rates[1]
        return np.asarray(self.times.slope * (self.unknown - self._coasting) - back)

    def parts(self, at_start: Array, at_end: Array) -> list[Array]:
        """Terms of the residual of the free motions, whose sum it is.

        Args:
            at_start, at_end: Contact forces on the obstacle.
        """
        found = [-self.force, -self.factor * at_end, (self.factor - 1) * at_start]
        if self.times is not None:
            found.append(self.mass * self._acceleration)
        return [part[self.free] for part in found]

    @property
    def round_off(self) -> Array:
        """Forces on the free motions below which their inertia has no digits."""
        return np.asarray(DIGITS * self.slope * self.mass * np.abs(self.unknown))[self.free]

    @property
    def stiffness(self) -> Array:
        """Derivative of the residual by the free motions without contact."""
        return np.diag(self.slope * self.mass[self.free])

    def rates_at_end(self, at_start: Array, at_end: Array) -> tuple[Array, Array]:
        """Velocity and acceleration at the end of the step; statics keeps those at its start.

        Args:
            at_start, at_end: Contact forces on the obstacle.
        """
        zero = np.zeros_like(self.change)
        if self.times is None:
            return self.rates
        w, a = self.rates
        times = self.times
        # prescribed motions: the acceleration is not used
        jump = np.divide(at_end - at_start, self.mass, out=zero.copy(), where=self.free)
        end = self._acceleration
        more_a, more_w = times.corrected(jump)
        w1 = w + times.dt * ((1 - times.gamma) * a + times.gamma * end) + more_w
        given = self.change / times.dt
        return np.where(self.free, w1, given), np.where(self.free, end + more_a, 0.0)
