"""The border of a body at the end of a step, for pictures and files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami.base.arrays import Array
from tawami.border.curves import left
from tawami.field.border import BorderInCells
from tawami.scene.domain import Domain
from tawami.scene.moving_points import MovingPoints

#: Ends of the side of a point, in units of its length.
ENDS = np.array([-0.5, 0.5])


class Outline:
    """The border of a body as it is now: one side for each of its points, as long as the point counts.

    Making it is a call for all ranks.

    Args:
        points: All points of the border.
        domain: The particles at the end of the step.
        u: Coefficients of the displacement in the whole grid since the start, where particles do not
            move.

    Attributes:
        x: Positions of the points, at small strain those at the start [m].
        area: Outward normals times lengths there [m].
        part: Number of the part of the border of each point.
    """

    def __init__(self, points: MovingPoints, domain: Domain, u: Array) -> None:
        self._made, self.x, self.area = points.made, points.x, points.area
        self.part = self._made.tag
        #: The points in the cells, and the displacement, where particles do not move.
        self._static: tuple[BorderInCells, Array] | None = None
        if not domain.model.moves:
            cells = BorderInCells(domain.model.grid, domain.active, self.x, self._made.normal)
            self._static = cells, u.reshape(-1, domain.model.space.dim)
        self._basis = domain.layout.basis

    def sides(self, deformed: float = 1.0) -> Array:
        """Ends of the sides with enlarged displacements [m], points x 2 x dim.

        Args:
            deformed: Factor on the displacements.
        """
        start = _sides(self._made.x, self._made.length[:, None] * self._made.normal)
        return start + deformed * self._displacements(start)

    def displacements(self) -> Array:
        """Displacements of the ends of the sides since the start [m], points x 2 x dim."""
        start = _sides(self._made.x, self._made.length[:, None] * self._made.normal)
        return self._displacements(start)

    def _displacements(self, start: Array) -> Array:
        if self._static is None:
            return _sides(self.x, self.area) - start
        (cells, u), basis = self._static, self._basis
        gradient = np.stack([slope @ u for slope in cells.slopes(basis)], axis=2)
        offset = np.einsum("nij,nkj->nki", gradient, start - self.x[:, None])
        return np.asarray((cells.values(basis) @ u)[:, None] + offset)

    def tractions(self, acting: Sequence[tuple[MovingPoints, Array]]) -> Array:
        """Sum of tractions of loads and supports at the points [Pa], points x dim.

        Args:
            acting: Points of each load or support, and its tractions there, points x dim.
        """
        total = np.zeros_like(self.x)
        if acting:
            from scipy.spatial import KDTree  # takes long to import
        apart = 2 * np.ptp(self.x)  # parts do not meet at their corners
        for points, tractions in acting:
            tree = KDTree(np.column_stack([points.x, apart * points.made.tag]))
            distance, nearest = tree.query(np.column_stack([self.x, apart * self.part]))
            near = distance <= points.length[nearest] / 2
            total[near] += tractions[nearest[near]]
        return total


def _sides(x: Array, area: Array) -> Array:
    """Straight sides through points, across their normals, points x 2 x dim."""
    return np.asarray(x[:, None] + ENDS[:, None] * left(area)[:, None])
