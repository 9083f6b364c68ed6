"""The order of pieces along a border, and chains of pieces without corners."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.spatial import cKDTree

from tawami.base.arrays import Array, Indices
from tawami.border.curves import Curves

#: Pieces that may start where another one ends: more than one where parts of a body touch.
NEAREST = 4
#: Angle from which on two pieces form a corner [rad].
CORNER = np.radians(20)


def followers(curves: Curves, tolerance: float, tag: Indices | None = None) -> Indices:
    """The piece that follows each one, or -1.

    Args:
        curves: The pieces.
        tolerance: Distance below which two positions are the same [m].
        tag: Number of the name of each; pieces with another name, or with a corner in between, then do
            not follow.
    """
    n = len(curves.start)
    following = np.full(n, -1)
    if not n:
        return following
    near = list(range(1, min(NEAREST, n) + 1))
    distance, other = cKDTree(curves.start).query(
        curves.end, k=near, distance_upper_bound=tolerance
    )
    each, found = np.arange(n), other < n
    of, other, distance = (
        np.broadcast_to(each[:, None], found.shape)[found],
        other[found],
        distance[found],
    )
    turn = _turn(curves, of, other)
    some = of != other
    if tag is not None:
        some &= (tag[of] == tag[other]) & (turn < CORNER)
    cost = (distance / tolerance + 1e-2 * turn)[some]
    of, other = of[some], other[some]
    for axis in range(2):  # each piece has one follower, and follows one piece
        order = np.argsort(cost, kind="stable")
        order = order[np.unique((of, other)[axis][order], return_index=True)[1]]
        of, other, cost = of[order], other[order], cost[order]
    following[of] = other
    return following


def chained(following: Indices) -> tuple[Indices, Indices]:
    """The order of pieces along the border, and the number of the chain of each in this order.

    Chains are in the order of their first pieces; a closed chain begins with the first of its pieces.
    """
    after, n = following.tolist(), len(following)
    leads = set(range(n)) - set(after)
    known, chains = [False] * n, list[list[int]]()
    for start in [*sorted(leads), *range(n)]:
        piece, chain = start, list[int]()
        while piece >= 0 and not known[piece]:
            known[piece] = True
            chain.append(piece)
            piece = after[piece]
        if chain:
            chains.append(chain)
    chains.sort(key=min)
    order = np.array(list(itertools.chain(*chains)), dtype=np.int64)
    return order, np.repeat(np.arange(len(chains)), [len(chain) for chain in chains])


def _turn(curves: Curves, of: Indices, other: Indices) -> Array:
    """Angle between the end of pieces and the start of others [rad]."""
    a = curves.direction(of, np.ones(len(of)))
    b = curves.direction(other, np.zeros(len(other)))
    cross, dot = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)
    return np.asarray(np.abs(np.arctan2(cross, dot)))
