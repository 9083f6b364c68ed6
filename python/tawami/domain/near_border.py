"""Points of the border near an obstacle, in the cells of a grid, in one step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Indices, Mask, of_components, sums_at
from tawami.base.places import Places
from tawami.base.rows import Rows
from tawami.border.patches import Patches, patches
from tawami.border.rigid import Pose
from tawami.border.shapes import Shape
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints

#: Penalty of a patch per cell, in shear moduli, and in inertias of a cell. Without inertia, short steps
#: need many passes. With more of it, the round-off of positions is a force in small impacts.
PENALTY, INERTIA = 200.0, 20.0
#: Lengths of patches that stay, unless they were made so [cells].
SHORTEST, LONGEST = 0.7, 2.2


class BorderNear:
    """Patches of a part of the border, of which those near an obstacle are evaluated.

    Each rank evaluates functions of the grid at the points in its cells. A patch may have points in
    cells of several ranks: one of them has its stiffness.

    Args:
        domain: The particles at the start of the step.
        place: The part.
        shape: Shape of the obstacle.
        pose: Pose of the obstacle at the start.
        before: Displacement coefficients since the start where particles do not move, else 0.
        slope: Derivative of the accelerations by the displacements, over the factor of contact forces
            [1/s2]; 0 in statics.
        groups: Patches of the last step, which stay while they have about the size of a cell: other
            patches would have other distances.

    Attributes:
        h: Side of a cell [m].
        n, size: Number of coefficients of the displacement in the window, and of all fields.
        x: Positions of all points at the start [m], points x dim.
        start: The same in the frame of the obstacle.
        distance: Their distances from it [m].
        groups: Patches of all points.
        weights: Area of each point [m2 per metre depth].
        penalty: Of each patch [Pa/m].
        chosen: Which patches are evaluated.
        points: Numbers of their points.
        patches: The same patches of these points.
        mine: Mask of those whose stiffness this rank adds.
        far: Numbers in the whole grid of coefficients that they couple, and that have no place in the
            window.
    """

    chosen: Mask
    points: Indices
    patches: Patches
    mine: Mask
    far: Indices

    def __init__(
        self,
        domain: Domain,
        place: MovingPoints,
        shape: Shape,
        pose: Pose,
        before: Array,
        slope: float,
        groups: Patches | None = None,
    ) -> None:
        self.h, self._dim = domain.model.grid.h, domain.model.space.dim
        self._layout = layout = domain.layout
        self.n, self.size = layout.num_displacement, layout.size
        self._cells = cells = place.cells(domain)
        #: Points of this rank, and functions at them.
        self._own = np.flatnonzero(cells.own)
        self._numbers, self._values, _ = cells.of_rank.tabulated(layout.basis)
        self.x = place.x
        self.x = self.positions(before)
        self.start = pose.to_local(self.x)
        self.groups = self._grouped(place, groups)
        weight = place.weight
        self.weights = np.maximum(weight, 1e-12 * weight.max())  # 0 on an axis of symmetry
        mu, rho = domain.means_at(cells)
        resistance = PENALTY * mu / self.h + INERTIA * rho * self.h * slope
        penalty = self.groups.means(self.weights, resistance)
        # no particle is near a patch that its body has lost
        self.penalty = np.maximum(penalty, np.finfo(float).tiny)
        self.distance = shape.evaluate(self.start).distance
        self.chosen = np.zeros(self.groups.count, dtype=bool)

    def _grouped(self, place: MovingPoints, groups: Patches | None) -> Patches:
        """Patches of all points."""
        if groups is not None:
            length = groups.sums(place.length) / self.h
            made = groups.sums(place.made.length) / self.h
            least, most = np.minimum(SHORTEST, made), np.maximum(LONGEST, made)
            if ((length >= least) & (length <= most)).all():
                return groups
        return patches(place.now, self.h)

    def positions(self, coefficients: Array) -> Array:
        """Positions of all points at increments of the displacement [m]; a call for all ranks."""
        u = coefficients[: self.n].reshape(-1, self._dim)[self._numbers]
        return np.asarray(self.x + self._cells.on_all(np.matmul(self._values[:, None], u)[:, 0]))

    def choose(self, points: Mask) -> None:
        """Evaluate the patches of further points from now on."""
        number = self.groups.number
        self.chosen[number[points]] = True
        self.points = np.flatnonzero(self.chosen[number])
        new_number = np.cumsum(self.chosen) - 1
        self.patches = Patches(new_number[number[self.points]], int(self.chosen.sum()))
        #: Those of this rank among the chosen points.
        self._here = np.flatnonzero(self._cells.own[self.points])
        at = np.searchsorted(self._own, self.points[self._here])
        self._places = of_components(self._numbers[at], self._dim)
        self._of_points = self._values[at][..., None]
        self._couple()

    def _couple(self) -> None:
        """Find the functions that the patches of this rank couple."""
        points, inside = self.patches.table
        self.mine = self._cells.own[self.points[points[:, :1]]].any(axis=1)
        used, at = np.unique(points[self.mine], return_inverse=True)
        basis, window = self._layout.basis, self._layout.window
        of = self._cells.functions(basis, self.points[used])
        self._coupled = _Coupled(*of, at.reshape(points[self.mine].shape), inside[self.mine])
        place = window.functions(basis, self._coupled.numbers)
        known = (place >= 0) & window.has_support(basis)[place]
        in_grid, in_window = (of_components(of, self._dim) for of in (self._coupled.numbers, place))
        #: Numbers of the coefficients in the whole grid, and places of those that are known here.
        self._in_grid, self._in_window = in_grid, np.where(known[:, None], in_window, -1)
        self.far = in_grid[~known].ravel()

    @property
    def at_points(self) -> Rows:
        """Displacements of the chosen points, from the coefficients of the displacement: those of this
        rank's points.
        """
        rows = self._dim * self._here[:, None, None] + np.arange(self._dim)
        places = np.broadcast_arrays(rows, self._places)
        values = np.broadcast_to(self._of_points, self._places.shape)
        shape = (self._dim * len(self.points), self.size)
        return Rows.of(places[0].ravel(), places[1].ravel(), values.ravel(), shape)

    def reached(self, local: Array) -> Mask:
        """Points of other patches that may have come to the obstacle since the start of the step.

        Args:
            local: Present positions in the frame of the obstacle.
        """
        moved = np.linalg.norm(local - self.start, axis=1)
        return np.asarray((self.distance <= moved) & ~self.chosen[self.groups.number])

    @property
    def at_points_on_all(self) -> tuple[Rows, Indices]:
        """The same of all ranks, and the numbers of its columns in the whole grid; a call for all
        ranks.
        """
        found = self._layout.gathered(self.at_points)
        numbers, column = np.unique(found.column, return_inverse=True)
        return replace(found, column=column, shape=(found.shape[0], len(numbers))), numbers

    def on_all(self, forces: Array) -> Array:
        """Forces on the chosen points as forces on all coefficients: the part of this rank's points."""
        shares = self._of_points * forces[self._here][:, None]
        return sums_at(self._places.ravel(), shares.ravel(), self.size)

    def on_coefficients(self, derivatives: Array, far: Indices) -> sp.csr_matrix:
        """Derivatives of forces on the chosen points of each patch as a matrix on all coefficients: the
        part of this rank's patches.

        Its entries are in the same places until further points are chosen.

        Args:
            derivatives: As `ContactForces.derivatives`.
            far: As `Term.stiffness`.
        """
        further = self.size + np.searchsorted(far, self._in_grid)
        places = np.where(self._in_window < 0, further, self._in_window)
        return self._coupled.matrix(derivatives[self.mine], places, self.size + len(far))


