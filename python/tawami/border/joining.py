"""Parts of pieces that lie on each other with opposite directions: they are inside of the body.

shapely is imported in the function that needs it: a scene without such bodies does not load it.
"""

from __future__ import annotations

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.border.curves import Curves, left


def free(curves: Curves, tolerance: float) -> tuple[Indices, Array, Array]:
    """Parts of pieces that do not lie on another piece of opposite direction.

    Straight pieces lie on each other if they are on one line, arcs if they have one centre and radius.

    Args:
        curves: The pieces.
        tolerance: Distance below which two positions are the same [m].

    Returns:
        The piece of each part, and its shares of the length where the part starts and ends.
    """
    n = len(curves.start)
    of, other = _near(curves, tolerance)
    low, high = _common(curves, of, other, tolerance)
    each = np.arange(n)
    # The free parts of a piece are between the common ones: sort them, with empty ones at both ends.
    of = np.concatenate([each, of, each])
    low = np.concatenate([np.zeros(n), low, np.ones(n)])
    high = np.concatenate([np.zeros(n), high, np.ones(n)])
    order = np.lexsort((high, low, of))
    of, low, high = of[order], low[order], high[order]
    upwards = np.lexsort((high, of))
    rank = np.empty_like(upwards)
    rank[upwards] = np.arange(len(upwards))
    reached = high[upwards][np.maximum.accumulate(rank)]  # of one piece, as the order is by pieces
    same = of[1:] == of[:-1]
    first, last = reached[:-1][same], low[1:][same]
    of = of[1:][same]
    kept = (last - first) * curves.length[of] > tolerance
    kept |= (first == 0) & (last == 1)
    return of[kept], first[kept], last[kept]


def _near(curves: Curves, tolerance: float) -> tuple[Indices, Indices]:
    """Pairs of pieces whose boxes are near, and which are of one kind."""
    import shapely

    bulge = np.abs(np.tan(curves.half_angle / 2)) * curves.chord / 2 + tolerance
    low = np.minimum(curves.start, curves.end) - bulge[:, None]
    high = np.maximum(curves.start, curves.end) + bulge[:, None]
    boxes = shapely.box(*low.T, *high.T)
    of, other = shapely.STRtree(boxes).query(boxes)
    kappa = curves.curvature
    opposite = np.abs(kappa[of] + kappa[other]) * curves.chord[of] * curves.chord[other]
    some = (of != other) & (opposite <= 8 * tolerance) & ((kappa[of] == 0) == (kappa[other] == 0))
    return of[some], other[some]


def _common(curves: Curves, of: Indices, other: Indices, tolerance: float) -> tuple[Array, Array]:
    """Shares of the pieces `of` between which pieces `other` lie on them; both 0 if they do not."""
    a, b = (_share(curves, of, x) for x in (curves.end[other], curves.start[other]))
    low, high = np.clip(a, 0, 1), np.clip(b, 0, 1)
    # of pieces shorter than the tolerance, half must be common
    on = high - low > np.minimum(tolerance / curves.length[of], 0.5)
    # where the part begins and ends, the other piece is at the same place
    for share in (low, high):
        on &= _distance(curves, of, other, share, a, b) <= tolerance
    margin = tolerance / curves.length[of]
    low, high = np.where(low < margin, 0, low), np.where(high > 1 - margin, 1, high)
    return np.where(on, low, 0), np.where(on, high, 0)


def _share(curves: Curves, of: Indices, x: Array) -> Array:
    """Share of the length of pieces at which positions are, also beyond their ends."""
    chord = (curves.end - curves.start)[of]
    length, phi = curves.chord[of], curves.half_angle[of]
    along = chord / length[:, None]
    offset = x - curves.start[of]
    straight = (offset * along).sum(axis=1) / length
    bent = phi != 0
    if not bent.any():
        return np.asarray(straight)
    radius = 1 / np.where(bent, curves.curvature[of], 1.0)
    x, y = ((offset * axis).sum(axis=1) for axis in (along, left(along)))
    # From the centre the tangent's angle to the chord, (2 s - 1) phi, is that of (-y, x) / radius.
    sign = np.sign(radius)
    angle = np.arctan2(sign * (x - length / 2), sign * (radius * np.cos(phi) - y))
    return np.where(bent, 0.5 + angle / np.where(bent, 2 * phi, 1.0), straight)


def _distance(
    curves: Curves, of: Indices, other: Indices, share: Array, a: Array, b: Array
) -> Array:
    """Distance of two pieces at a share of one, given the shares a and b of the ends of the other."""
    span = np.where(a == b, 1.0, a - b)
    away = curves.at(of, share) - curves.at(other, np.clip((share - b) / span, 0, 1))
    return np.asarray(np.linalg.norm(away, axis=1))
