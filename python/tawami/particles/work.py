"""Work of the ranks: cells weighed by their particles, which change their rank where that pays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks, stored
from tawami.base.arrays import Indices
from tawami.base.errors import CheckpointError
from tawami.grid.division import Division, weights
from tawami.grid.grid import Grid

#: Time of a division [steps of evenly divided work]: once as much has been lost since the last one, a
#: division pays.
MOVE = 0.5
#: Difference of the largest to the mean work, relative to the mean, for which cells do not move.
GAIN = 0.05


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
        place = np.searchsorted(location.active, location.cell)
        weight = weights(np.bincount(place, minlength=len(location.active)))
        uneven = _most_over_mean(np.array(comm.allgather(int(weight.sum()))))
        self.lost += max(uneven - self.least, 0.0)
        if self.lost < MOVE:
            return grid
        other = grid.divided_by(grid.window.cells_in_grid(location.cell.astype(np.int64)))
        rank = other.division.rank_of(grid.window.indices(location.active.astype(np.int64)))
        of_ranks = np.bincount(rank, weight, comm.size).astype(np.int64)
        then = _most_over_mean(ranks.sum_of(comm, of_ranks))
        pays = uneven - then > GAIN
        self.lost, self.least = 0.0, then if pays else uneven
        return other if pays else grid

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
