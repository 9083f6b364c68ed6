"""Partially filled cells, and the sides that they share with others.

Where particles move, a cell counts as partially filled if one of its neighbours in the grid holds no
particles. Where they stay, it must also hold less than its area, so that a body whose border follows the
lines of the grid has no partially filled cells.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array, Mask
from tawami.grid.grid import ON_LINE, Grid
from tawami.grid.window import Window

Side = tuple[tuple[int, int], tuple[int, int], tuple[str, str]]


def full_cells(grid: Grid, location: _rust.Location, volume: Array) -> Mask:
    """Cells of the window whose particles have the area of the cell to 1e-6, ny x nx.

    A call for all ranks.

    Args:
        grid: The grid.
        location: Cells and positions of this rank's particles.
        volume: Their volumes [m2 per metre depth], in axisymmetry [m3].
    """
    area = volume / grid.space.thickness(grid.positions(location))
    sums = _rust.cell_sums(location, area, np.ones((len(area), 1)))
    held = grid.window.of_cells.update(np.ascontiguousarray(sums))
    full: Mask = held >= (1 - ON_LINE) * grid.space.measure(grid.h)
    return full.reshape(grid.window.cells[::-1])


def partially_filled(active: Mask, full: Mask | None = None) -> Mask:
    """Cells with particles that have a neighbour without particles and are not full, ny x nx.

    Args:
        active: Whether each cell holds particles.
        full: Whether its particles have its area, so that the end of the grid counts as a neighbour
            without particles. None: unknown.
    """
    ny, nx = active.shape
    padded = np.pad(active, 1, constant_values=full is None)
    shifts = [(i, j) for i in range(3) for j in range(3)]
    inside = np.logical_and.reduce([padded[j : j + ny, i : i + nx] for i, j in shifts])
    return np.asarray(active & ~inside if full is None else active & ~inside & ~full)


def sides(window: Window, active: Mask, full: Mask | None = None) -> Iterator[Side]:
    """Sides of partially filled cells: the cells (i, j) of the grid on both sides, and its name in each.

    The first cell of each side belongs to this rank.

    Args:
        window: The cells that the rank knows.
        active, full: As in `partially_filled`.
    """
    own, (x, y) = window.own.reshape(active.shape), window.first
    partial = partially_filled(active, full)
    for (di, dj), names in (((1, 0), ("right", "left")), ((0, 1), ("top", "bottom"))):
        ny, nx = active.shape
        here, there = (slice(0, ny - dj), slice(0, nx - di)), (slice(dj, None), slice(di, None))
        both = own[here] & active[here] & active[there] & (partial[here] | partial[there])
        for j, i in np.argwhere(both):
            i, j = int(i) + x, int(j) + y
            yield (i, j), (i + di, j + dj), names
