"""Arrays of the particles of a solution by their names."""

from __future__ import annotations

import numpy as np

from tawami.base.arrays import Array
from tawami.quantities.quantities import Arrays


class OfAllParticles:
    """Arrays of all particles, in the order of their numbers; see `Solution` for several ranks."""

    #: The arrays by name, for quantities.
    arrays: Arrays

    @property
    def number(self) -> Array:
        """Numbers of the particles in the body, ascending: all, unless some have left."""
        return self.arrays["number"]

    @property
    def x(self) -> Array:
        """Positions of the particles [m]."""
        return self.arrays["x"]

    @property
    def volume(self) -> Array:
        """Their volumes [m2] at the start."""
        return self.arrays["volume"]

    @property
    def stress(self) -> Array:
        """Their stress [Pa] (xx, yy, zz, xy) at the end of this step."""
        return self.arrays["stress"]

    @property
    def displacement_of_particles(self) -> Array:
        """Their displacement [m] since the start."""
        return self.arrays["displacement"]

    @property
    def mean_stress(self) -> Array:
        """Mean stress [Pa] at the particles, (xx + yy + zz)/3, tension positive."""
        return np.asarray(self.stress[:, :3].mean(axis=1))
