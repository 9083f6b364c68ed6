"""Points that integrate over a body within its border, on other grids than that of the body."""

from __future__ import annotations

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.body import clipping
from tawami.body.filling import Filling
from tawami.body.points import in_triangles, joined
from tawami.border.curves import left, spread
from tawami.border.pieces import Border
from tawami.grid.grid import Grid

#: Largest turn of a chord that replaces a part of an arc [rad].
TURN = 5e-2
#: Least number of chords for the part of an arc in a cell: corners between them keep the area.
LEAST = 2


def within(grid: Grid, border: Border, per_axis: int) -> tuple[Array, Array]:
    """Gauss points in full cells and in triangles of cut cells, on one rank.

    Args:
        grid: The grid.
        border: The border; arcs are replaced by short chords around the same area.
        per_axis: Gauss points per full cell and axis.

    Returns:
        Positions [m], n x dim, and areas [m2], n.

    Raises:
        InputError: The border does not close.
    """
    import shapely

    border = border.at_lines(grid)  # each cell has its area
    count = np.ceil(2 * np.abs(border.half_angle) / TURN).astype(np.int64)
    count = np.maximum(count, np.where(border.half_angle == 0, 1, LEAST))
    of, place = spread(count)
    x, y = (_corners(border, of, place + end, count) for end in (0, 1))
    last = place + 1 == count[of]
    x[place == 0], y[last] = border.start, border.end
    digits = 1e-9 * max(np.ptp(x, axis=0))
    lines = np.round(np.stack([x, y], axis=1) / digits) * digits  # ends meet to the bit
    area = shapely.build_area(shapely.multilinestrings(shapely.linestrings(lines)))
    if shapely.is_empty(area):
        raise InputError("the border of the body does not close: expected a closed border")
    shape = shapely.make_valid(shapely.transform(area, lambda x: clipping.on_lines(grid, x)))
    full, triangles, cell = clipping.clipped(grid, shape)
    filling = Filling("body", grid, per_axis, gauss=True)
    whole = filling.in_full_cells(full, np.zeros_like(full))
    points = joined([whole, in_triangles(triangles, cell)])
    return grid.in_metres(points.x), grid.space.measure(grid.h) * points.weight


def _corners(border: Border, of: Indices, place: Indices, count: Indices) -> Array:
    """Corners of chords, so far beyond the arcs that the chords of an arc have the area of its sector.

    Args:
        border: Pieces; each is replaced by n chords of the same turn d.
        of: Piece of each corner.
        place: Its number in the piece: 0 to n. The ends are on the arc.
        count: n of each piece.
    """
    x = border.at(of, place / count[of])
    inner = np.flatnonzero((place > 0) & (place < count[of]))  # of arcs: straight pieces have none
    piece = of[inner]
    n = count[piece]
    turn = 2 * np.abs(border.half_angle[piece]) / n
    # two triangles with one end and n - 2 without: 2 q + (n - 2) q^2 = n d/sin d
    area = n * turn / np.sin(turn)
    q = area / (1 + np.sqrt(1 + (n - 2) * area))
    beyond = (q - 1) / border.curvature[piece]
    x[inner] -= beyond[:, None] * left(border.direction(piece, place[inner] / n))
    return x
