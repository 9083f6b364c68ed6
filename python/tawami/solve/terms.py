"""Forces on the border of a body that depend on the solution: follower pressures, supports, contact."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Indices
from tawami.base.places import Added
from tawami.field.follower import FollowerPressure
from tawami.field.layout import Layout
from tawami.solve.bordered import Bordering, Elimination, OwnUnknowns, Tie

#: Passes with better multipliers in one step.
PASSES = 20
#: Error of a constraint, relative to the displacement, that no change of it can remove.
APART = 1e-3


class Term(Protocol):
    """Forces of one action on the border.

    Each rank evaluates the border in its cells, from the coefficients of its window.
    """

    @property
    def prescribed(self) -> float:
        """The largest displacement that it prescribes in this step [m]; 0 for a load."""

    def forces(self, coefficients: Array) -> Array:
        """The part of this rank in the forces on the body [N per metre depth], at increments of all
        fields; a call for all ranks.
        """

    def stiffness(self, far: Indices) -> sp.csr_matrix | None:
        """The part of this rank in the derivative of the last forces, with the opposite sign; None if
        there is none.

        Args:
            far: Numbers in the whole grid of coefficients that follow those of the window.
        """

    def accept(self) -> None:
        """Keep what later steps need, once a step is stored."""


class ContactTerm(Term, Bordering, Protocol):
    """Contact: its tangent changes with the states of patches, and its multipliers in passes.

    It has a few unknowns of its own, or none, and in dynamics weights of its own.
    """

    @property
    def far(self) -> Indices:
        """Numbers in the whole grid of coefficients outside the window that its stiffness here has."""

    def improve(self) -> bool:
        """Improve the multipliers at a solution; whether another solve is needed."""

    @property
    def unsettled(self) -> str:
        """Message if the multipliers do not settle: what is wrong, and what to do."""


class Terms:
    """All such forces in one step.

    Args:
        loads: The actions without contact.
        layout: Places of the coefficients.
        tied: Those with constraints, whose unknowns are multipliers.
        contacts: Contact with each obstacle.

    Attributes:
        stuck: Message if the multipliers of contact do not settle.
        stiffness: The part of this rank in that of the last tangent, on the coefficients of its window
            and those that are far.
        far: Numbers in the whole grid of coefficients beyond the window, which patches on several ranks
            couple.
    """

    def __init__(
        self,
        loads: Sequence[Term],
        layout: Layout,
        tied: Sequence[Tie] = (),
        contacts: Sequence[ContactTerm] = (),
    ) -> None:
        self._loads, self._layout, self._added = loads, layout, Added()
        self.tied, self.contacts = tied, contacts
        self._terms: list[Term] = [*loads, *contacts]
        self._following = [term for term in loads if isinstance(term, FollowerPressure)]
        #: Stiffness of each term when they were last added, and their sum.
        self._stiffnesses: list[sp.csr_matrix] = []
        self.stiffness: sp.csr_matrix | None = None
        self.far: Indices = np.zeros(0, dtype=np.int64)

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
        """Derivative of the last forces by the load factor of a path; a call for all ranks."""
        if not self._following:
            return 0.0
        return self._layout.sum(functools.reduce(operator.add, (t.rate for t in self._following)))

    @property
    def prescribed(self) -> float:
        """The largest displacement that one of them prescribes [m]."""
        return max((term.prescribed for term in self._terms), default=0.0)

    def begin(self) -> None:
        """Start a step."""
        self._passes, self.stuck = 0, ""
        self.restart()

    def restart(self) -> None:
        """Go back to the first guess of the unknowns of their own, and of the states of contact."""
        for term in [*self.tied, *self.contacts]:
            term.restart()

    def shorten(self, share: float) -> None:
        """Take a share of the last change of the unknowns of their own."""
        for term in self._own:
            term.shorten(share)

    @property
    def first_work(self) -> float:
        """Work of the residuals of their own equations on the last change, at its beginning."""
        return sum(term.first_work for term in self._own)

    @property
    def work(self) -> float:
        """The same at the last forces."""
        return sum(term.work for term in self._own)

    def forces(self, coefficients: Array) -> Array:
        """Their sum; a collective call.

        Args:
            coefficients: Increments of all fields.
        """

        def of(terms: Sequence[Term]) -> Array:
            none = np.zeros_like(coefficients)
            parts = (term.forces(coefficients) for term in terms)
            return self._layout.sum(sum(parts, none)) if terms else none

        #: Of all that are no contact.
        self.loads = of(self._loads)
        return self.loads + of(self.contacts)

    def update_stiffness(self) -> sp.csr_matrix | None:
        """Their stiffness at the last forces; the same object if no part has changed."""
        far = [self.far[:0], *(contact.far for contact in self.contacts)]
        self.far = np.unique(np.concatenate(far))
        all_parts = [term.stiffness(self.far) for term in self._terms]
        parts = [part for part in all_parts if part is not None]
        same = len(parts) == len(self._stiffnesses)
        if parts and not (same and all(map(operator.is_, parts, self._stiffnesses))):
            self._stiffnesses, self.stiffness = parts, self._added.of(parts)
        return self.stiffness

    @property
    def _own(self) -> list[OwnUnknowns]:
        return [*self.bordering, *self.tied]

    @functools.cached_property
    def bordering(self) -> list[Bordering]:
        """The terms with a few unknowns of their own."""
        return [term for term in self.contacts if term.num_unknowns]

    def add(self, multipliers: Array) -> None:
        """Go to the next iterate of the multipliers of all constraints."""
        ends = np.cumsum([tie.num_unknowns for tie in self.tied])[:-1]
        for tie, change in zip(self.tied, np.split(multipliers, ends), strict=True):
            tie.add(change)

    @property
    def measure(self) -> float:
        """The largest of the measures of their own equations."""
        return max((term.measure for term in self._own), default=0.0)

    def elimination(self, solve: Callable[[Array], Array]) -> Elimination | None:
        """The elimination of their own unknowns; None if there are none.

        Args:
            solve: As in `Elimination`.
        """
        if not self.bordering:
            return None
        multipliers = sum(tie.num_unknowns for tie in self.tied)
        return Elimination(self.bordering, solve, self._layout, multipliers)

    def improve(self) -> bool:
        """Improve the multipliers of contact; whether another solve is needed."""
        self._passes += 1
        pending = [term for term in self.contacts if term.improve()]
        if pending and self._passes >= PASSES:
            self.stuck = pending[0].unsettled
        return bool(pending)

    @property
    def contradiction(self) -> str:
        """Message if constraints contradict others; empty if the last iterate fulfils all."""
        return next((tie.unsettled for tie in self.tied if tie.measure > APART), "")

    def accept(self) -> None:
        """Keep what later steps need, once a step is stored."""
        for term in self._terms:
            term.accept()
