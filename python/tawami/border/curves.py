"""Straight pieces and arcs: positions, directions, and where they meet lines of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.space import Counts, Position

#: Ends of parts that are nearer than this [cells] are the same.
SAME = 1e-9
#: Newton steps that remove the round-off of an intersection with a line.
STEPS = 2


@dataclass(frozen=True)
class Curves:
    """Straight pieces and arcs in the plane; a position on one is its share s of the length, 0 to 1.

    Attributes:
        start: Where each piece starts [m], pieces x dim.
        end: Where it ends [m].
        curvature: Of each piece [1/m]: 0 for a straight one, positive for an arc around a centre on
            the left of the way. Arcs are shorter than a half circle.
    """

    start: Array
    end: Array
    curvature: Array

    @property
    def arrays(self) -> tuple[Array, Array, Array]:
        """Start, end and curvature."""
        return self.start, self.end, self.curvature

    @property
    def chord(self) -> Array:
        """Distance from start to end [m]."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1))

    @property
    def half_angle(self) -> Array:
        """Half of the angle by which the way turns, positive to the left."""
        return np.asarray(np.arcsin(np.clip(self.curvature * self.chord / 2, -1, 1)))

    @property
    def length(self) -> Array:
        """Length of each piece [m]."""
        return np.asarray(self.chord / np.sinc(self.half_angle / np.pi))

    def at(self, of: Indices, s: Array) -> Array:
        """Positions [m], n x dim, at the shares s of the pieces `of`."""
        chord, phi = (self.end - self.start)[of], self.half_angle[of]
        # x = start + c sin(s phi)/sin(phi) times the chord's direction turned by -(1 - s) phi
        share = s * np.sinc(s * phi / np.pi) / np.sinc(phi / np.pi)
        return np.asarray(self.start[of] + share[:, None] * turned(chord, -(1 - s) * phi))

    def direction(self, of: Indices, s: Array) -> Array:
        """Unit tangents, n x dim, at the shares s of the pieces `of`."""
        chord = (self.end - self.start)[of]
        along = turned(chord, (2 * s - 1) * self.half_angle[of])
        return np.asarray(along / np.linalg.norm(chord, axis=1)[:, None])

    def shares_at_lines(
        self, origin: Position, h: float, cells: Counts
    ) -> tuple[Indices, Array, Indices, Indices]:
        """Positions inside of pieces where these meet lines of a grid.

        Returns:
            The piece of each, its share of the length, the axis normal to the line, and the number of
            the line.
        """
        found = []
        phi = self.half_angle
        bulge = np.abs(np.tan(phi / 2)) * self.chord / 2
        for axis, count in enumerate(cells):
            a, b = ((x[:, axis] - origin[axis]) / h for x in (self.start, self.end))
            first = np.ceil(np.clip(np.minimum(a, b) - bulge / h, 0, count)).astype(np.int64)
            last = np.floor(np.clip(np.maximum(a, b) + bulge / h, 0, count)).astype(np.int64)
            number = np.maximum(last - first + 1, 0)
            of, step = spread(number)
            line = first[of] + step
            for s in self._meeting(of, axis, origin[axis] + h * line):
                inside = (s > 0) & (s < 1)
                found.append((of[inside], s[inside], np.full(inside.sum(), axis), line[inside]))
        of, s, axes, lines = (np.concatenate(part) for part in zip(*found, strict=True))
        return of, s, axes, lines

    def _meeting(self, of: Indices, axis: int, x: Array) -> list[Array]:
        """Shares at which pieces have the coordinate x; NaN where they do not, twice for arcs."""
        a, b = self.start[of, axis], self.end[of, axis]
        phi = self.half_angle[of]
        straight = np.where(phi == 0, _divided(x - a, b - a), np.nan)
        if not phi.any():
            return [straight]
        # The tangent has the angle t = t0 + 2 phi s: a coordinate changes by (sin t - sin t0) / kappa.
        tangent = self.direction(of, np.zeros(len(of)))
        turn = (tangent[:, axis], turned(tangent, np.full(len(of), -np.pi / 2))[:, axis])
        start = np.arctan2(turn[1], turn[0])
        sine = np.sin(start) + (x - a) * self.curvature[of]
        with np.errstate(invalid="ignore"):
            asin = np.arcsin(np.where(np.abs(sine) <= 1, sine, np.nan))
        shares = [straight]
        for angle in (asin, np.pi - asin):
            turned_by = (angle - start) * np.sign(phi)
            s = _divided(turned_by % (2 * np.pi), 2 * np.abs(phi))
            for _ in range(STEPS):
                s = self._improved(of, axis, x, s)
            shares.append(np.where(phi == 0, np.nan, s))
        return shares

    def _improved(self, of: Indices, axis: int, x: Array, s: Array) -> Array:
        """Shares after a Newton step towards the coordinate x, where the curve is not along the line."""
        known = np.where((s > 0) & (s < 1), s, 0.5)
        slope = self.direction(of, known)[:, axis] * self.length[of]
        steep = np.abs(slope) > 1e-3 * self.length[of]
        step = _divided(self.at(of, known)[:, axis] - x, np.where(steep, slope, np.nan))
        return np.where(np.isfinite(step) & (known == s), s - step, s)


def turned(vector: Array, angle: Array) -> Array:
    """Vectors, n x 2, turned to the left by angles."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[:, 0], vector[:, 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=1)


def left(along: Array) -> Array:
    """Vectors, n x 2, turned to the left by a right angle."""
    return np.stack([-along[:, 1], along[:, 0]], axis=1)


def spread(count: Indices) -> tuple[Indices, Indices]:
    """The numbers 0 to count - 1 for each count: which count each belongs to, and the number."""
    of = np.repeat(np.arange(len(count)), count)
    return of, np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)


def _divided(a: Array, b: Array) -> Array:
    """Quotients, NaN where the divisor is 0."""
    return np.divide(a, b, out=np.full(len(a), np.nan), where=b != 0)
