"""Forces on the border of a body that depend on the solution: follower pressures, supports, contact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array
from tawami.base.errors import SupportError
from tawami.field.reduction import Reduction
from tawami.field.sum import Sum

#: Passes with better multipliers in one step.
PASSES = 12


class Term(Protocol):
    """Forces of one action on the border; the same on every rank."""

    @property
    def prescribed(self) -> float:
        """The largest displacement that it prescribes in this step [m]; 0 for a load."""

    @property
    def smooth(self) -> bool:
        """Whether the forces are those of a potential with one tangent everywhere."""

    def begin(self, diagonal: Callable[[], Array]) -> None:
        """Start a step.

        Args:
            diagonal: Gives the diagonal of the tangent at its start, on all coefficients.
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
    """

    def __init__(self, terms: Sequence[Term], comm: Any) -> None:
        self._terms, self._sum = terms, Sum(self, comm)

    @property
    def prescribed(self) -> float:
        """The largest displacement that one of them prescribes [m]."""
        return max((term.prescribed for term in self._terms), default=0.0)

    @property
    def smooth(self) -> bool:
        """Whether all of them are."""
        return all(term.smooth for term in self._terms)

    def begin(self, diagonal: Callable[[], Array]) -> None:
        """Start a step; see `Term.begin`."""
        self._passes = 0
        for term in self._terms:
            term.begin(diagonal)

    def forces(self, coefficients: Array) -> Array:
        """Their sum, as `Term.forces`."""
        parts = (term.forces(coefficients) for term in self._terms)
        return sum(parts, np.zeros_like(coefficients))

    def add_tangent(self, tangent: Any, reduction: Reduction) -> Any:
        """A reduced tangent with their stiffness."""
        first, *more = (term.stiffness() for term in self._terms)
        return self._sum.of(tangent, sum(more, first), reduction)

    def improve(self) -> bool:
        """Improve all multipliers; whether another solve is needed.

        Raises:
            SupportError: They do not settle.
        """
        self._passes += 1
        pending = [term for term in self._terms if term.improve()]
        if pending and self._passes >= PASSES:
            raise SupportError(pending[0].unsettled)
        return bool(pending)

    def accept(self) -> None:
        """Keep what later steps need, once a step is stored."""
        for term in self._terms:
            term.accept()
