"""Gauss points on straight pieces and arcs."""

from __future__ import annotations

import math

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array, Indices
from tawami.border.curves import Curves

#: Length [cells] below which straight parts have at most so many points. With fewer than three the sums
#: over the border and over particles in slivers of cells would differ, in stress by up to 100 %.
SHORT, FEW = 1 / 16, 3
#: Error of the integral of the normal over an arc, relative to its length.
EXACT = 1e-15
#: Most points that an arc may need: a half circle is integrated to `EXACT` with fewer.
MOST = 12


def gauss(curves: Curves, count: int, h: float) -> tuple[Indices, Array, Array]:
    """Points of Gauss rules in the length or angle of pieces.

    Args:
        curves: The pieces.
        count: Points on each.
        h: Side of a cell [m].

    Returns:
        The piece of each point, its share of the length, and its weight; weights of a piece sum to 1.
    """
    length = curves.length
    most = np.where(length < SHORT * h, FEW, count)
    angle: Array = np.abs(2 * curves.half_angle)
    number = np.maximum(np.minimum(most, count), _needed(angle))
    found = []
    for n in np.unique(number):
        of = np.flatnonzero(number == n)
        s, weight = _rust.gauss(int(n))
        found.append((np.repeat(of, n), np.tile(s, len(of)), np.tile(weight, len(of))))
    if not found:
        return np.empty(0, dtype=np.int64), np.empty(0), np.empty(0)
    of, s, weight = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(of, kind="stable")
    return of[order], s[order], weight[order]


def _needed(angle: Array) -> Indices:
    """Points that integrate the normal over arcs of these angles [rad] to `EXACT`; 0 for straight ones.

    The error of n points for a sine is angle^(2n) (n!)^4 / ((2n + 1) (2n)!^3) of the length at most.
    """
    number = np.zeros(len(angle), dtype=np.int64)
    number[angle > 0] = 1
    for n in range(1, MOST):
        f = math.factorial
        error = angle ** (2 * n) * f(n) ** 4 / ((2 * n + 1) * f(2 * n) ** 3)
        number[error > EXACT] = n + 1
    return number
