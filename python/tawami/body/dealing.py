"""Cells in which a rank makes the particles of a body: blocks of cells, dealt to the ranks in turn.

Every shape is then made by all ranks, wherever it lies. Its particles are counted and moved to the ranks
among which they divide the cells.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami.base.arrays import Indices, Mask
from tawami.base.space import lattice
from tawami.grid.grid import Grid

#: Cells of a block along each axis.
BLOCK = 4


def dealt(grid: Grid, cell: Indices) -> Mask:
    """Whether this rank makes the particles in cells, given their numbers."""
    return _mine(grid, grid.cell_indices(cell) // BLOCK)


def dealt_cells(grid: Grid, lower: Sequence[int], upper: Sequence[int]) -> Indices:
    """Indices (i, j) of the cells of this rank in a box, in the order of their numbers, cells x dim.

    Args:
        grid: The grid.
        lower: First cell of the box along each axis.
        upper: The cell after its last one.
    """
    along = list(zip(lower, upper, strict=True))
    if grid.comm.size == 1:
        return lattice([np.arange(*ends) for ends in along])
    block = lattice([np.arange(low // BLOCK, -(-high // BLOCK)) for low, high in along])
    block = block[_mine(grid, block)]
    dim = grid.space.dim
    index = (BLOCK * block[:, None] + lattice([np.arange(BLOCK)] * dim)).reshape(-1, dim)
    index = index[((index >= lower) & (index < upper)).all(axis=1)]
    return np.asarray(index[np.argsort(grid.cell_numbers(index))])


def _mine(grid: Grid, block: Indices) -> Mask:
    """Whether blocks, given by their indices, are this rank's: neighbours belong to different ranks."""
    return np.asarray(block.sum(axis=1) % grid.comm.size == grid.comm.rank)
