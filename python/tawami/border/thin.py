"""Thin parts of an obstacle that is given by its signed distance, as a plate or the tip of a wedge."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from tawami.base.arrays import Array
from tawami.base.checks import LEAST
from tawami.base.space import lattice

#: Distance of the points at which the distance is read, of places on the surface that belong together,
#: and number of places on the way inwards.
SPACING, TOGETHER, PLACES = 0.25, 0.35, 6


def thinnest(
    distance: Callable[[Array], Array], low: Sequence[float], high: Sequence[float], size: float
) -> float:
    """Width of the thinnest part that is narrower than a size and longer than it [m]; infinite for none.

    From places on the surface the obstacle is followed along the inward normal. Half of its width is the
    largest depth there. So a corner counts as thin within size/2 of it only, which is too short.

    Args:
        distance: Signed distance of points [m], points x dim.
        low, high: Corners of the box that is searched [m].
        size: The size [m].
    """
    step = SPACING * size
    axes = [np.arange(a, b + step, step) for a, b in zip(low, high, strict=True)]
    x = lattice(axes)
    here = distance(x)
    near = (here > 0) & (here < size)
    x, here = x[near], here[near]
    if not len(x):
        return np.inf
    slope = np.column_stack(
        [
            (distance(x + move) - distance(x - move)) / (2 * np.linalg.norm(move))
            for move in 1e-3 * size * np.eye(x.shape[1])
        ]
    )
    steepness = np.maximum(np.linalg.norm(slope, axis=1), LEAST)[:, None]
    normal = slope / steepness
    surface = x - here[:, None] / steepness * normal
    ways = size * np.arange(1, PLACES + 1) / PLACES
    depths = [-distance(surface - way * normal) for way in ways]
    width = 2 * np.max(depths, axis=0)
    thin = width < size * (1 - 1e-6)
    if thin.all():
        return float(np.max(width))
    return _of_longest(surface[thin], width[thin], size)


def _of_longest(x: Array, width: Array, size: float) -> float:
    """Width of the thinnest group of places on a surface that is longer than a size; else infinity."""
    from scipy.spatial import KDTree  # takes long to import

    if not len(x):
        return np.inf
    pairs = KDTree(x).query_pairs(TOGETHER * size, output_type="ndarray")
    ones = np.ones(len(pairs))
    graph = sp.csr_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(x), len(x)))
    count, group = connected_components(graph, directed=False)
    parts = [group == k for k in range(count)]
    long = [width[part].max() for part in parts if np.ptp(x[part], axis=0).max() > size]
    return float(min(long, default=np.inf))
