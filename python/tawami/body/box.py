"""Rectangles filled with particles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tawami.base.arrays import Indices
from tawami.base.checks import point
from tawami.base.errors import InputError
from tawami.base.space import lattice, tensor_product
from tawami.body.body import Body
from tawami.body.filling import PER_AXIS, Filling
from tawami.grid.grid import Grid


def box(
    grid: Grid,
    lower: Sequence[float],
    upper: Sequence[float],
    *,
    per_axis: int = PER_AXIS,
    gauss: bool = False,
) -> Body:
    """A rectangle filled with `per_axis` x `per_axis` particles in every cell of the grid.

    The sides must lie on lines of the grid, so that every cell is full or empty.

    Args:
        grid: The grid.
        lower: Lower left corner [m].
        upper: Upper right corner [m].
        per_axis: Particles per cell and axis.
        gauss: Place the particles at the Gauss points with the Gauss weights. By default they are
            evenly spaced and have equal volumes.

    Raises:
        InputError: A side is not on a line of the grid or is outside the grid, or the box is empty.
    """
    filling = Filling("box", grid, per_axis, gauss)
    lower, upper = point("lower", lower), point("upper", upper)
    cells = [_cells(grid, axis, lower[axis], upper[axis]) for axis in range(grid.space.dim)]
    filling.check_memory(math.prod(map(len, cells)))
    along = [(cell[:, None] + filling.points).ravel() for cell in cells]
    lengths = [np.tile(filling.weights * grid.h, len(cell)) for cell in cells]
    volume = tensor_product(lengths)
    return Body(grid.in_metres(lattice(along)), volume, lattice=grid.lattice)


def _cells(grid: Grid, axis: int, low: float, high: float) -> Indices:
    """Cells of the box along an axis."""
    name = grid.space.axes[axis]
    found = grid.cells_between(axis, low, high)
    if found is None:
        raise InputError(
            f"box: its {name} range [{low:g}, {high:g}] m must lie on lines of the grid (every "
            f"{grid.h:g} m from {grid.origin[axis]:g} to {grid.upper[axis]:g}); change h or the box"
        )
    first, last = found
    if last <= first:
        raise InputError(
            f"box: its {name} range [{low:g}, {high:g}] m holds no cell, so the body has no "
            "particles: expected lower < upper"
        )
    return np.arange(first, last)
