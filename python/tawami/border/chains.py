"""The order of pieces along a border, and chains of pieces without corners."""

from __future__ import annotations

import itertools

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.border.curves import Curves, spread

#: Factors that make one number of the indices of a square; squares may share a number.
KEY = np.array([1, 1_000_003, 998_244_353])
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
    of, other = _near(curves.end, curves.start, tolerance)
    distance = np.linalg.norm(curves.end[of] - curves.start[other], axis=1)
    turn = _turn(curves, of, other)
    some = (of != other) & (distance <= tolerance)
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


def without_short(
    curves: Curves, tag: Indices, chain: Indices, least: float, tolerance: float
) -> Indices:
    """Numbers of chains, where short ones belong to the chain before if they follow it.

    Args:
        curves: The pieces in order.
        tag: Number of the name of each; chains of different names stay apart.
        chain: Number of the chain of each, in order.
        least: Length below which a chain is short [m].
        tolerance: Distance below which two positions are the same [m].
    """
    if not len(chain):
        return chain
    first = np.flatnonzero(np.diff(chain, prepend=-1))
    before = np.maximum(first - 1, 0)
    gap = np.linalg.norm(curves.start[first] - curves.end[before], axis=1)
    follows = (first > 0) & (gap <= tolerance) & (tag[first] == tag[before])
    short = np.add.reduceat(curves.length, first) < least
    return np.asarray(np.cumsum(~(follows & short)) - 1)[chain]


def _near(a: Array, b: Array, tolerance: float) -> tuple[Indices, Indices]:
    """Pairs of positions a and b (n x dim), with all pairs that are nearer than the tolerance.

    Positions that near are in one square of at least one lattice, shifted by half a square or not.
    """
    size, pairs = 4 * tolerance, list[tuple[Indices, Indices]]()
    for shift in itertools.product((0.0, 0.5), repeat=a.shape[1]):
        keys = (np.floor(x / size + shift).astype(np.int64) @ KEY[: a.shape[1]] for x in (a, b))
        key, known = keys
        order = np.argsort(known, kind="stable")
        first, last = (np.searchsorted(known[order], key, side) for side in ("left", "right"))
        of, step = spread(last - first)
        pairs.append((of, order[first[of] + step]))
    of, other = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return of, other


def _turn(curves: Curves, of: Indices, other: Indices) -> Array:
    """Angle between the end of pieces and the start of others [rad]."""
    a = curves.direction(of, np.ones(len(of)))
    b = curves.direction(other, np.zeros(len(other)))
    cross, dot = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)
    return np.asarray(np.abs(np.arctan2(cross, dot)))
