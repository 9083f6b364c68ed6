"""The seam between particles and field problem (contract 3 of CONTRIBUTING.md).

(form, particle data on active cells, reduction) -> residual and reduced tangent. `reference` and
`points` implement it, and nothing else depends on the choice.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.petsc import rows_of
from tawami.base.text import quoted
from tawami.border.points import BorderPoints
from tawami.fem.rules import Rule
from tawami.field.attachment import Attachment
from tawami.field.border_terms import BorderTerms
from tawami.field.ghost import GhostPenalty
from tawami.field.layout import Layout
from tawami.field.reduction import Reduction

NOTHING: Mapping[str, Array] = {}


class Assembly(ABC):
    """Residual and tangent of a form on the active cells of a grid.

    Args:
        attachment: The form and the active cells.

    Attributes:
        attachment: The form and the active cells.
        reduction: The reduction of the last tangent; None before the first.
    """

    reduction: Reduction | None = None

    def __init__(self, attachment: Attachment) -> None:
        self.attachment = attachment
        self._compiled, self._stopwatch = attachment.compiled, attachment.stopwatch
        self._ghost = GhostPenalty(attachment)
        self._border: BorderTerms | None = None

    @property
    def layout(self) -> Layout:
        """Places of the coefficients."""
        return self.attachment.layout

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Residual of every field on all coefficients, before supports: :meth:`forces` and those of the
        ghost penalty.

        Args:
            coefficients: Increments of all fields.
            data: Particle data of each rule, particles x columns.
        """
        forces = self.forces(coefficients, data)
        return self._ghost.add_forces(forces, coefficients, data)

    @abstractmethod
    def forces(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Residual without the ghost penalty.

        This and the other methods are collective calls. All coefficients are those of the window.

        Args:
            coefficients: Increments of all fields.
            data: Particle data of each rule, particles x columns.
        """

    @abstractmethod
    def magnitude(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Sums of the absolute values of the contributions to the residual.

        A contribution is that of a particle, and of a cell for integrals over cells. The ghost penalty
        is left out.

        Args:
            coefficients: Increments of all fields.
            data: Particle data of each rule, particles x columns.
        """

    @abstractmethod
    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """P^T K P as a PETSc matrix.

        The next call overwrites it. It is the same object as long as the unknowns are the same.
        """

    def set_border(
        self,
        points: BorderPoints | None,
        particles: Mapping[str, Array],
        carried: Mapping[str, Array] = NOTHING,
    ) -> None:
        """Give the sums of the form over the border, `sum_b`, their points; a collective call.

        Without such sums it does nothing.

        Args:
            points: Points of the border, the same on every rank; None if the body has none.
            particles: Numbers of this rank's particles by name: those of the nearest particle of the
                cell are the numbers of a point.
            carried: Numbers of the points by name, which replace these.

        Raises:
            InputError: The body has no border, or it lacks a part that the form names.
        """
        if not self._compiled.border:
            return
        if points is None:
            raise self._no_border()
        self._border = BorderTerms(self.attachment, points, particles, carried)

    @property
    def border(self) -> BorderTerms:
        """The sums over the border.

        Raises:
            InputError: The body has no border.
        """
        if self._border is None:
            raise self._no_border()
        return self._border

    def refresh_border(self) -> None:
        """Read the numbers of the points of the border again: they may have changed."""
        if self._border is not None:
            self._border.refresh()

    def border_work(self, coefficients: Array) -> float:
        """Work of the sums over the border on the displacement of a step, by the trapezoidal rule.

        It is exact for forces that are linear in the displacement. A collective call.

        Args:
            coefficients: Increments of all fields in the step.
        """
        if not self._compiled.border:
            return 0.0
        zero, u = np.zeros(self.layout.size), slice(self.layout.num_displacement)
        ends = [self.border.add_vector(zero, c, absolute=False) for c in (zero, coefficients)]
        return -self.layout.dot(self.layout.sum((ends[0] + ends[1]) / 2)[u], coefficients[u])

    def _no_border(self) -> InputError:
        names = sorted({name for term in self._compiled.border for name in term.on or ()})
        parts = f" with the parts {quoted(names)}" if names else ""
        return InputError(
            f"form {self._compiled.form.name} has sums over the border, sum_b(...), and the body has no "
            f"border: expected a body with a border{parts}, as tawami.box(...) gives it"
        )

    def penalty(self, data: Mapping[Rule, Array]) -> sp.csr_matrix | None:
        """This rank's part of the ghost penalty, on all coefficients; None without one."""
        return self._ghost.on_all(data)

    def integrate_with(self, volume: Array) -> None:
        """Replace the volumes of this rank's particles in all sums of the form."""
        self.attachment.volume = volume

    def follow(self, earlier: Assembly) -> None:  # noqa: B027 (by default there is nothing to use)
        """Use what an earlier assembly made for its matrix, if the cells and unknowns are the same.

        Args:
            earlier: An assembly of the same form on the same grid. Its tangents are no longer valid
                after the next tangent of this one.
        """

    def unreduced_tangent(self, coefficients: Array, data: Mapping[Rule, Array]) -> sp.csr_matrix:
        """E^T K E, the tangent of :meth:`residual`, on all coefficients of the whole grid.

        The matrix of the steps, whose factorisation the next one may use, stays as it is.
        """
        everything, comm, layout = Reduction.of_all(self.layout), self.layout.grid.comm, self.layout
        apart = type(self)(self.attachment)
        apart._border = self._border
        mine = rows_of(apart.tangent(coefficients, data, everything)).tocoo()
        rows, columns, values = (
            ranks.allgathered(comm, part)
            for part in (mine.row + everything.own.start, mine.col, mine.data)
        )
        unknowns = ranks.allgathered(comm, layout.in_grid[everything.coefficients])
        shape = (layout.size_of_grid, layout.size_of_grid)
        return sp.csr_matrix((values, (unknowns[rows], unknowns[columns])), shape=shape)
