"""Patches of a border: groups of consecutive points, over which supports and contact take means.

Constraints at single border points would be more than the functions of the grid can fulfil, and
pressures would oscillate. Means over patches about as long as a cell do not (inf-sup constant .23 to
.31 for bilinear functions).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tawami.base.arrays import Array, Indices, sums_at
from tawami.border.points import BorderPoints


@dataclass(frozen=True)
class Patches:
    """Groups of points.

    Attributes:
        number: Patch of each point.
        count: Number of patches.
    """

    number: Indices
    count: int

    @cached_property
    def table(self) -> tuple[Indices, Array]:
        """The points of each patch, patches x most points, filled up with its first one; and 1 for each
        of its points, 0 for those that fill up.
        """
        order = np.argsort(self.number, kind="stable")
        many = np.bincount(self.number, minlength=self.count)
        place, first = np.arange(many.max(initial=0)), np.cumsum(many) - many
        inside = place < many[:, None]
        return order[first[:, None] + np.where(inside, place, 0)], inside.astype(float)

    def sums(self, values: Array) -> Array:
        """Sums over the points of each patch, patches x ...

        Args:
            values: Values at the points, points x ...
        """
        columns = values.reshape(len(values), int(np.prod(values.shape[1:]))).T
        sums = [sums_at(self.number, column, self.count) for column in columns]
        return np.asarray(np.transpose(sums)).reshape(self.count, *values.shape[1:])

    def means(self, weights: Array, values: Array) -> Array:
        """Weighted means over the points of each patch, patches x ...

        Args:
            weights: Weight of each point, such as its length [m] or area [m2].
            values: Values at the points, points x ...
        """
        return self.sums((values.T * weights).T) / _column(self.sums(weights), values.ndim)

    def shares(self, weights: Array) -> Array:
        """Share of each point in the weight of its patch."""
        return np.asarray(weights / self.sums(weights)[self.number])


def patches(points: BorderPoints, size: float, length: Array | None = None) -> Patches:
    """Patches of equal length within each run of consecutive points of a chain.

    A run has max(1, floor(its length / `size`)) patches, so that none is shorter than `size` unless
    the run is. A point belongs to the patch that holds the middle of its length.

    Args:
        points: The points; those of a chain need not be all of its points, nor in order.
        size: Least length of a patch [m], such as the size of a cell.
        length: Present length of each point [m], if the border has been stretched.
    """
    present = points.length if length is None else length
    number, count = np.zeros(len(points), dtype=np.int64), 0
    for run in _runs(points):
        ends = np.cumsum(present[run])
        parts = max(1, int(ends[-1] / size * (1 + 1e-12)))
        middle = ends - present[run] / 2
        part = np.minimum((middle / ends[-1] * parts).astype(np.int64), parts - 1)
        used, part = np.unique(part, return_inverse=True)  # few points may leave a patch empty
        number[run] = count + part
        count += len(used)
    return Patches(number, count)


def _runs(points: BorderPoints) -> Iterator[Indices]:
    """Points that follow one another along a chain without a gap, in order."""
    order = np.lexsort((points.along, points.chain))
    gap = np.diff(points.along[order])
    near = points.length[order]
    # Gauss points of one piece, and of neighbouring pieces, are nearer than their lengths together
    broken = (gap > near[1:] + near[:-1]) | (np.diff(points.chain[order]) != 0)
    return (run for run in np.split(order, np.flatnonzero(broken) + 1) if len(run))


def _column(values: Array, dimensions: int) -> Array:
    """An array with further axes of length 1."""
    return values.reshape(-1, *(1,) * (dimensions - 1))
