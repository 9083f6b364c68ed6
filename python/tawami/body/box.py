"""Rectangles filled with particles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tawami.base.arrays import Array
from tawami.base.checks import point
from tawami.base.errors import InputError
from tawami.base.space import lattice
from tawami.body import clipping
from tawami.body.body import Body
from tawami.body.dealing import dealt_cells
from tawami.body.filling import PER_AXIS, Filling
from tawami.body.part import Part
from tawami.body.points import in_boxes
from tawami.border.pieces import Border
from tawami.border.polyline import straight
from tawami.grid.grid import Grid

#: Corners of a box, lower 0 and upper 1 along each axis, counter-clockwise.
AROUND = ((0, 0), (1, 0), (1, 1), (0, 1))


def box(
    grid: Grid,
    lower: Sequence[float],
    upper: Sequence[float],
    *,
    per_axis: int = PER_AXIS,
    gauss: bool = False,
) -> Body:
    """A rectangle filled with particles; its sides may cut cells of the grid. A call for all ranks.

    A full cell gets `per_axis` x `per_axis` particles. The part of a cut cell gets 16 at the Gauss
    points, which are exact up to degree 6. The area is exact, but a side within 1e-6 of a line of the
    grid, in units of a cell or of the size of the box, whichever is larger, is moved onto this line.
    The sides of its border are 'left', 'right', 'bottom' and 'top'.

    Args:
        grid: The grid.
        lower: Lower left corner [m].
        upper: Upper right corner [m].
        per_axis: Particles per full cell and axis.
        gauss: Place the particles of full cells at the Gauss points with the Gauss weights. By default
            they are evenly spaced and have equal volumes.

    Raises:
        InputError: A side is outside the grid, or the box is empty.
    """
    filling = Filling("box", grid, per_axis, gauss)
    lower, upper = point("lower", lower), point("upper", upper)
    cells = [grid.cells_between(axis, lower[axis], upper[axis]) for axis in range(grid.space.dim)]
    on_lines = [found for found in cells if found is not None and found[0] < found[1]]
    if len(on_lines) == len(cells):
        return _of_full_cells(filling, np.array(on_lines))
    ends = _ends(grid, np.array([lower, upper]))
    first, last = np.floor(ends[0]).astype(int), np.ceil(ends[1]).astype(int)
    filling.check_memory(math.prod(last - first))
    index = dealt_cells(grid, first, last)
    low, high = np.maximum(index, ends[0]), np.minimum(index + 1, ends[1])
    full = (high - low == 1).all(axis=1)
    cell = grid.cell_numbers(index)
    cut = in_boxes(low[~full], high[~full], cell[~full])
    return filling.body(cell[full], cut, border=_border(grid, ends))


def _of_full_cells(filling: Filling, cells: Array) -> Body:
    """A box of full cells, given the first and the last line along each axis, dim x 2."""
    grid, per_axis = filling.grid, filling.per_axis
    filling.check_memory(math.prod(cells[:, 1] - cells[:, 0]))
    index = dealt_cells(grid, *cells.T)
    shape = per_axis * (cells[:, 1] - cells[:, 0])  # particles of the whole box along each axis
    corner = per_axis * (index - cells[:, 0])
    place = corner[:, None] + lattice([np.arange(per_axis)] * grid.space.dim)
    number = np.sort((place @ np.cumprod((1, *shape[:-1]))).ravel(), kind="stable")
    along = [(np.arange(*ends)[:, None] + filling.points).ravel() for ends in cells]
    weights = [np.tile(filling.weights * grid.h, last - first) for first, last in cells]
    at = np.unravel_index(number, shape, order="F")
    x = np.stack([c[k] for c, k in zip(along, at, strict=True)], axis=-1)
    volume = np.prod([w[k] for w, k in zip(weights, at, strict=True)], axis=0)
    part = Part(grid, number, int(shape.prod())) if grid.comm.size > 1 else None
    border = _border(grid, cells.T)
    body = Body(grid.in_metres(x), volume, lattice=grid.lattice, border=border, part=part)
    return body.in_own_cells()


def _ends(grid: Grid, corners: Array) -> Array:
    """Lower and upper corner in cells, 2 x dim, on lines of the grid if they are near."""
    with np.errstate(over="ignore", invalid="ignore"):
        ends = clipping.on_lines(grid, corners)
    for axis, name in enumerate(grid.space.axes):
        (low, high), (first, last) = corners[:, axis], ends[:, axis]
        if not low < high:
            raise InputError(
                f"box: its {name} range [{low:g}, {high:g}] m is empty, so the body has no particles: "
                "expected lower < upper"
            )
        if first < 0 or last > grid.cells[axis]:
            raise InputError(
                f"box: its {name} range [{low:g}, {high:g}] m leaves the grid, {grid.extent}; enlarge "
                "the grid or move the box"
            )
        if first == last:
            raise InputError(
                f"box: its {name} range [{low:g}, {high:g}] m is round-off on cells of {grid.h:g} m, so "
                "the body has no particles: expected a wider box"
            )
    return ends


def _border(grid: Grid, ends: Array) -> Border:
    """The border of a box, given its lower and upper corner in cells, 2 x dim."""
    corner = grid.in_metres(np.array([[ends[i, 0], ends[j, 1]] for i, j in AROUND]))
    return straight(corner, np.roll(corner, -1, axis=0), ("bottom", "right", "top", "left"))
