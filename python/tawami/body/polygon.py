"""Polygons filled with particles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.base.checks import array, shown
from tawami.base.errors import InputError
from tawami.body import clipping
from tawami.body.body import Body
from tawami.body.filling import PER_AXIS, Filling
from tawami.body.points import ROUND_OFF, in_triangles
from tawami.border.pieces import Border
from tawami.border.polyline import SideNames, oriented, side_names, straight, unclosed
from tawami.grid.grid import Grid

if TYPE_CHECKING:
    import shapely


def polygon(
    grid: Grid,
    shape: npt.ArrayLike | shapely.Polygon | shapely.MultiPolygon,
    *,
    holes: Sequence[npt.ArrayLike] = (),
    names: SideNames = None,
    per_axis: int = PER_AXIS,
    gauss: bool = False,
) -> Body:
    """A polygon filled with particles; its sides may cut cells of the grid. A call for all ranks.

    A full cell gets `per_axis` x `per_axis` particles, placed as by `box`. The part of a cut cell that
    the polygon covers is divided into triangles with the 12 points of a Gauss rule in each. More than
    28 points in a cell are replaced by at most 28. However small the part, volumes are positive and
    moments up to degree 6 are exact. The area is exact to 1e-12, but a vertex at a line of the grid is
    moved onto this line, if it is nearer than 1e-6 of the polygon's size or of a cell, whichever is
    larger. Sides may cross by as little as this. Parts may touch, and a hole may touch the border.

    The sides of its border are '0', '1', ... in the order of the corners: side k goes from corner k to
    the next one. The sides of the holes have the numbers after these. In geometries of shapely the
    order is that of their coordinates.

    Args:
        grid: The grid.
        shape: Corners [m] in order, n x 2, in either orientation; or a Polygon or MultiPolygon of
            shapely with its holes, for example the result of a union or of `buffer`.
        holes: Corners [m] of each hole, if the polygon is given by its corners.
        names: Names of sides: one for each side of the outer border, in order, or a mapping from numbers
            of sides to names.
        per_axis: Particles per full cell and axis.
        gauss: Place the particles of full cells at the Gauss points with the Gauss weights.

    Raises:
        InputError: The polygon has fewer than three vertices or no area, its sides cross, a hole is not
            inside it, or a vertex is outside the grid.
    """
    import shapely

    filling = Filling("polygon", grid, per_axis, gauss)
    geometry = _geometry(grid, shape, holes)
    valid = _valid(grid, geometry)
    border = _border(grid, geometry, names)
    if valid is not geometry:  # sides touch, and are inside where they do
        border = border.outside(clipping.tolerance(shapely.get_coordinates(geometry)) * grid.h)
    full, triangles, cell = clipping.clipped(grid, valid)
    return filling.body(full, in_triangles(triangles, cell), border=border)


def _border(grid: Grid, shape: Any, names: SideNames) -> Border:
    """The sides of a polygon in cells."""
    import shapely

    rings = []
    for part in shapely.get_parts(shape):
        loops = [part.exterior, *part.interiors]
        rings += [(unclosed(shapely.get_coordinates(loop)), k > 0) for k, loop in enumerate(loops)]
    count = [len(x) for x, _ in rings]
    given = names if isinstance(names, Mapping | str) or names is None else None
    all_names = side_names("polygon", given, sum(count))
    if given is not names:
        all_names[: count[0]] = side_names("polygon", names, count[0])
    first = np.cumsum(count) - count
    start, end, name = list[Array](), list[Array](), list[str]()
    for (x, hole), k, n in zip(rings, first, count, strict=True):
        one, other, named = oriented(grid.in_metres(x), all_names[k : k + n], hole)
        start.append(one)
        end.append(other)
        name.extend(named)
    return straight(np.concatenate(start), np.concatenate(end), name, all_names)


def _geometry(grid: Grid, shape: Any, holes: Sequence[npt.ArrayLike]) -> Any:
    """The polygon in cells from the origin."""
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
        kind = f"an empty {shape.geom_type}" if shape.is_empty else f"a {shape.geom_type}"
        raise InputError(f"polygon: it is {kind}: expected a Polygon or MultiPolygon with an area")
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
    """Corners in cells, on a line of the grid if they are near: else round-off would leave slivers."""
    scaled = clipping.on_lines(grid, corners)
    outside = np.flatnonzero(~((scaled >= 0) & (scaled <= grid.cells)).all(axis=1))
    if len(outside):
        x, y = corners[outside[0]]
        raise InputError(
            f"polygon: vertex {outside[0]}{of} at ({x:g}, {y:g}) m lies outside the grid, "
            f"{grid.extent}; enlarge the grid or move the vertex"
        )
    return scaled


def _valid(grid: Grid, shape: Any) -> Any:
    """The polygon, if it is simple and has an area."""
    import shapely

    hull = shape.convex_hull
    if hull.area <= ROUND_OFF * hull.length**2:
        raise InputError(
            "polygon: its vertices lie on a line, so the body has no particles: expected an area"
        )
    mended = shape if shape.is_valid else _without_noise(shape)
    if mended is None:
        where = shapely.is_valid_reason(shapely.transform(shape, grid.in_metres))
        raise InputError(
            f"polygon: its sides cross or touch each other ({where} m): expected a simple polygon, "
            "with its vertices in order and its holes inside"
        )
    return mended


def _without_noise(shape: Any) -> Any | None:
    """A polygon whose sides touch, or cross by less than the tolerance, as a valid one; else None.

    Sides touch where two parts are neighbours, or a hole is at the border. They cross by rounding,
    for example where the last vertex repeats the first one. A vertex at the tip of a spike is an error.
    """
    import shapely

    tolerance = clipping.tolerance(shapely.get_coordinates(shape))
    parts = shapely.get_parts(shapely.make_valid(shape, method="structure"))
    mended = shapely.union_all([part for part in parts if part.area > 0])
    same_area = abs(mended.area - shape.area) <= tolerance * shape.length
    near = shapely.hausdorff_distance(shape.boundary, mended.boundary) <= tolerance
    return mended if same_area and near else None
