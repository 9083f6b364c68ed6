"""Whether nearly incompressible bodies turn too far in a step.

With the trapezoidal rule a body that turns by the angle w dt in a step is stretched by (w dt)^2/4.
A stiff volume answers with stresses that a too long step amplifies. Measured with a free block
(tests/motion/test_rotation.py): with nu = 0.49 it gains energy at 0.16 rad a step and not at
0.10; with nu = 0.4999 at 0.10 and not at 0.08; with nu = 0.45 not at 0.16.
"""

from __future__ import annotations

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import RotationWarning
from tawami.base.warn import warn
from tawami.step.configuration import Configuration

#: K/mu from which the volume is stiff, and the largest rotation in a step [rad].
STIFF, LARGEST = 10.0, 0.08
#: Share of the stiff mass that must turn further. Single particles may.
SHARE = 0.1


class Rotation:
    """Warns, once, of steps in which a stiff body turns too far.

    Args:
        configuration: The body.

    Attributes:
        warned: Whether it has warned.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._now = configuration
        self.warned = not configuration.model.moves

    def check(self, u: Array, dt: float) -> None:
        """Check a step; a call for all ranks.

        Args:
            u: Increments of the displacement, functions x dim [m].
            dt: [s]

        Warns:
            RotationWarning: More than a tenth of the stiff mass turns further than `LARGEST`.
        """
        K, mu = self._now.model.moduli.T
        stiff_laws = STIFF * mu < K
        if self.warned or not stiff_laws.any():
            return
        domain = self._now.domain
        stiff = stiff_laws[domain.particles.material]
        gradients = domain.gradients(u)[stiff]
        spin = 0.5 * (gradients - gradients.transpose(0, 2, 1))
        angles = np.sqrt(0.5 * np.einsum("pij,pij->p", spin, spin))
        mass = domain.mass[stiff]
        turning = mass * (angles > LARGEST)
        sums = np.array([mass.sum(), turning.sum(), turning @ angles])
        whole, part, moment = ranks.sum_of(self._now.model.grid.comm, sums)
        if part <= SHARE * whole:
            return
        self.warned = True
        if self._now.model.grid.comm.rank:
            return
        angle = moment / part
        warn(
            f"a nearly incompressible body turns by {angle:.2g} rad in a step of {dt:.3g} s: its stress "
            f"and energy may grow without bound. Expected up to {LARGEST:g} rad with K/mu above "
            f"{STIFF:g}: use dt = {0.95 * LARGEST / angle * dt:.2g} s or less",
            RotationWarning,
        )
