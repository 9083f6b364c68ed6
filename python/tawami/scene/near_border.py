"""Points of the border near an obstacle, in the cells of a grid, in one step."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Indices, Mask, of_components
from tawami.border.patches import Patches, patches
from tawami.border.rigid import Pose
from tawami.border.shapes import Shape
from tawami.scene.domain import Domain
from tawami.scene.held_border import PENALTY
from tawami.scene.moving_points import MovingPoints

#: Lengths of patches that stay, unless they were made so [cells].
SHORTEST, LONGEST = 0.7, 2.2


class BorderNear:
    """Patches of a part of the border, of which those near an obstacle are evaluated.

    Args:
        domain: The particles at the start of the step.
        place: The part.
        shape: Shape of the obstacle.
        pose: Pose of the obstacle at the start.
        before: Displacement coefficients since the start where particles do not move, else 0.
        groups: Patches of the last step, which stay while they have about the size of a cell: other
            patches would have other distances.

    Attributes:
        h: Side of a cell [m].
        n, size: Number of coefficients of the displacement, and of all fields.
        x: Positions of all points at the start [m], points x dim.
        start: The same in the frame of the obstacle.
        distance: Their distances from it [m].
        groups: Patches of all points.
        weights: Area of each point [m2 per metre depth].
        penalty: Of each patch [Pa/m].
        chosen: Which patches are evaluated.
        points: Numbers of their points.
        patches: The same patches of these points.
        at_points: Displacements of these points, from the coefficients of the displacement.
    """

    chosen: Mask
    points: Indices
    patches: Patches
    at_points: sp.csr_matrix

    def __init__(
        self,
        domain: Domain,
        place: MovingPoints,
        shape: Shape,
        pose: Pose,
        before: Array,
        groups: Patches | None = None,
    ) -> None:
        self.h, self._dim = domain.model.grid.h, domain.model.space.dim
        self.n, self.size = domain.layout.num_displacement, domain.layout.size
        cells = place.cells(domain)
        functions = cells.values(domain.layout.basis)
        self._at_all = sp.kron(functions, sp.identity(self._dim), format="csr")
        self.x = place.x
        self.x = self.positions(before)
        self.start = pose.to_local(self.x)
        self.groups = self._grouped(place, groups)
        weight = place.weight
        self.weights = np.maximum(weight, 1e-12 * weight.max())  # 0 on an axis of symmetry
        shear = domain.moduli_of_cells[1][cells.location.cell]
        self.penalty = PENALTY / self.h * self.groups.means(self.weights, shear)
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
        """Positions of all points at increments of the displacement [m]."""
        moved = self._at_all @ coefficients[: self.n]
        return np.asarray(self.x + moved.reshape(-1, self._dim))

    def choose(self, points: Mask) -> None:
        """Evaluate the patches of further points from now on."""
        number = self.groups.number
        self.chosen[number[points]] = True
        self.points = np.flatnonzero(self.chosen[number])
        new_number = np.cumsum(self.chosen) - 1
        self.patches = Patches(new_number[number[self.points]], int(self.chosen.sum()))
        rows = of_components(self.points, self._dim)
        self.at_points = self._at_all[rows.ravel()]
        incidence = self.patches.incidence
        together = (incidence.T @ incidence).astype(float)
        of_points = sp.kron(together, np.ones((self._dim, self._dim)), format="csr")
        touched = abs(self.at_points)
        #: Where a stiffness may have entries.
        self._places = (touched.T @ of_points @ touched).tocoo()

    def reached(self, local: Array) -> Mask:
        """Points of other patches that may have come to the obstacle since the start of the step.

        Args:
            local: Present positions in the frame of the obstacle.
        """
        moved = np.linalg.norm(local - self.start, axis=1)
        return np.asarray((self.distance <= moved) & ~self.chosen[self.groups.number])

    def on_all(self, forces: Array) -> Array:
        """Forces on the chosen points as forces on all coefficients."""
        on_all = np.zeros(self.size)
        on_all[: self.n] = self.at_points.T @ forces.ravel()
        return on_all

    def on_coefficients(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """A matrix on the chosen points as one on all coefficients.

        Its entries are in the same places until further points are chosen.
        """
        reduced, places = (self.at_points.T @ matrix @ self.at_points).tocoo(), self._places
        data = np.concatenate([reduced.data, np.zeros(places.nnz)])
        rows = np.concatenate([reduced.row, places.row])
        columns = np.concatenate([reduced.col, places.col])
        return sp.coo_matrix((data, (rows, columns)), shape=(self.size, self.size)).tocsr()
