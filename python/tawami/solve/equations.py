"""The equations of one step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tawami.base.arrays import Array
from tawami.field.reduction import Reduction
from tawami.solve.inertia import Inertia
from tawami.solve.iterate import Forces, Friction, Iterate
from tawami.solve.path import Path
from tawami.solve.terms import Terms

#: Advice if a step does not converge.
STATIC = (
    "The load may be too large for the body, or for one step. ramp(scene) applies it in "
    "steps and returns the share that it reached; follow(scene, ...) passes a limit load"
)
CONTACT = (
    "Patches still change between open, sticking and sliding, mostly with friction of 1 and more. "
    "ramp(scene, 0.5) moves obstacles and loads in steps, and halves those that fail"
)
DYNAMIC = "Use a smaller dt; run(...) does this automatically"
ALONG_PATH = "Use shorter steps along the path"


@dataclass(frozen=True)
class Equations:
    """Arguments of `Newton.solve`.

    Attributes:
        reduction: Unknowns that the supports leave free.
        external: External forces on all coefficients [N per metre depth]; on a path, at its start.
        inertia: Inertia of a dynamic step.
        friction: Friction of the walls.
        path: Path on which the load factor is an unknown.
        terms: Forces on the border that depend on the solution.
    """

    reduction: Reduction
    external: Array
    inertia: Inertia | None
    friction: Friction | None
    path: Path | None
    terms: Terms | None = None

    def first(self, guess: Array | None) -> Iterate:
        """The first iterate, at increments of all fields or at zero."""
        factor = np.nan
        if self.path is not None:
            factor = self.path.start if guess is None else self.path.guess
        return Iterate(self.reduction, guess, self.inertia, factor)

    def forces(self, iterate: Iterate, internal: Array) -> Forces:
        """All forces at an iterate with these internal forces."""
        external = self.external
        if self.path is not None:
            external = self.path.external(external, iterate.factor)
            if self.terms is not None:
                self.terms.load(iterate.factor - self.path.start)
        border = None if self.terms is None else self.terms.forces(iterate.coefficients)
        return iterate.forces(internal, external, self.friction, border)

    @property
    def rate(self) -> Array:
        """Forces per load factor of a path, at the last forces."""
        assert self.path is not None
        following = 0.0 if self.terms is None else self.terms.rate
        return np.asarray(self.path.rate + following)

    @property
    def is_smooth(self) -> bool:
        """Whether there is no contact, which has states."""
        return self.terms is None or not self.terms.contacts

    def is_searched(self, finite: bool) -> bool:
        """Whether a line search serves: with contact, or in a static step of small strain.

        Args:
            finite: Whether the strain is finite.
        """
        if self.friction is not None or self.path is not None:
            return False
        return not self.is_smooth or (self.inertia is None and not finite)

    @property
    def advice(self) -> str:
        """Advice for a step that does not converge."""
        if self.terms is not None and self.terms.contradiction:
            return self.terms.contradiction
        if self.inertia is not None:
            return DYNAMIC
        if self.path is not None:
            return ALONG_PATH
        return STATIC if self.is_smooth else CONTACT
