"""Points of a border that move with the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import stored
from tawami.base.arrays import Array, Mask
from tawami.base.space import Space
from tawami.border.points import BorderPoints, transformed
from tawami.field.border import BorderInCells
from tawami.grid.grid import ON_LINE, Edge, Grid
from tawami.scene.domain import Domain


class MovingPoints:
    """Points of a border that move with the body.

    Args:
        points: The points at the start.
        grid: The grid.
        what: Name of the part, for messages.

    Attributes:
        what: As given.
        x: Positions [m], points x dim.
        area: Outward normals times lengths in the plane of the grid [m], points x dim.
        reference: Weights when they were made [m2 per metre depth], which dead loads refer to.
        first: The points when they were made.
        number: Number among these of each point that is left.
    """

    def __init__(self, points: BorderPoints, grid: Grid, what: str = "border") -> None:
        self.first, self._grid, self.what = points, grid, what
        self.number = np.arange(len(points))
        self.x = np.array(points.x)
        self.area = points.length[:, None] * points.normal
        self.reference = self.weight
        self._located: tuple[Domain, BorderInCells] | None = None

    def __len__(self) -> int:
        return len(self.x)

    @property
    def made(self) -> BorderPoints:
        """The points that are left as they were when they were made."""
        return self.first[self.number]

    @property
    def space(self) -> Space:
        """The space of the grid."""
        return self._grid.space

    @property
    def length(self) -> Array:
        """Length of the border that each point integrates over [m], in the plane."""
        return np.asarray(np.linalg.norm(self.area, axis=1))

    @property
    def weight(self) -> Array:
        """Area that each point integrates over [m2 per metre depth], in axisymmetry [m2]."""
        return np.asarray(self.length * self.space.thickness(self.x))

    @property
    def normal(self) -> Array:
        """Outward unit normals, points x dim."""
        return np.asarray(self.area / self.length[:, None])

    @property
    def now(self) -> BorderPoints:
        """The points as they are, with distances along the stretched chains."""
        length, made = self.length, self.made
        order = np.lexsort((made.along, made.chain))
        along, chain = np.empty(len(self)), made.chain[order]
        ends = np.cumsum(length[order])
        first = np.searchsorted(chain, chain)
        along[order] = ends - length[order] / 2 - (ends - length[order])[first]
        return replace(made, x=self.x, length=length, normal=self.normal, along=along)

    def cells(self, domain: Domain) -> BorderInCells:
        """The points in the cells of a domain.

        Raises:
            SupportError: A point has no particles near it.
        """
        if self._located is None or self._located[0] is not domain:
            made = BorderInCells(self._grid, domain.active, self.x, self.normal, self.what)
            self._located = domain, made
        return self._located[1]

    def edge(self, edge: Edge, tolerance: float = ON_LINE) -> Mask:
        """Mask of the points on an edge of the grid, or beyond it.

        Args:
            edge: Name of the edge.
            tolerance: Distance that is ignored [cells].
        """
        return np.asarray(self._grid.inwards(edge, self.x) <= tolerance * self._grid.h)

    def remains(self, before: Domain, after: Domain) -> Mask:
        """Mask of the points whose cells still hold particles after some were removed."""
        return np.asarray(after.active.ravel()[self.cells(before).location.cell])

    def keep(self, kept: Mask) -> None:
        """Keep some of the points."""
        self.x, self.area, self.reference = self.x[kept], self.area[kept], self.reference[kept]
        self.number, self._located = self.number[kept], None

    def state(self) -> dict[str, Any]:
        """Positions and areas, for a checkpoint."""
        return {
            "x": self.x, "area": self.area, "reference": self.reference, "number": self.number
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: It was made with other points.
        """
        what, n = f"{self.what}: points of the border", len(self.first)
        number = stored.some_of(what, state["number"], n)
        shape = (len(number), self.space.dim)
        x, area = (stored.values(f"{what}: {name}", state[name], shape) for name in ("x", "area"))
        reference = stored.values(f"{what}: reference", state["reference"], shape[:1])
        self.x, self.area, self.reference, self.number = x, area, reference, number
        self._located = None


def moved(
    all_points: Sequence[MovingPoints], domain: Domain, u: Array
) -> list[tuple[Array, Array]]:
    """Positions and areas of points after a step.

    Points without particles near them, as after a body broke, stay where they are; loads and supports
    on them raise an error.

    Args:
        all_points: The points of several parts.
        domain: The particles at its start.
        u: Increments of the displacement, functions x dim.
    """
    if not all_points:
        return []
    grid, basis, space = domain.model.grid, domain.layout.basis, domain.model.space
    x, area = (
        np.concatenate(arrays) for arrays in zip(*((p.x, p.area) for p in all_points), strict=True)
    )
    normal = area / np.linalg.norm(area, axis=1)[:, None]
    cells = BorderInCells(grid, domain.active, x, normal, torn=True)
    location, near = cells.location, ~cells.lost
    flat = np.ascontiguousarray(u).ravel()
    gradient = space.in_space(space.gradients(_rust.gradients(location, basis, flat)))
    f = gradient + np.eye(space.dim)
    x, area = x.copy(), area.copy()
    x[near] += _rust.interpolate(location, basis, space.dim, flat)[near]
    area[near] = transformed(area[near], f[near])
    ends = np.cumsum([len(p) for p in all_points])[:-1]
    return list(zip(np.split(x, ends), np.split(area, ends), strict=True))
