"""Warnings of a step about strains and laws, each given once."""

from __future__ import annotations

from tawami.base.arrays import Array
from tawami.domain import softening, spacing, strain_limit
from tawami.domain.domain import Domain
from tawami.domain.tangents import warn_of_differences


class StrainLimits:
    """Displacement gradients beyond small strain, particles far apart, softening, and laws without a
    tangent.

    Args:
        small: Whether the strains of the scene are small.
    """

    def __init__(self, *, small: bool) -> None:
        self._small, self._softens, self._apart = small, False, small
        self._without_tangent = set[str]()

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
        if not self._apart:
            self._apart = spacing.warned(domain, domain.model.space.vectors(coefficients[:n]))
        if not self._softens:
            self._softens = softening.warned(domain, coefficients)
        warn_of_differences(domain, self._without_tangent)
