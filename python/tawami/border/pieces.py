"""The border of a body as straight pieces and arcs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami.base import text
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.checks import shown
from tawami.base.errors import InputError
from tawami.border import chains, joining, rule, splitting
from tawami.border.curves import SAME, Curves, left
from tawami.border.points import BorderPoints
from tawami.grid.grid import ON_LINE, Grid


@dataclass(frozen=True, repr=False)
class Border(Curves):
    """Straight pieces and arcs, with the body on the left of the way from start to end.

    Attributes:
        start: Where each piece starts [m], pieces x dim.
        end: Where it ends [m].
        curvature: Of each piece [1/m]: 0 for a straight one, positive for an arc around a centre on
            the side of the body, negative for one around a centre outside. Arcs are shorter than a
            half circle.
        tag: Number of the name of each piece among `names`.
        names: Names of the parts of the border.
    """

    tag: Indices
    names: tuple[str, ...]

    def __repr__(self) -> str:
        parts = [f"{name} {length:g} m" for name, length in self.lengths.items()]
        total = self.length.sum()
        return f"Border({len(self.start)} pieces, {total:g} m: {text.listed(parts)})"

    @property
    def lengths(self) -> dict[str, float]:
        """Length of each part [m], in the plane, by its name."""
        each = np.bincount(self.tag, self.length, len(self.names))
        return dict(zip(self.names, map(float, each), strict=True))

    def points(self, grid: Grid, count: int) -> BorderPoints:
        """Points that integrate over the border, in order along it.

        Every part between two lines of the grid has a Gauss rule in its length or angle. With `count`
        points, functions of degree 2 count - 1 along straight parts are exact. Arcs get more points
        where they turn far, so that lengths and normals integrate to 1e-14 of their length. Straight
        parts shorter than h/16 have at most three points.
        Pieces on the axis of an axisymmetric grid have none.

        Consecutive pieces of one name that form no corner (less than 20 degrees) are one chain. Chains
        shorter than h/16, as at corners of level sets, belong to the one before.

        Args:
            grid: The grid.
            count: Points on each part.
        """
        parts = self.at_lines(grid)
        if grid.space.hoop:
            size = ON_LINE * grid.h
            on_axis = (np.abs(parts.start[:, 0]) < size) & (np.abs(parts.end[:, 0]) < size)
            parts = parts[~(on_axis & (parts.curvature == 0))]
        same = ON_LINE * grid.h
        following = chains.followers(parts, same, parts.tag)
        order, chain = chains.chained(following)
        parts = parts[order]
        chain = chains.without_short(parts, parts.tag, chain, rule.SHORT * grid.h, same)
        of, s, share = rule.gauss(parts, count, grid.h)
        length = parts.length
        before = np.cumsum(length) - length
        before -= before[np.searchsorted(chain, chain)]  # the first of each chain is at 0
        x = parts.at(of, s)
        inside = np.clip(x, grid.origin, grid.upper)  # those at an edge of the grid, by round-off
        along = parts.direction(of, s)
        return BorderPoints(
            np.where(np.abs(x - inside) < ON_LINE * grid.h, inside, x),
            share * length[of],
            -left(along),
            parts.tag[of],
            self.names,
            chain[of],
            before[of] + s * length[of],
        )

    def at_lines(self, grid: Grid) -> Border:
        """The same border, with its pieces split at the lines of a grid."""
        of, s, axis, line = self.shares_at_lines(*grid.lattice)
        x = self.at(of, s)
        x[np.arange(len(x)), axis] = np.asarray(grid.origin)[axis] + grid.h * line
        return self._split(of, s, x, SAME * grid.h)

    def where(self, grid: Grid, f: Callable[[Array, Array], npt.ArrayLike]) -> Border:
        """The parts of the border where a function is true; pieces are split where it changes.

        The function is sampled at 17 positions on each piece between two lines of the grid, and where
        it differs between two of them, bisection finds the place to round-off. Parts shorter than the
        distance of the samples, at most h/11, may be missed.

        Args:
            grid: The grid.
            f: A function f(x, y) on arrays of positions [m], which returns a mask.

        Raises:
            InputError: The function fails, or returns an array of another shape or no mask.
        """
        parts = self.at_lines(grid)
        of, s = splitting.changes(parts, f)
        parts = parts._split(of, s, parts.at(of, s), 1e-3 * SAME * grid.h)
        middle = parts.at(np.arange(len(parts.start)), np.full(len(parts.start), 0.5))
        return parts[splitting.mask(f, middle)]

    def named(self, names: str | Sequence[str]) -> Border:
        """The parts of the border with these names.

        Raises:
            InputError: The border has no part of this name; the message lists its names.
        """
        wanted = (names,) if isinstance(names, str) else names
        known = text.quoted(self.names)
        if not isinstance(wanted, list | tuple | set | frozenset) or not wanted:
            raise InputError(
                f"border: names = {shown(names)}: expected one or more of its names, {known}"
            )
        for name in wanted:
            if name not in self.names:
                hint = text.meant(name, self.names) if isinstance(name, str) else ""
                raise InputError(
                    f"the border has no part {shown(name)}: expected one of {known}{hint}"
                )
        return self[np.isin(self.tag, [self.names.index(name) for name in wanted])]

    def joined(self, other: Border) -> Border:
        """The border of two bodies as one; parts that both have in common are inside of it.

        Common parts are straight pieces or arcs that coincide to 1e-6 of the size of both.
        """
        names = tuple(dict.fromkeys(self.names + other.names))
        number = np.array([names.index(name) for name in other.names], dtype=np.int64)
        pairs = zip(self.arrays, other.arrays, strict=True)
        start, end, curvature = (np.concatenate(pair) for pair in pairs)
        tag = np.concatenate([self.tag, number[other.tag]])
        return Border(start, end, curvature, tag, names).outside()

    def outside(self, tolerance: float | None = None) -> Border:
        """The border without pieces that coincide with opposite directions, and names without pieces.

        Args:
            tolerance: Distance below which two positions are the same [m]; 1e-6 of its size if None.
        """
        if not len(self.start):
            return self
        if tolerance is None:
            ends = np.concatenate([self.start, self.end])
            tolerance = ON_LINE * float(np.ptp(ends, axis=0).max())
        parts = self.between(*joining.free(self, tolerance))
        some = np.unique(parts.tag)
        number = np.searchsorted(some, parts.tag).astype(np.int64)
        names = tuple(self.names[k] for k in some)
        return Border(parts.start, parts.end, parts.curvature, number, names)

    def between(self, of: Indices, low: Array, high: Array) -> Border:
        """Parts of the pieces `of` between two shares of their length."""
        return self._parts(of, low, high, self.at(of, low), self.at(of, high))

    def __getitem__(self, chosen: Mask | Indices) -> Border:
        """Some of the pieces."""
        start, end, curvature = (np.asarray(array[chosen]) for array in self.arrays)
        return Border(start, end, curvature, self.tag[chosen], self.names)

    def _split(self, of: Indices, s: Array, x: Array, tolerance: float) -> Border:
        """Its pieces split at shares s of the pieces `of`, which are the positions x.

        Parts shorter than the tolerance [m] belong to their neighbours.
        """
        n = len(self.start)
        of, s = np.concatenate([np.arange(n), of]), np.concatenate([np.zeros(n), s])
        x = np.concatenate([self.start, x])
        order = np.lexsort((s, of))
        of, s, x = of[order], s[order], x[order]
        gap = np.diff(s, prepend=0) * self.length[of]
        left = (1 - s) * self.length[of]
        kept = (s == 0) | ((gap > tolerance) & (left > tolerance))
        of, s, x = of[kept], s[kept], x[kept]
        last = np.append(of[1:] != of[:-1], True)[: len(of)]
        high = np.where(last, 1.0, np.append(s[1:], 1.0)[: len(of)])
        after = np.where(last[:, None], self.end[of], np.concatenate([x[1:], x[:1]]))
        return self._parts(of, s, high, x, after)

    def _parts(self, of: Indices, low: Array, high: Array, start: Array, end: Array) -> Border:
        """Parts of the pieces `of` between two shares, which are at the positions start and end."""
        start = np.where((low == 0)[:, None], self.start[of], start)
        end = np.where((high == 1)[:, None], self.end[of], end)
        return Border(start, end, self.curvature[of], self.tag[of], self.names)
