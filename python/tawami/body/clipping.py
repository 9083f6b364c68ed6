"""Polygons clipped by the cells of the grid.

shapely is imported in the functions that need it: a scene without such bodies does not load it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tawami.base.arrays import Array, Indices, Mask
from tawami.body.dealing import dealt_cells
from tawami.body.points import ROUND_OFF
from tawami.grid.grid import ON_LINE, Grid

#: Cells along each axis of a block that is compared with a shape before its cells are.
BLOCK = 8


def tolerance(scaled: Array) -> float:
    """The length below which two positions of a shape are the same [cells].

    This is ON_LINE times the larger of a cell and of the shape: files state positions with six digits
    or more of the size of the shape.

    Args:
        scaled: Positions of the shape [cells], n x dim; those that are NaN are ignored.
    """
    known = scaled[np.isfinite(scaled).all(axis=-1)]
    return ON_LINE * max(1.0, float(np.ptp(known, axis=0).max()) if len(known) else 0.0)


def on_lines(grid: Grid, x: Array) -> Array:
    """Positions [m] of a shape in cells; those at a line of the grid are moved onto it."""
    scaled = grid.in_cells(x)
    near = np.isclose(scaled, np.rint(scaled), rtol=0, atol=tolerance(scaled))
    return np.where(near, np.rint(scaled), scaled)


def squares(index: Indices, size: int = 1) -> Any:
    """Cells as boxes of shapely, given their indices (i, j), n x 2; or blocks of cells of a size."""
    import shapely

    return shapely.box(*(size * index).T, *(size * (index + 1)).T)


def clipped(grid: Grid, shape: Any) -> tuple[Indices, Array, Indices]:
    """A polygon or multipolygon in cells, clipped by the cells of this rank; a collective call.

    Returns:
        Numbers of the cells that it fills; triangles (n x 3 x 2) of its parts in other cells; the cell
        of each triangle.
    """
    import shapely

    bounds = np.array(shape.bounds)
    lower, upper = np.floor(bounds[:2]).astype(int), np.ceil(bounds[2:]).astype(int)
    index = dealt_cells(grid, lower, upper)
    cell = grid.cell_numbers(index)
    shapely.prepare(shape)
    blocks, of = np.unique(grid.cell_numbers(index // BLOCK), return_inverse=True)
    covered, partly = _covered(shape, grid.cell_indices(blocks), BLOCK)
    full, near = covered[of], np.flatnonzero(partly[of])
    full[near], partly = _covered(shape, index[near], 1)
    rest = near[partly]
    parts = shapely.intersection(shape, squares(index[rest]))
    area = shapely.area(parts)
    full[rest[area > 1 - ROUND_OFF]] = True
    cut = (area > 0) & ~full[rest]
    triangles, of_part = shapely.get_parts(
        shapely.constrained_delaunay_triangles(parts[cut]), return_index=True
    )
    large = shapely.area(triangles) > ROUND_OFF * min(1.0, shape.area)
    corners = shapely.get_coordinates(triangles[large]).reshape(-1, 4, 2)[:, :3]
    return cell[full], corners, cell[rest[cut][of_part[large]]]


def _covered(shape: Any, index: Indices, size: int) -> tuple[Mask, Mask]:
    """Whether a shape covers each block of cells, and whether it covers only a part of it."""
    import shapely

    boxes = squares(index, size)
    covered = np.asarray(shapely.covers(shape, boxes))
    return covered, ~covered & shapely.intersects(shape, boxes)
