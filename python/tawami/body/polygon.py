"""Polygons filled with particles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tawami.base.checks import array, shown
from tawami.base.errors import InputError
from tawami.body import cut_cells
from tawami.body.body import Body
from tawami.body.cut_cells import ROUND_OFF, on_lines
from tawami.grid.grid import Grid

if TYPE_CHECKING:
    import shapely

Array = npt.NDArray[np.float64]


def polygon(
    grid: Grid,
    shape: npt.ArrayLike | shapely.Polygon | shapely.MultiPolygon,
    *,
    holes: Sequence[npt.ArrayLike] = (),
    per_axis: int = 2,
    gauss: bool = False,
) -> Body:
    """A polygon filled with particles; its sides may cut cells of the grid.

    A full cell gets `per_axis` x `per_axis` particles, as `box` puts them. What the polygon leaves of
    another cell is divided into triangles, with the 12 points of a Gauss rule in each; more than 28 in
    a cell are thinned out to at most 28. However little is left, volumes are positive and moments up
    to degree 6 exact: the area to 1e-12 of it, but for what vertices move that are within 1e-6 cells
    of a line of the grid, and are put on it.

    Args:
        grid: The grid.
        shape: Corners [m] in order, n x 2, either way round; or a Polygon or MultiPolygon of shapely,
            as its set operations and `buffer` give them, with the holes that it has.
        holes: Corners of each hole of a polygon that is given by its corners [m].
        per_axis: Particles per full cell and axis.
        gauss: Put those at the Gauss points, with the Gauss weights, instead of evenly.

    Raises:
        InputError: Fewer than three vertices, all on a line, sides that cross or touch, a hole outside
            the polygon, a vertex outside the grid, or a geometry without an area.
    """
    cut_cells.check("polygon", grid, per_axis, gauss)
    found = _valid(grid, _geometry(grid, shape, holes))
    full, triangles, cell = cut_cells.clipped(found)
    cut = cut_cells.in_triangles(triangles, cell)
    return Body(*cut_cells.to_body(grid, full, cut, per_axis, gauss))


def _geometry(grid: Grid, shape: Any, holes: Sequence[npt.ArrayLike]) -> Any:
    """In cells from the origin; round-off must not leave slivers beyond a line."""
    import shapely

    listed = isinstance(holes, list | tuple) or (isinstance(holes, np.ndarray) and holes.ndim > 0)
    if not listed:
        raise InputError(
            f"polygon: holes = {shown(holes)}: expected a list with the corners of each hole"
        )
    inner = [_ring(grid, corners, f"holes[{k}]") for k, corners in enumerate(holes)]
    if not isinstance(shape, shapely.Geometry):
        return shapely.Polygon(_ring(grid, shape, "vertices"), inner)
    if not isinstance(shape, shapely.Polygon | shapely.MultiPolygon) or shape.is_empty:
        what = f"a {shape.geom_type}" + (" that is empty" if shape.is_empty else "")
        raise InputError(f"polygon: it is {what}: expected a Polygon or MultiPolygon with an area")
    if inner:
        raise InputError("polygon: a geometry of shapely has its own holes: expected no holes=")
    scaled = _in_cells(grid, shapely.get_coordinates(shape))
    return shapely.set_coordinates(shapely.force_2d(shape), scaled)


def _ring(grid: Grid, given: npt.ArrayLike, what: str) -> Array:
    corners = array(what, given, 2)
    if len(corners) < 3 or corners.shape[1] != 2:
        raise InputError(
            f"polygon: {what} has shape {corners.shape}: expected three or more points (x, y)"
        )
    return _in_cells(grid, corners, "" if what == "vertices" else f" of {what}")


def _in_cells(grid: Grid, corners: Array, of: str = "") -> Array:
    scaled = on_lines((corners - grid.origin) / grid.h)
    outside = np.flatnonzero(~((scaled >= 0) & (scaled <= grid.cells)).all(axis=1))
    if len(outside):
        x, y = corners[outside[0]]
        raise InputError(
            f"polygon: vertex {outside[0]}{of} at ({x:g}, {y:g}) m lies outside the grid, "
            f"{grid.extent}; enlarge the grid or move the vertex"
        )
    return scaled


def _valid(grid: Grid, shape: Any) -> Any:
    import shapely

    if shape.convex_hull.area < ROUND_OFF:
        raise InputError(
            "polygon: its vertices lie on a line: a body without particles. Expected an area"
        )
    if not shape.is_valid:
        in_metres = shapely.transform(shape, lambda x: grid.origin + grid.h * x)
        where = shapely.is_valid_reason(in_metres)
        raise InputError(
            f"polygon: its sides cross or touch each other ({where} m): expected a simple polygon, "
            "its vertices in order around it, and holes inside of it"
        )
    return shape
