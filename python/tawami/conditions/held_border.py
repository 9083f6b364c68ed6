"""Supports off the lines of the grid: means over patches of the border are held by tractions.

On a patch of area A, whose points have the weights w and the held directions d:

    error    e = mean of d . u - g
    forces   f = -w lambda d on each point, so that on all coefficients f = -(A de/dc)^T lambda

The tractions lambda are unknowns of the linear systems (`tawami.solve.saddle`): the errors vanish in one
iteration. They need no stress at the border, so that they serve for all laws, forms and strain measures.
"""

from __future__ import annotations

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask, of_components
from tawami.base.errors import SupportWarning
from tawami.base.rows import Rows
from tawami.base.warn import warn
from tawami.border.patches import patches
from tawami.border.tied import means
from tawami.conditions.support import Support
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints
from tawami.field.border import BorderInCells
from tawami.field.coefficients import Place
from tawami.field.constraints import PointHeld

#: Error of a held displacement that is round-off, relative to the largest displacement, and [cells].
ALIKE, ROUND_OFF = 1e-10, 1e-13
#: Distance of a point from the place that the mean of its patch prescribes, above which the body does
#: not follow its border [cells].
BENT = 0.2


class HeldBorder:
    """A support on points of the border, in one step (`tawami.solve.terms`, `tawami.solve.bordered`).

    Args:
        domain: The particles at its start.
        support: The support.
        values: Prescribed values at its points at the end of the step, counted as `before`: all of
            those at small strain, the increments where particles move.
        before: Coefficients at the start, which the values include.
        chosen: Mask of the points that it holds; by default all that it holds by tractions.
    """

    first_work = 0.0

    def __init__(
        self,
        domain: Domain,
        support: Support,
        values: Array,
        before: Array,
        chosen: Mask | None = None,
    ) -> None:
        assert isinstance(support.place, MovingPoints)
        #: The support.
        self.support = support
        self._place, self._domain, self._layout = support.place, domain, domain.layout
        self._weak = weak = np.flatnonzero(support.weak if chosen is None else chosen)
        place, layout, h = self._place, domain.layout, domain.model.grid.h
        fields = layout.fields
        field = fields[str(support.component)] if support.is_field else next(iter(fields.values()))
        self._field = slice(field.start, field.stop)
        self._directions, self._weights = support.directions(place.normal)[weak], place.weight[weak]
        self._groups = patches(place.now[weak], h)
        #: Mean of the held component over each patch, of the coefficients of this rank: patches x
        #: coefficients of the window.
        self.means = layout.by_owner(self._means(place.cells(domain), field, layout.size))
        #: Prescribed values at its points, and their means over the patches.
        self.values = values[weak]
        self.prescribed_means = self._groups.means(self._weights, self.values)
        self.prescribed = float(np.abs(self.values).max(initial=0.0))
        areas = self._groups.sums(self._weights)
        #: Derivative of the residual by the coefficients of this rank.
        self.gradient = self.means.rows_scaled(areas)
        self._areas, self._before = areas, before
        self._check_bent()
        self._change = np.zeros(len(areas))
        self._tractions = self._held = self._groups.means(self._weights, support.held[weak])

    def _means(self, cells: BorderInCells, field: Place, size: int) -> Rows:
        """The part of this rank's points in the means."""
        mine = cells.own[self._weak]
        some = np.flatnonzero(mine)
        at = np.searchsorted(np.flatnonzero(cells.own), self._weak[mine])
        numbers, functions, _ = cells.of_rank.tabulated(field.basis)
        #: Coefficients of the functions at these points.
        self._places = field.start + of_components(numbers[at], field.components)
        along = functions[at][:, :, None] * self._directions[mine][:, None]
        shape = (len(some), along.shape[1] * along.shape[2])
        of_points = along.reshape(shape), self._places.reshape(shape)
        return means(self._groups, self._weights, some, *of_points, size)

    def _check_bent(self) -> None:
        """Warn, once, of a border whose points have moved far from the means of their patches."""
        support, place = self.support, self._place
        if support.told or not isinstance(support.component, int) or not support.is_uniform:
            return
        moved = (place.x - place.made.x)[self._weak, support.component]
        means = self._groups.means(self._weights, moved)
        h = self._domain.model.grid.h
        bent = float(np.abs(moved - means[self._groups.number]).max(initial=0.0)) / h
        if bent <= BENT:
            return
        support.told = True
        if self._domain.model.grid.comm.rank == 0:
            warn(
                f"{support}: the border bends by {bent:.2g} h within its patches, because the particles "
                "near it leave functions of the grid with little stiffness; the body does not follow "
                "the support there. Expected more particles per cell (per_axis=...), volumes='fitted' "
                "and ghost_penalty='on'",
                SupportWarning,
            )

    @property
    def x(self) -> Array:
        """Positions of its points [m], points x dim."""
        return np.asarray(self._place.x[self._weak])

    @property
    def length(self) -> Array:
        """Length of the border at each of its points [m]."""
        return np.asarray(self._place.length[self._weak])

    def forces(self, coefficients: Array) -> Array:
        """See `Term`."""
        self._last = self._before + coefficients
        means = ranks.sum_of(self._layout.grid.comm, self.means.times(self._last))
        self._error = means - self.prescribed_means
        #: The part of this rank in the forces on the body.
        self.on_body = -self.gradient.transposed_times(self._tractions)
        return self.on_body

    def stiffness(self, far: Indices) -> None:
        """See `Term`: the forces do not depend on the displacement."""

    # -- the tractions as unknowns, see `tawami.solve.bordered` ---------------

    @property
    def num_unknowns(self) -> int:
        """Number of patches."""
        return self._groups.count

    @property
    def residual(self) -> Array:
        """Errors times areas."""
        return np.asarray(self._areas * self._error)

    @property
    def measure(self) -> float:
        """Largest error, relative to the displacement of the functions that reach the border; a call for
        all ranks.
        """
        error, largest = float(np.abs(self._error).max(initial=0.0)), self._layout.largest
        least = 0.0 if self.support.is_field else ROUND_OFF * self._domain.model.grid.h
        if error <= max(ALIKE * largest(self._last[self._field]), least):
            return 0.0
        return error / max(self.prescribed, largest(self._last[self._places]))

    def restart(self) -> None:
        """Go back to the tractions of the last step."""
        self._tractions = self._held

    def add(self, change: Array) -> None:
        """Go to the next iterate of the tractions."""
        self.first_work = -float(change @ self.residual)
        self._begun, self._change = self._tractions, change
        self._tractions = self._begun + change

    def shorten(self, share: float) -> None:
        """Take a share of the last change of the tractions."""
        self._tractions = self._begun + share * self._change

    @property
    def work(self) -> float:
        """Work of the errors on the last change; the energy is largest in the tractions."""
        return -float(self._change @ self.residual)

    @property
    def unsettled(self) -> str:
        """See `Tie`."""
        error, support = np.abs(self._error).max(), self.support
        return (
            f"{support}: its part of the border stays {error:.3g} {support.unit} away from the "
            f"prescribed values of '{support.axis}': other supports hold it, or the body cannot deform "
            "like this: expected supports that agree; change or release one"
        )

    def accept(self) -> None:
        """Keep the tractions for later steps."""
        self.support.held[self._weak] = self._tractions[self._groups.number]

    @property
    def resultants(self) -> dict[str, Array]:
        """Force on the body at each part of the border that the support covers [N per metre depth]."""
        made, resultant = self._place.made, self._domain.model.space.resultant
        tractions = -(self._weights * self._tractions[self._groups.number])[:, None]
        on_points = tractions * self._directions
        tags = made.tag[self._weak]
        return {
            made.names[tag]: resultant(on_points[tags == tag].sum(axis=0))
            for tag in np.unique(tags)
        }

    @property
    def rows(self) -> list[PointHeld]:
        """The means of the patches as multi-point constraints, to find rigid motions; a call for all
        ranks.
        """
        if self.support.is_field:
            return []
        first = np.unique(self._groups.number, return_index=True)[1]
        means = self._layout.gathered(self.means)
        ends = np.searchsorted(means.row, np.arange(1, self.num_unknowns))
        parts = np.split(np.arange(len(means.row)), ends)
        return [
            PointHeld(
                means.column[mine],
                means.values[mine],
                0.0,
                f"{self.support}",
                (float(x[0]), float(x[1])),
            )
            for mine, x in zip(parts, self.x[first], strict=True)
        ]
