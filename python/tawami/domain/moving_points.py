"""Points of a border that move with the body."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import stored
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import SupportError
from tawami.base.known import Known
from tawami.base.space import Space
from tawami.border.curves import left, spread
from tawami.border.points import BorderPoints
from tawami.domain import spacing
from tawami.domain.domain import Domain
from tawami.domain.excavation import Excavation
from tawami.field.border import BorderInCells
from tawami.grid.grid import EDGES, ON_LINE, Edge, Grid

#: Length of the border at a point beyond which it is divided [cells]. Gauss points of pieces as long as
#: a cell begin with 0.28 at most, so that this takes a stretch of 1.4.
LONGEST = 0.4
#: Places on the stretch of the border around a point at which the nearest particle is sought.
SAMPLES = 9


class MovingPoints:
    """Points of a border that move with the body.

    Where the body stretches, :meth:`divide` replaces points by several. Sums of areas, of weights of
    dead loads, and of their moments stay.

    Args:
        points: The points at the start.
        grid: The grid.
        what: Name of the part, for messages.
        middle: As the attribute; by default chains are complete.

    Attributes:
        what: As given.
        x: Positions [m], points x dim.
        area: Outward normals times lengths in the plane of the grid [m], points x dim.
        reference: Weights when they were made [m2 per metre depth], which dead loads refer to.
        first: The points when they were made.
        number: Number among these of each point, or of the one that it is a part of.
        made: The points as they were when they were made, with parts of those that were divided.
        middle: Distance along the border from each point to the middle of the stretch that it
            integrates over, when it was made [m].
        touched: Whether they are those of an obstacle, around which the border may fold.
    """

    def __init__(
        self,
        points: BorderPoints,
        grid: Grid,
        what: str = "border",
        middle: Array | None = None,
    ) -> None:
        self.first, self.made, self._grid, self.what = points, points, grid, what
        self.number, self.touched = np.arange(len(points)), False
        self.x = np.array(points.x)
        self.area = points.length[:, None] * points.normal
        self.reference = self.weight
        self.middle = self.now.along - points.along if middle is None else middle
        self._located: tuple[Domain, BorderInCells] | None = None
        #: Masks of points on edges.
        self._on_edges = Known()

    def __len__(self) -> int:
        return len(self.x)

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
    def _tangent(self) -> Array:
        """Unit vectors in the direction of the way around the body, points x dim."""
        return left(self.normal)

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

    def cells(self, domain: Domain, *, torn: bool = False) -> BorderInCells:
        """The points in the cells of a domain.

        Args:
            domain: The domain.
            torn: Whether points may have no particles near them.

        Raises:
            SupportError: A point has no particles near it.
        """
        if self._located is None or self._located[0] is not domain:
            of = domain.model.grid, domain.active, self.x, self.normal, self.what
            try:
                self._located = domain, BorderInCells(*of, torn=torn)
            except SupportError as error:
                told = spacing.outgrown(domain, self.growth(self.area))
                share, distance, growth = spacing.farthest(domain)
                if share:
                    told = (
                        f"the particles are stretched up to {distance:.2g} h apart, {growth:.2g} times "
                        f"as far as at the start. {spacing.advice(domain)}"
                    )
                raise SupportError(f"{error}. Cause: {told}" if told else str(error)) from None
        return self._located[1]

    def edge(self, edge: Edge, tolerance: float = ON_LINE) -> Mask:
        """Mask of the points on an edge of the grid, or beyond it.

        Args:
            edge: Name of the edge.
            tolerance: Distance that is ignored [cells].
        """

        def mask() -> Mask:
            return np.asarray(self._grid.inwards(edge, self.x) <= tolerance * self._grid.h)

        return self._on_edges.of([self.x], (edge, tolerance), mask)

    def gap(self, edge: Edge) -> float:
        """Distance from an edge of the grid [m] that the nearest place on the border has at least.

        Stretches of the border count as straight, along the tangents at their points.
        """
        tangent = self._tangent
        ends = [
            self._grid.inwards(edge, self.x + away[:, None] * tangent)
            for away in (self.stretch - self.length / 2, self.stretch + self.length / 2)
        ]
        return float(np.min(ends))

    @property
    def stretch(self) -> Array:
        """Distance from each point to the middle of the stretch that it integrates over [m]."""
        return np.asarray(self.middle * self.length / self.made.length)

    def remaining(self, excavation: Excavation) -> tuple[Array, Array]:
        """The part of the stretch around each point that remains where particles are removed; a call
        for all ranks.

        Returns:
            Its share of the length, and the distance of its middle from that of the whole, as a share
            of the length.
        """
        shares, length = np.linspace(-0.5, 0.5, SAMPLES), self.length[:, None]
        away = self.stretch[:, None] + shares * length
        of, low, high = excavation.parts(self.x[:, None] + away[..., None] * self._tangent[:, None])
        share, moment = (
            np.bincount(of, part, len(self)).astype(float)
            for part in (high - low, (high**2 - low**2) / 2)
        )
        middle = np.divide(moment, share, out=np.full(len(self), 0.5), where=share > 0)
        return share, middle - 0.5

    def excavate(self, excavation: Excavation) -> Indices:
        """Drop the border where particles are removed; a call for all ranks.

        Points with a part of their stretch move to its middle.

        Returns:
            The places in the arrays of the points that remain.
        """
        share, middle = self.remaining(excavation)
        kept = np.flatnonzero(share)
        part, made = share[kept] < 1, self.made[kept]
        now, start = (
            np.where(part, distance[kept] + middle[kept] * length[kept], 0.0)
            for distance, length in ((self.stretch, self.length), (self.middle, self.made.length))
        )
        self.keep(kept)
        self.x = self.x + now[:, None] * self._tangent
        x = made.x + start[:, None] * left(made.normal)
        thickness = self.space.thickness(x) / self.space.thickness(made.x)
        self.middle = np.where(part, 0.0, self.middle)
        share = share[kept]
        self.area, self.reference = self.area * share[:, None], self.reference * share * thickness
        self.made = replace(made, x=x, length=made.length * share, along=made.along + start)
        return kept

    def keep(self, kept: Indices) -> None:
        """Keep some of the points, given by their places in the arrays."""
        self.x, self.area, self.reference = self.x[kept], self.area[kept], self.reference[kept]
        self.number, self.made, self.middle = self.number[kept], self.made[kept], self.middle[kept]
        self._located = None

    @property
    def is_stretched(self) -> bool:
        """Whether a point is on a longer stretch of the border than `LONGEST`."""
        longest = LONGEST * self._grid.h * (1 + 1e-9)
        return bool(np.einsum("ja,ja->j", self.area, self.area).max(initial=0.0) > longest**2)

    def growth(self, area: Array) -> float:
        """The largest ratio of the length of the border at a point to that when it was made.

        Points on edges of the grid do not count from `spacing.LONGER` on: coefficients are held there.

        Args:
            area: As the attribute, at a time.
        """
        squares = np.einsum("ja,ja->j", area, area) / self.made.length**2
        if squares.max(initial=0.0) > spacing.LONGER**2:
            squares[np.any([self.edge(edge) for edge in EDGES], axis=0)] = 0.0
        return float(np.sqrt(squares.max(initial=0.0)))

    def divide(self) -> Indices:
        """Divide points on longer stretches of the border than `LONGEST` into equal parts.

        The parts lie side by side along the tangent, around the point.

        Returns:
            The point that each one is now, or is a part of.
        """
        length, longest = self.length, LONGEST * self._grid.h
        count = np.ceil(length / longest * (1 - 1e-9)).astype(np.int64)
        of, place = spread(np.maximum(count, 1))
        if len(of) == len(self):
            return of
        count = count[of]
        share = np.where(count > 1, (place + 0.5) / count - 0.5, 0.0) * self._reach[of]
        x = self.x[of] + share[:, None] * left(self.area)[of]
        made = self.made
        start = made.x[of] + share[:, None] * left(made.length[:, None] * made.normal)[of]
        self.keep(of)
        self.x, self.area, self.reference = x, self.area / count[:, None], self.reference / count
        self.made = replace(
            self.made, x=start, length=self.made.length / count,
            along=self.made.along + share * made.length[of],
        )  # fmt: skip
        return of

    @property
    def _reach(self) -> Array:
        """Share of the stretch around each point that does not cross an axis of rotation."""
        if not self.space.hoop:
            return np.ones(len(self))
        half, radius = np.abs(self.area[:, 1]) / 2, np.maximum(self.x[:, 0], 0.0)
        return np.divide(radius, half, out=np.ones_like(half), where=half > radius)

    def state(self) -> dict[str, Any]:
        """Positions and areas, for a checkpoint."""
        return {
            "x": self.x, "area": self.area, "reference": self.reference, "number": self.number,
            "start": self.made.x, "length": self.made.length, "along": self.made.along,
            "middle": self.middle,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: It was made with other points.
        """
        what, n = f"{self.what}: points of the border", len(self.first)
        number = stored.some_of(what, state["number"], n, repeated=True)
        shape = (len(number), self.space.dim)
        x, area, start = (
            stored.values(f"{what}: {name}", state[name], shape) for name in ("x", "area", "start")
        )
        reference, length, along, self.middle = (
            stored.values(f"{what}: {name}", state[name], shape[:1])
            for name in ("reference", "length", "along", "middle")
        )
        self.x, self.area, self.reference, self.number = x, area, reference, number
        self.made = replace(self.first[number], x=start, length=length, along=along)
        self._located = None


