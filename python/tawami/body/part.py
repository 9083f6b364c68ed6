"""The part of a body that a rank holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.body.dealing import dealt
from tawami.grid.grid import Grid


@dataclass(frozen=True, eq=False)
class Part:
    """The particles of a body in the cells of one of several ranks.

    Attributes:
        grid: The grid.
        number: Number of each of them in the whole body, ascending.
        total: Number of particles of the whole body.
    """

    grid: Grid
    number: Indices
    total: int

    @classmethod
    def of_cells(cls, grid: Grid, *groups: tuple[Indices, Indices]) -> Part | None:
        """The part of a body whose particles are numbered cell by cell; None on one rank.

        A collective call.

        Args:
            grid: The grid.
            groups: Groups of cells, whose particles follow one another: numbers of cells of this rank,
                ascending, and particles in each.
        """
        if grid.comm.size == 1:
            return None
        number, total = [], 0
        for cell, count in groups:
            first = total + ranks.offsets(grid.comm, cell, count)
            before = np.cumsum(count) - count
            number.append(np.repeat(first - before, count) + np.arange(count.sum()))
            total += ranks.total(grid.comm, count.sum())
        return cls(grid, np.concatenate(number), total)

    @classmethod
    def of_whole(cls, grid: Grid, x: Array) -> tuple[Part, Mask]:
        """The part of a body that every rank has, and the mask of its particles; a collective call."""
        mask = dealt(grid, grid.cell_numbers(grid.cell_at(grid.in_cells(x))))
        return cls(grid, np.flatnonzero(mask), len(x)), mask

    def in_own_cells(
        self, x: Array, *arrays: npt.NDArray[Any]
    ) -> tuple[Part, tuple[npt.NDArray[Any], ...]]:
        """The particles in the cells of this rank, where these are divided by the particles; their
        positions and other arrays. A collective call.

        Raises:
            InputError: Particles are outside the grid.
        """
        grid, comm = self.grid, self.grid.comm
        with ranks.raise_together(comm):
            cell = grid.rust.locate(np.ascontiguousarray(x)).cell.astype(np.int64)
        to = grid.divided_by(cell).division.rank_of(grid.cell_indices(cell))
        number, *moved = (ranks.exchanged(comm, rows, to) for rows in (self.number, x, *arrays))
        order = np.argsort(number)
        return Part(grid, number[order], self.total), tuple(rows[order] for rows in moved)

    def by_cells(self, x: Array, volume: Array) -> tuple[Array, Array]:
        """Positions and volumes of the particles in cells that bodies share in the same way on all
        ranks; a collective call.
        """
        grid = self.grid
        cell = grid.cell_numbers(grid.cell_at(grid.in_cells(x)))
        rows = ranks.exchanged(grid.comm, np.column_stack([x, volume]), cell % grid.comm.size)
        return rows[:, :-1], rows[:, -1]

    def at(self, rows: npt.NDArray[Any], number: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Rows of other particles, given those of the particles of this part; a collective call.

        Args:
            rows: Row of each particle of this part.
            number: Numbers of the particles whose rows this rank gets.
        """
        others = np.array([not np.array_equal(number, self.number)])
        if not ranks.any_of(self.grid.comm, others)[0]:
            return rows
        return ranks.looked_up(self.grid.comm, self.number, rows, number.astype(np.int64))

    def chosen(self, mask: Mask) -> Part:
        """The part of a body that keeps only some of its particles; a collective call."""
        number = self.number[mask]
        one = np.ones(len(number), dtype=np.int64)
        total = ranks.total(self.grid.comm, len(number))
        return Part(self.grid, ranks.offsets(self.grid.comm, number, one), total)

    def followed_by(self, other: Part) -> Part:
        """The part of a body that has the particles of this one and then those of another."""
        number = np.concatenate([self.number, self.total + other.number])
        return Part(self.grid, number, self.total + other.total)
