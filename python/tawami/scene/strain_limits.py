"""Warnings of strains that the model of a scene does not take, each given once."""

from __future__ import annotations

from tawami.base.arrays import Array
from tawami.scene import softening, strain_limit
from tawami.scene.domain import Domain


class StrainLimits:
    """Displacement gradients beyond small strain, and softening.

    Args:
        small: Whether the strains of the scene are small.
    """

    def __init__(self, *, small: bool) -> None:
        self._small, self._softens = small, False

    def warn(self, domain: Domain, total: Array, coefficients: Array) -> None:
        """Warn of a step; a call for all ranks.

        Args:
            domain: The particles.
            total: Coefficients of all fields since the start.
            coefficients: Their increments at the end of the step.
        """
        n = domain.layout.num_displacement
        if self._small:
            large = strain_limit.exceeded(domain, total[:n] + coefficients[:n])
            if large is not None:
                self._small = False
                strain_limit.warn_of(domain, *large)
        if not self._softens:
            soft = softening.found(domain, coefficients)
            if soft is not None:
                self._softens = True
                softening.warn_of(domain, *soft)
