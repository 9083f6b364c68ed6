"""Division of the cells of a grid among the ranks: a box of cells for each, by recursive bisection."""

from __future__ import annotations

from typing import Any

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Indices
from tawami.base.space import Counts

#: Weights of a particle, of a cell with particles, and of every cell, by the time that they add to a
#: step (`python -m cases.costs.balance`). That of every cell also limits the windows of the ranks.
PARTICLE, CELL, EMPTY = 16, 128, 1


def weights(count: Indices) -> Indices:
    """Weights of cells, without `EMPTY`, given their numbers of particles."""
    return np.asarray(PARTICLE * count + CELL)


class Division:
    """Boxes of cells, one for each rank, which do not overlap and cover the grid.

    A cut gives the cells before a line of the grid to the first half of its ranks, and the others to the
    second half. The halves are cut in the same way. A box may be empty.

    Args:
        cells: Number of cells of the grid along each axis.
        cuts: Axis and line of each cut, ranks - 1 x 2: the first cut, then those of its first half of
            the ranks, then those of the second half.

    Attributes:
        cells, cuts: As given.
        lower: First cell of the box of each rank, ranks x axes.
        upper: The cell after its last one along each axis, ranks x axes.
    """

    def __init__(self, cells: Counts, cuts: Indices) -> None:
        self.cells, self.cuts = cells, cuts
        shape = (len(cuts) + 1, len(cells))
        self.lower, self.upper = np.zeros(shape, np.int64), np.tile(np.array(cells), (shape[0], 1))
        for place, rank, count in _nodes(shape[0]):
            (axis, line), half = cuts[place], rank + count // 2
            self.upper[rank:half, axis] = line
            self.lower[half : rank + count, axis] = line

    @property
    def size(self) -> int:
        """Number of ranks."""
        return len(self.lower)

    def rank_of(self, index: Indices) -> Indices:
        """Rank of cells, given their indices (i, j), cells x axes."""
        rows = {0: np.arange(len(index))}
        for place, first, count in _nodes(self.size):
            here, (axis, line) = rows.get(first, rows[0][:0]), self.cuts[place]
            if len(here):
                below = index[here, axis] < line
                rows[first], rows[first + count // 2] = here[below], here[~below]
        rank = np.empty(len(index), dtype=np.int64)
        for one, here in rows.items():
            rank[here] = one
        return rank

    @classmethod
    def by_particles(cls, comm: Any, cells: Counts, cell: Indices) -> Division:
        """The division in which the ranks have nearly the same work; a collective call.

        Args:
            comm: Communicator.
            cells: Number of cells of the grid along each axis.
            cell: Number of the cell of each particle of this rank.
        """
        here = np.stack(np.unique(cell, return_counts=True), axis=1)
        rows = ranks.exchanged(comm, here, here[:, 0] % comm.size)  # several ranks may share a cell
        some, place = np.unique(rows[:, 0], return_inverse=True)
        count = np.bincount(place, rows[:, 1], len(some)).astype(np.int64)
        index = np.stack(np.unravel_index(some, cells, order="F"), axis=-1)
        return cls.weighed(comm, comm.size, cells, index, weights(count))

    @classmethod
    def weighed(
        cls, comm: Any, parts: int, cells: Counts, index: Indices, weight: Indices
    ) -> Division:
        """A division into parts of nearly equal weights; a collective call.

        It depends on sums of the weights over lines of cells only, which are whole numbers: all ranks
        get the same. A box is cut across the longer side of its cells with weights.

        Args:
            comm: Communicator.
            parts: Number of boxes.
            cells: Number of cells of the grid along each axis.
            index: Indices (i, j) of some cells, cells x axes, each on one rank.
            weight: Their weights; every cell has `EMPTY` in addition.
        """
        cuts = np.zeros((parts - 1, 2), dtype=np.int64)
        whole = (np.zeros(len(cells), np.int64), np.array(cells))
        waiting = {0: (parts, *whole, np.arange(len(index)))} if parts > 1 else {}
        while waiting:
            boxes, waiting = waiting, {}
            sums = ranks.sum_of(
                comm,
                np.concatenate(
                    [
                        np.bincount(
                            index[rows, axis] - low[axis], weight[rows], high[axis] - low[axis]
                        )
                        for _, low, high, rows in boxes.values()
                        for axis in range(len(cells))
                    ]
                ).astype(np.int64),
            )
            for place, (count, low, high, rows) in boxes.items():
                size = high - low
                along, sums = np.split(sums[: size.sum()], np.cumsum(size)[:-1]), sums[size.sum() :]
                half = count // 2
                axis, line = _cut(along, half, count)
                line += low[axis]
                cuts[place] = axis, line
                below, end, start = index[rows, axis] < line, high.copy(), low.copy()
                end[axis] = start[axis] = line
                if half > 1:
                    waiting[place + 1] = half, low, end, rows[below]
                if count - half > 1:
                    waiting[place + half] = count - half, start, high, rows[~below]
        return cls(cells, cuts)


def _nodes(ranks: int) -> list[tuple[int, int, int]]:
    """Place of each cut, the first of its ranks, and their number, in the order of the places."""
    found, waiting = list[tuple[int, int, int]](), [(0, 0, ranks)]
    while waiting:
        place, first, count = waiting.pop()
        if count > 1:
            half = count // 2
            found.append((place, first, count))
            waiting += [(place + half, first + half, count - half), (place + 1, first, half)]
    return found


def _cut(along: list[Indices], half: int, count: int) -> tuple[int, int]:
    """Axis and line of the cut of a box that gives half / count of the weight to the cells before it.

    Args:
        along: Weights of the lines of cells along each axis, without those of empty cells.
        half, count: Its ranks on the lower side, and all of them.
    """
    size = np.array([len(lines) for lines in along])
    spans = [np.flatnonzero(lines) for lines in along]
    length = [int(used[-1] - used[0]) + 1 if len(used) else 0 for used in spans]
    axis = max(range(len(along)), key=lambda k: (length[k], size[k]))
    if size[axis] < 2:
        return axis, int(size[axis])
    empty = EMPTY * int(size.prod()) // int(size[axis])
    sums = np.cumsum(along[axis] + empty)
    return axis, 1 + int(np.argmin(np.abs(count * sums[:-1] - half * sums[-1])))