def halve(ends: MovingPoints, longest: float) -> Indices:
    """Divide straight pieces that are longer than a length [m] in the middle.

    Args:
        ends: Where they start, then where they end.
        longest: The length.

    Returns:
        The piece that each one is now, or is a half of.
    """
    n = len(ends) // 2
    start, end = ends.x[:n], ends.x[n:]
    count = 1 + (((end - start) ** 2).sum(axis=1) > longest**2)
    of = np.arange(n)
    if (count > 1).any():
        of, place = spread(count)
        half, middle = count[of] == 2, ((start + end) / 2)[of]
        first = np.where((half & (place == 1))[:, None], middle, start[of])
        last = np.where((half & (place == 0))[:, None], middle, end[of])
        ends.keep(np.concatenate([of, of + n]))
        ends.x = np.concatenate([first, last])
    return of


def moved(
    all_points: Sequence[MovingPoints], domain: Domain, u: Array
) -> list[tuple[Array, Array]]:
    """Positions and areas of points after a step; a call for all ranks.

    Points without particles near them, as after a body broke, stay where they are; loads and supports
    on them raise an error.

    Args:
        all_points: The points of several parts.
        domain: The particles at its start.
        u: Increments of the displacement, functions x dim.
    """
    if not all_points:
        return []
    grid, layout = domain.model.grid, domain.layout
    x, area = (np.concatenate([getattr(p, name) for p in all_points]) for name in ("x", "area"))
    normal = area / np.sqrt((area**2).sum(axis=1))[:, None]
    cells = BorderInCells(grid, domain.active, x, normal, torn=True)
    mine, flat = cells.own, np.ascontiguousarray(u).ravel()
    of = x[mine], area[mine], cells.lost[mine]
    x, area = map(cells.on_all, _rust.carried(cells.of_rank.location, layout.basis, flat, *of))
    ends = np.cumsum([0, *map(len, all_points)])
    return [(x[a:b], area[a:b]) for a, b in itertools.pairwise(ends)]
