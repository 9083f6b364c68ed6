"""A body: its particles; a rectangle filled with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami.base.checks import instance, point
from tawami.base.errors import InputError
from tawami.body.cut_cells import ON_LINE, along_an_axis
from tawami.grid.grid import Grid

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """Positions and volumes of the particles of a body.

    Attributes:
        x: Positions [m], particles x 2.
        volume: Volumes per metre depth [m2], one per particle.
        material_of: Number of the material of each particle; the first for all without it.
        names: Of the materials, in the order of these numbers, where they have some.
    """

    x: Array
    volume: Array
    material_of: npt.NDArray[np.uint32] | None = None
    names: tuple[str, ...] = ()


def box(
    grid: Grid,
    lower: Sequence[float],
    upper: Sequence[float],
    *,
    per_axis: int = 2,
    gauss: bool = False,
) -> Body:
    """A rectangle filled with `per_axis` x `per_axis` particles in every cell of the grid.

    The sides must lie on lines of the grid, so that every cell is full or empty.

    Args:
        grid: The grid.
        lower: Lower left corner [m].
        upper: Upper right corner [m].
        per_axis: Particles per cell and axis.
        gauss: Put them at the Gauss points, with the Gauss weights, instead of evenly (the
            quarter points for two).

    Raises:
        InputError: Sides off the lines of the grid or outside the grid, or no particle.
    """
    instance("box: grid", grid, Grid, "a tawami.Grid")
    lower, upper = point("lower", lower), point("upper", upper)
    ranges = []
    for axis in range(2):
        with np.errstate(over="ignore"):
            ends = (np.array([lower[axis], upper[axis]]) - grid.origin[axis]) / grid.h
        first, last = np.rint(ends)
        off = np.abs(ends - [first, last]).max() if np.isfinite(ends).all() else np.inf
        if off > ON_LINE or first < 0 or last > grid.cells[axis]:
            raise InputError(
                f"box: its {'xy'[axis]} range [{lower[axis]:g}, {upper[axis]:g}] m must lie on "
                f"lines of the grid (every {grid.h:g} m from {grid.origin[axis]:g} to "
                f"{grid.upper[axis]:g}); change h or the box"
            )
        if last <= first:
            raise InputError(
                f"box: its {'xy'[axis]} range [{lower[axis]:g}, {upper[axis]:g}] m holds no cell: "
                "a body without particles. Expected lower < upper"
            )
        ranges.append(np.arange(int(first), int(last)))
    points, weights = along_an_axis(per_axis, gauss, len(ranges[0]) * len(ranges[1]))
    positions, widths = [], []
    for axis, cell in enumerate(ranges):
        positions.append(grid.axis_positions(axis, cell[:, None], points).ravel())
        widths.append(np.tile(weights * grid.h, len(cell)))
    (x, y), (wx, wy) = positions, widths
    return Body(
        x=np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))]),
        volume=np.outer(wy, wx).ravel(),
    )
