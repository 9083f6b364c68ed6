"""Forces on the border of a body that depend on the solution: follower pressures, supports, contact."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array
from tawami.base.places import Added
from tawami.field.follower import FollowerPressure
from tawami.field.reduction import Reduction
from tawami.field.sum import Sum
from tawami.solve.bordered import Bordering, Elimination
from tawami.solve.inertia import Inertia

#: Passes with better multipliers in one step.
PASSES = 20


class Term(Protocol):
    """Forces of one action on the border; the same on every rank."""

    @property
    def prescribed(self) -> float:
        """The largest displacement that it prescribes in this step [m]; 0 for a load."""

    @property
    def smooth(self) -> bool:
        """Whether the forces are those of a potential with one tangent everywhere."""

    @property
    def implicit(self) -> bool:
        """Whether the forces are those of contact, with weights of their own in dynamics."""

    def begin(self, diagonal: Callable[[], Array], inertia: Array | None) -> None:
        """Start a step.

        Args:
            diagonal: Gives the diagonal of the tangent at its start, on all coefficients.
            inertia: Diagonal of the inertia, on the displacement coefficients; None in statics.
        """

    def forces(self, coefficients: Array) -> Array:
        """Forces on the body, on all coefficients [N per metre depth], at increments of all fields."""

    def stiffness(self) -> sp.csr_matrix:
        """Derivative of the last forces, with the opposite sign."""

    def improve(self) -> bool:
        """Improve the multipliers at a solution; whether another solve is needed."""

    @property
    def unsettled(self) -> str:
        """Message if the multipliers do not settle: what is wrong, and what to do."""

    def accept(self) -> None:
        """Keep what later steps need, once a step is stored."""


class Terms:
    """All such forces in one step.

    Args:
        terms: The actions.
        comm: Communicator.

    Attributes:
        stuck: Message if the multipliers do not settle.
        stiffness: That of the last tangent, on all coefficients.
    """

    def __init__(self, terms: Sequence[Term], comm: Any) -> None:
        self._terms, self._sum, self._added = terms, Sum(self, comm), Added()
        self._following = [term for term in terms if isinstance(term, FollowerPressure)]
        #: Stiffness of each term when they were last added, and their sum.
        self._stiffnesses: list[sp.csr_matrix] = [None] * len(terms)
        self.stiffness: sp.csr_matrix | None = None

    def load(self, share: float) -> None:
        """Add a share of the loads of a path to pressures that follow the border."""
        for term in self._following:
            term.load(share)

    @property
    def loads_grow(self) -> bool:
        """Whether such a pressure changes along a path."""
        return any(term.grows for term in self._following)

    @property
    def rate(self) -> Array | float:
        """Derivative of the last forces by the load factor of a path."""
        return sum(term.rate for term in self._following)

    @property
    def prescribed(self) -> float:
        """The largest displacement that one of them prescribes [m]."""
        return max((term.prescribed for term in self._terms), default=0.0)

    @property
    def smooth(self) -> bool:
        """Whether all of them are."""
        return all(term.smooth for term in self._terms)

    def begin(self, diagonal: Callable[[], Array], inertia: Inertia | None) -> None:
        """Start a step; see `Term.begin`."""
        of_mass = None if inertia is None else inertia.slope * inertia.mass
        self._passes, self.stuck = 0, ""
        for term in self._terms:
            term.begin(diagonal, of_mass)

    def restart(self) -> None:
        """Go back to the first guess of the unknowns of their own."""
        for term in self.bordering:
            term.restart()

    def shorten(self, share: float) -> None:
        """Take a share of the last change of the unknowns of their own."""
        for term in self.bordering:
            term.shorten(share)

    @property
    def first_work(self) -> float:
        """Work of the residuals of their own equations on the last change, at its beginning."""
        return sum(term.first_work for term in self.bordering)

    @property
    def work(self) -> float:
        """The same at the last forces."""
        return sum(term.work for term in self.bordering)

    def forces(self, coefficients: Array) -> Array:
        """Their sum, as `Term.forces`."""
        #: Of all that are no contact.
        self.loads = np.zeros_like(coefficients)
        total = np.zeros_like(coefficients)
        for term in self._terms:
            forces = term.forces(coefficients)
            total += forces
            if not term.implicit:
                self.loads += forces
        return total

    def add_tangent(self, tangent: Any, reduction: Reduction) -> Any:
        """A reduced tangent with their stiffness."""
        parts = [term.stiffness() for term in self._terms]
        if not all(map(operator.is_, parts, self._stiffnesses)):
            self._stiffnesses, self.stiffness = parts, self._added.of(parts)
        return self._sum.of(tangent, self.stiffness, reduction)

    @functools.cached_property
    def bordering(self) -> list[Bordering]:
        """The terms with unknowns of their own."""
        return [t for t in self._terms if isinstance(t, Bordering) and t.num_unknowns]

    @property
    def measure(self) -> float:
        """The largest of the measures of their own equations."""
        return max((term.measure for term in self.bordering), default=0.0)

    def elimination(self, solve: Callable[[Array], Array]) -> Elimination | None:
        """The elimination of their own unknowns; None if there are none.

        Args:
            solve: As in `Elimination`.
        """
        terms = self.bordering
        return Elimination(terms, solve) if terms else None

    def improve(self) -> bool:
        """Improve all multipliers; whether another solve is needed."""
        self._passes += 1
        pending = [term for term in self._terms if term.improve()]
        if pending and self._passes >= PASSES:
            self.stuck = pending[0].unsettled
        return bool(pending)

    def accept(self) -> None:
        """Keep what later steps need, once a step is stored."""
        for term in self._terms:
            term.accept()
