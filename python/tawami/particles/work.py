"""Work of the ranks: cells weighed by their particles, which change their rank where that pays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks, stored
from tawami.base.arrays import Indices
from tawami.base.errors import CheckpointError
from tawami.grid.division import Division
from tawami.grid.grid import Grid

#: Weights of a particle and of a cell with particles, in those of a cell without: what they add to the
#: time of a step (`python -m cases.costs.balance`). The weight of an empty cell limits the window.
PARTICLE, CELL = 8, 64
#: Time of a division [steps of evenly divided work]: once as much has been lost since the last one, a
#: division pays.
MOVE = 0.5
#: Difference of the largest to the mean work, relative to the mean, for which cells do not move.
GAIN = 0.05


def divided(grid: Grid, location: _rust.Location, cells: Indices) -> Division:
    """Cells of each rank for particles at their present places; a collective call.

    Args:
        grid: The grid.
        location: Cells of the particles of this rank.
        cells: Indices (i, j) in the grid of its active cells.
    """
    return Division.weighed(grid.comm, grid.comm.size, grid.cells, cells, _weights(location))


def _weights(location: _rust.Location) -> Indices:
    """Weights of the active cells."""
    place = np.searchsorted(location.active, location.cell)
    return PARTICLE * np.bincount(place, minlength=len(location.active)) + CELL


class Work:
    """Watches how evenly the ranks share the work of the steps of a motion, and divides the cells anew.

    The decision depends on numbers of particles only: a run can be repeated.

    Attributes:
        lost: Time lost by uneven work since the last division [steps of evenly divided work].
        least: Largest work of a rank over the mean when the cells were divided.
    """

    def __init__(self) -> None:
        self.lost, self.least = 0.0, 1.0

    def redivided(self, grid: Grid, location: _rust.Location) -> Grid:
        """The grid with other cells for each rank, if they pay; itself otherwise. A collective call.

        Args:
            grid: The grid.
            location: Cells of the particles of this rank, in its window.
        """
        comm = grid.comm
        if comm.size == 1:
            return grid
        weight = _weights(location)
        uneven = _most_over_mean(np.array(comm.allgather(int(weight.sum()))))
        self.lost += max(uneven - self.least, 0.0)
        if self.lost < MOVE:
            return grid
        cells = grid.window.indices(location.active.astype(np.int64))
        division = divided(grid, location, cells)
        of_ranks = np.bincount(division.rank_of(cells), weight, comm.size).astype(np.int64)
        then = _most_over_mean(ranks.sum_of(comm, of_ranks))
        pays = uneven - then > GAIN
        self.lost, self.least = 0.0, then if pays else uneven
        return grid.divided(division) if pays else grid

    def state(self, grid: Grid) -> dict[str, Any]:
        """Cells of each rank and the work so far, for a checkpoint."""
        return {"cuts": grid.division.cuts, "lost": self.lost, "least": self.least}

    def restore(self, grid: Grid, state: Mapping[str, Any]) -> Grid | None:
        """The grid with the cells of a checkpoint; None if it was written by another number of ranks.

        Raises:
            CheckpointError: The cuts do not divide the grid.
        """
        if len(state["cuts"]) != grid.comm.size - 1:
            return None
        shape, axes = grid.division.cuts.shape, len(grid.cells)
        cuts = stored.values("cuts of the grid", state["cuts"], shape).astype(np.int64)
        stored.numbers("axes of the cuts of the grid", cuts[:, 0], len(cuts), axes)
        division = Division(grid.cells, cuts)
        if (division.lower > division.upper).any():
            raise CheckpointError(
                "cuts of the grid in the checkpoint are not within its cells: expected those of a run "
                "of the same script"
            )
        self.lost, self.least = float(state["lost"]), float(state["least"])
        return grid.divided(division)


def _most_over_mean(work: Indices) -> float:
    """The largest over the mean."""
    return float(work.max() / work.mean())