class _Coupled:
    """The functions of the grid at the points of each patch, which contact couples.

    Args:
        numbers, values: Functions at each point, points x functions.
        points: Points of each patch, patches x points; see `Patches.table`.
        inside: 1 for each of them, 0 for those that fill up.

    Attributes:
        numbers: Numbers of all of these functions.
    """

    def __init__(self, numbers: Indices, values: Array, points: Indices, inside: Array) -> None:
        count = len(points)
        self.numbers, place = np.unique(numbers, return_inverse=True)
        numbers = place.reshape(numbers.shape)
        of_patch = numbers[points].reshape(count, points.shape[1] * numbers.shape[1])
        order = np.argsort(of_patch, axis=1, kind="stable")
        inverse = np.argsort(order, axis=1, kind="stable")
        ranked = np.take_along_axis(of_patch, order, axis=1)
        new = np.diff(ranked, axis=1, prepend=-1) > 0
        local = np.take_along_axis(np.cumsum(new, axis=1) - 1, inverse, axis=1)
        #: Functions that each patch touches, filled up with its first one, patches x functions.
        width = int(local.max(initial=-1)) + 1
        self._functions = np.repeat(ranked[:, :1], width, axis=1)
        patch = np.arange(count)[:, None]
        self._functions[np.broadcast_to(patch, local.shape), local] = of_patch
        #: Values of these at its points, patches x points x functions.
        self._values = np.zeros((*points.shape, width))
        at = local.reshape(*points.shape, numbers.shape[1])
        place = np.arange(points.shape[1])[:, None]
        self._values[patch[..., None], place, at] = values[points] * inside[..., None]
        self._entries: tuple[Indices, Places] | None = None

    def matrix(self, derivatives: Array, places: Indices, size: int) -> sp.csr_matrix:
        """The matrix on all coefficients, of derivatives on the points of each patch.

        Args:
            derivatives: The derivatives.
            places: Coefficients of the functions, functions x dim.
            size: Number of all coefficients.
        """
        values, dim = self._values, derivatives.shape[2]
        count, num, width = values.shape
        if not count:
            return sp.csr_matrix((size, size))
        half = np.matmul(derivatives.transpose(0, 1, 2, 4, 3).reshape(count, -1, num), values)
        half = half.reshape(count, num, -1).transpose(0, 2, 1)
        blocks = np.matmul(half, values).reshape(count, dim, dim, width, width)
        blocks = blocks.transpose(0, 4, 1, 3, 2)
        if self._entries is None or not np.array_equal(self._entries[0], places):
            index = places[self._functions].reshape(count, -1)
            rows, columns = np.broadcast_arrays(index[:, :, None], index[:, None])
            self._entries = places, Places(rows.ravel(), columns.ravel(), (size, size))
        return self._entries[1].matrix(blocks.ravel())
