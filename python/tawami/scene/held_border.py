"""Supports off the lines of the grid: means over patches of the border are held by tractions.

The tractions are multipliers of an augmented Lagrangian. They need no stress at the border, so that they
serve for all laws, forms and strain measures, and each pass leaves about a hundredth of the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Mask, of_components
from tawami.border.patches import patches
from tawami.border.tied import Tied, means
from tawami.field.constraints import PointHeld
from tawami.scene.domain import Domain
from tawami.scene.moving_points import MovingPoints
from tawami.scene.support import Support

#: Penalty of a patch per cell, in shear moduli (besides K), or in diagonal entries of the tangent.
PENALTY = 200.0
#: Change of the tractions by a pass, relative to the largest, below which no other is needed.
SETTLED = 1e-4
#: Share of the error that a pass may leave, factor of the penalty if it leaves more, and largest factor.
SLOW, STIFFER, STIFFEST = 0.3, 10.0, 1e4
#: Error of a held displacement that is round-off, relative to the displacement.
ALIKE = 1e-6
#: Displacement that is round-off [cells].
ROUND_OFF_OF_GRID = 1e-13


class HeldBorder:
    """A support on points of the border, in one step (`tawami.solve.terms`).

    Args:
        domain: The particles at its start.
        support: The support.
        values: Prescribed values at its points at the end of the step, counted as `before`: all of
            those at small strain, the increments where particles move.
        before: Coefficients of the whole grid at the start, which the values include.
        chosen: Mask of the points that it holds; by default all that it holds by tractions.
    """

    smooth, implicit = True, False

    def __init__(
        self,
        domain: Domain,
        support: Support,
        values: Array,
        before: Array,
        chosen: Mask | None = None,
    ) -> None:
        assert isinstance(support.place, MovingPoints)
        self._support, self._domain = support, domain
        self._weak = weak = np.flatnonzero(support.weak if chosen is None else chosen)
        place, fields, h = support.place, domain.layout.of_grid, domain.model.grid.h
        field = fields[str(support.component)] if support.is_field else next(iter(fields.values()))
        cells = place.cells(domain)
        numbers, functions, _ = cells.tabulated(field.basis)
        #: Functions at the points, and their coefficients, points x functions x components.
        self._functions = functions[weak]
        self._places = field.start + of_components(numbers[weak], field.components)
        directions = np.ones((len(place), 1)) if support.is_field else support.directions
        self._directions, self._weights = directions[weak], place.weight[weak]
        self._groups = patches(place.now[weak], h)
        along = (self._functions[:, :, None] * self._directions[:, None]).reshape(len(weak), -1)
        #: Mean of the held component over each patch, of all coefficients: patches x coefficients.
        self.means = means(
            self._groups, self._weights, along, self._places.reshape(len(weak), -1), len(before)
        )
        #: Prescribed values at its points, and their means over the patches.
        self.values = (values + support.missing)[weak]
        self._given, self._target = values[weak], self._mean(self.values)
        self.prescribed = float(np.abs(self.values).max(initial=0.0))
        self._before, self._held = before, self._mean(support.held[weak])
        self._largest, self._stiffened = np.inf, 1.0
        K, mu = domain.moduli_at(cells)
        self._elastic = (K + PENALTY * mu)[weak]
        self._tied = self._with_penalty(self._elastic)

    def _mean(self, values: Array) -> Array:
        """Means over the patches."""
        return self._groups.means(self._weights, values)

    @property
    def x(self) -> Array:
        """Positions of its points [m], points x dim."""
        assert isinstance(self._support.place, MovingPoints)
        return np.asarray(self._support.place.x[self._weak])

    @property
    def length(self) -> Array:
        """Length of the border at each of its points [m]."""
        assert isinstance(self._support.place, MovingPoints)
        return np.asarray(self._support.place.length[self._weak])

    @property
    def support(self) -> Support:
        """The support."""
        return self._support

    def _with_penalty(self, penalty: Array) -> Tied:
        """Ties with a penalty, given at each point [Pa]."""
        areas, h = self._groups.sums(self._weights), self._domain.model.grid.h
        return Tied(self.means, areas, self._mean(penalty) / h)

    def begin(self, diagonal: Callable[[], Array], inertia: Array | None) -> None:
        """See `Term`. The penalty of a field has the size of its tangent, and in dynamics that of a
        displacement contains inertia.
        """
        if self._support.is_field:
            self._tied = self._with_penalty(PENALTY * self._near(diagonal()))
        elif inertia is not None:
            self._tied = self._with_penalty(self._elastic + PENALTY * self._near(inertia))

    def _near(self, diagonal: Array) -> Array:
        """Stiffness that the diagonal of a matrix stands for at each point [Pa]."""
        assert isinstance(self._support.place, MovingPoints)
        h, dim = self._domain.model.grid.h, self._domain.model.space.dim
        thickness = (self._support.place.weight / self._support.place.length)[self._weak]
        near = np.einsum("pf,pf->p", np.abs(self._functions), diagonal[self._places[..., 0]])
        return np.asarray(near / thickness / h ** (dim - 2))

    def forces(self, coefficients: Array) -> Array:
        """See `Term`."""
        self._last = self._before + coefficients
        self._error = self.means @ self._last - self._target
        self._tractions = self._tied.multipliers(self._error, self._held)
        self.on_body = self._tied.forces(self._tractions)
        return self.on_body

    def stiffness(self) -> sp.csr_matrix:
        """See `Term`; the same object until the penalty changes."""
        return self._tied.stiffness

    def improve(self) -> bool:
        """See `Term`."""
        change = np.abs(self._tractions - self._held).max(initial=0.0)
        self._held = self._tractions
        u = np.einsum("pf,pfi->pi", self._functions, self._last[self._places])
        size = max(self.prescribed, float(np.abs(u).max(initial=0.0)))
        error, before = np.abs(self._error).max(initial=0.0), self._largest
        if error > SLOW * before and self._stiffened < STIFFEST:
            self._stiffened *= STIFFER
            self._tied = replace(self._tied, penalty=STIFFER * self._tied.penalty)
        self._largest = error
        least = 0.0 if self._support.is_field else ROUND_OFF_OF_GRID * self._domain.model.grid.h
        noise = error <= max(ALIKE * size, least)
        return bool(change > SETTLED * np.abs(self._held).max(initial=0.0) and not noise)

    @property
    def unsettled(self) -> str:
        """See `Term`."""
        error, support = np.abs(self._error).max(), self._support
        return (
            f"{support}: its part of the border stays {error:.3g} {support.unit} away from the "
            f"prescribed values of '{support.axis}': other supports hold it, or the body cannot deform "
            "like this: expected supports that agree; change or release one"
        )

    def accept(self) -> None:
        """Keep the tractions, and what is missing of the prescribed displacement, for later steps."""
        support, number = self._support, self._groups.number
        support.held[self._weak] = self._tractions[number]
        if self._domain.model.moves:
            support.missing[self._weak] = -self._error[number]

    @property
    def resultants(self) -> dict[str, Array]:
        """Force on the body at each part of the border that the support covers [N per metre depth]."""
        assert isinstance(self._support.place, MovingPoints)
        made, resultant = self._support.place.made, self._domain.model.space.resultant
        tractions = -(self._weights * self._tractions[self._groups.number])[:, None]
        on_points = tractions * self._directions
        tags = made.tag[self._weak]
        return {
            made.names[tag]: resultant(on_points[tags == tag].sum(axis=0))
            for tag in np.unique(tags)
        }

    @property
    def prescribed_means(self) -> Array:
        """Mean of the prescribed values over each patch."""
        return self._mean(self._given)

    @property
    def rows(self) -> list[PointHeld]:
        """The means of the patches as multi-point constraints, to find rigid motions."""
        if self._support.is_field:
            return []
        first = np.unique(self._groups.number, return_index=True)[1]
        parts = np.split(np.arange(self.means.nnz), self.means.indptr[1:-1])
        return [
            PointHeld(
                self.means.indices[mine].astype(np.int64),
                self.means.data[mine],
                0.0,
                f"{self._support}",
                (float(x[0]), float(x[1])),
            )
            for mine, x in zip(parts, self.x[first], strict=True)
        ]
