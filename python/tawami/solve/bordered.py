"""Terms on the border with unknowns of their own, such as a free obstacle: block elimination.

K x + B q = -r        X = K^-1 B,  x0 = -K^-1 r
C x + D q = -s        (D - C X) q = -s - C x0,  x = x0 - X q
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import block_diag

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.rows import Rows
from tawami.field.layout import Layout


class GivesWayError(Exception):
    """The body gives way to an unknown of a term, as at a limit load."""


@dataclass(frozen=True)
class Blocks:
    """Derivatives of residuals; those of the coefficients are the parts of this rank.

    Attributes:
        of_body: Of all coefficients' residual by the own unknowns, coefficients x unknowns.
        by_body: Of the own residual by all coefficients, unknowns x coefficients.
        own: Of the own residual by the own unknowns.
    """

    of_body: Array
    by_body: Array
    own: Array


class OwnUnknowns(Protocol):
    """A term with unknowns of its own.

    Attributes:
        first_work: Work of the residual on the last change, at its beginning.
    """

    first_work: float

    @property
    def num_unknowns(self) -> int:
        """Number of them; it may be 0."""

    @property
    def residual(self) -> Array:
        """Residual of its equations at the last forces."""

    @property
    def measure(self) -> float:
        """Size of the residual relative to the terms of its equations; a call for all ranks."""

    def add(self, change: Array) -> None:
        """Go to the next iterate."""

    def shorten(self, share: float) -> None:
        """Take a share of the last change."""

    @property
    def work(self) -> float:
        """Work of the residual on the last change, at the last forces."""

    def restart(self) -> None:
        """Go back to the first guess."""


class Tie(OwnUnknowns, Protocol):
    """A term with linear constraints: its unknowns are the multipliers, and its residual the errors.

    Its forces are minus the transposed gradient times the multipliers.
    """

    @property
    def gradient(self) -> Rows:
        """Derivative of the residual by the coefficients of this rank, constraints x coefficients."""

    @property
    def unsettled(self) -> str:
        """Message if the errors do not vanish: what is wrong, and what to do."""


class Bordering(OwnUnknowns, Protocol):
    """A term whose unknowns are few, and are eliminated."""

    def blocks(self) -> Blocks:
        """Derivatives at the last forces."""

    def check_held(self, matrix: Array) -> None:
        """Check that its equations can be solved.

        Args:
            matrix: D - C X.

        Raises:
            SupportError: They cannot, as nothing holds one of its unknowns.
            GivesWayError: The body gives way to one of them.
        """


class Elimination:
    """Solves for the unknowns of terms together with all coefficients.

    Making one, and its methods, are collective calls.

    Args:
        terms: The terms.
        solve: Gives K^-1 f, all coefficients and multipliers, for forces f on all coefficients.
        layout: Places of the coefficients.
        multipliers: Number of multipliers.
    """

    def __init__(
        self,
        terms: Sequence[Bordering],
        solve: Callable[[Array], Array],
        layout: Layout,
        multipliers: int,
    ) -> None:
        self._terms, blocks = terms, [term.blocks() for term in terms]
        self._comm = layout.grid.comm
        of_body = layout.sum(np.hstack([block.of_body for block in blocks]))
        self._by_body = np.vstack([block.by_body for block in blocks])
        self._columns = np.zeros((layout.size + multipliers, of_body.shape[1]))
        some = ranks.any_of(self._comm, of_body.any(axis=0))
        for k in np.flatnonzero(some):
            self._columns[:, k] = solve(np.ascontiguousarray(of_body[:, k]))
        own = block_diag(*(block.own for block in blocks))
        self._matrix = own - self._on_terms(self._columns)
        start = 0
        for term in terms:
            mine = slice(start, start + term.num_unknowns)
            term.check_held(self._matrix[mine, mine])
            start = mine.stop

    def _on_terms(self, change: Array) -> Array:
        """C x, where x may be followed by multipliers."""
        return ranks.sum_of(self._comm, self._by_body @ change[: self._by_body.shape[1]])

    def solve(self, change: Array, residual: Array) -> tuple[Array, Array]:
        """x and q.

        Args:
            change: x0.
            residual: s.
        """
        q = np.linalg.solve(self._matrix, -residual - self._on_terms(change))
        return change - self._columns @ q, q

    @property
    def residual(self) -> Array:
        """s of all terms."""
        return np.concatenate([term.residual for term in self._terms])

    def add(self, change: Array) -> None:
        """Go to the next iterate of all terms."""
        start = 0
        for term in self._terms:
            term.add(change[start : start + term.num_unknowns])
            start += term.num_unknowns
