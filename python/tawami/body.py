"""Filling a body with particles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tawami import _dolfinx, _rust
from tawami.errors import InputError
from tawami.grid import Grid
from tawami.inputs import array, instance, point, room, shown, switch, whole_number

if TYPE_CHECKING:
    import shapely

Array = npt.NDArray[np.float64]
#: Degree of the rule on the triangles of a cut cell: grad w : C : grad u of quadratic splines.
CUT_DEGREE = 6
#: A side or vertex this near to a line of the grid [cells] lies on it.
ON_LINE = 1e-6
#: A part of a cell this small [cells^2] is round-off.
ROUND_OFF = 1e-12
#: Points along an axis of the largest Gauss rule.
MOST_POINTS = 1000
#: Memory that a particle takes while a body is filled and in the arrays of a scene [bytes].
PARTICLE = 128.0


@dataclass(frozen=True)
class Body:
    """Positions and volumes of the particles of a body.

    Attributes:
        x: Positions [m], particles x 2.
        volume: Volumes per metre depth [m2], one per particle.
    """

    x: Array
    volume: Array


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
    points, weights = _along_an_axis(per_axis, gauss, len(ranges[0]) * len(ranges[1]))
    positions, widths = [], []
    for axis, cell in enumerate(ranges):
        positions.append(grid.axis_positions(axis, cell[:, None], points).ravel())
        widths.append(np.tile(weights * grid.h, len(cell)))
    (x, y), (wx, wy) = positions, widths
    return Body(
        x=np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))]),
        volume=np.outer(wy, wx).ravel(),
    )


def polygon(grid: Grid, vertices: npt.ArrayLike, *, per_axis: int = 2, gauss: bool = False) -> Body:
    """A simple polygon filled with particles; its sides may cut cells of the grid.

    A full cell gets `per_axis` x `per_axis` particles, as `box` puts them. What the polygon leaves of
    another cell is divided into triangles, with particles at the 12 points of a Gauss rule of degree
    6 in each: however little is left, moments up to that degree are exact.

    Args:
        grid: The grid.
        vertices: Corners [m] in order, n x 2, either way round.
        per_axis: Particles per full cell and axis.
        gauss: Put those at the Gauss points, with the Gauss weights, instead of evenly.

    Raises:
        InputError: Fewer than three vertices, all on a line, sides that cross or touch, or a vertex
            outside the grid.
    """
    import shapely  # here and below: a scene without polygons does without it

    instance("polygon: grid", grid, Grid, "a tawami.Grid")
    shape = _in_cells(grid, vertices)
    lower, upper = np.floor(shape.bounds[:2]), np.ceil(shape.bounds[2:])
    points, weights = _along_an_axis(per_axis, gauss, int(np.ceil(shape.area)))
    i, j = (np.arange(a, b) for a, b in zip(lower, upper, strict=True))
    corner = np.column_stack([np.tile(i, len(j)), np.repeat(j, len(i))])
    parts = shapely.intersection(shape, shapely.box(*corner.T, *(corner + 1).T))
    full = shapely.area(parts) > 1 - ROUND_OFF
    lattice = np.column_stack([np.tile(points, len(points)), np.repeat(points, len(points))])
    x, volume = _in_triangles(parts[~full])
    x = np.concatenate([(corner[full][:, None] + lattice).reshape(-1, 2), x])
    volume = np.concatenate([np.tile(np.outer(weights, weights).ravel(), full.sum()), volume])
    return Body(x=grid.origin + grid.h * x, volume=grid.h**2 * volume)


def _along_an_axis(number: int, gauss: bool, cells: int) -> tuple[Array, Array]:
    """Positions and weights of the particles of a full cell along an axis, the cell being 0 to 1, for
    so many cells.
    """
    number = whole_number("per_axis", number, low=1)
    what = f"per_axis = {shown(number)} in {cells} cells"
    room(what, cells * number**2, PARTICLE, "expected fewer particles")
    if switch("gauss", gauss):
        return _rust.gauss(whole_number("per_axis", number, low=1, high=MOST_POINTS))
    return (np.arange(number) + 0.5) / number, np.full(number, 1 / number)


def _in_cells(grid: Grid, vertices: npt.ArrayLike) -> shapely.Polygon:
    """The polygon in cells from the origin; round-off must not leave slivers beyond a line."""
    import shapely

    corners = array("vertices", vertices, 2)
    if len(corners) < 3 or corners.shape[1] != 2:
        raise InputError(
            f"polygon: vertices has shape {corners.shape}: expected three or more points (x, y)"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = (corners - grid.origin) / grid.h
    on_line = np.isclose(scaled, np.rint(scaled), rtol=0, atol=ON_LINE)
    scaled = np.where(on_line, np.rint(scaled), scaled)
    outside = np.flatnonzero(~((scaled >= 0) & (scaled <= grid.cells)).all(axis=1))
    if len(outside):
        x, y = corners[outside[0]]
        raise InputError(
            f"polygon: vertex {outside[0]} at ({x:g}, {y:g}) m lies outside the grid, "
            f"[{grid.origin[0]:g}, {grid.upper[0]:g}] x [{grid.origin[1]:g}, {grid.upper[1]:g}]; "
            "enlarge the grid or move the vertex"
        )
    shape = shapely.Polygon(scaled)
    if shape.convex_hull.area < ROUND_OFF:
        raise InputError(
            "polygon: its vertices lie on a line: a body without particles. Expected an area"
        )
    if not shape.is_valid:
        where = shapely.is_valid_reason(shapely.Polygon(grid.origin + grid.h * scaled))
        raise InputError(
            f"polygon: its sides cross or touch each other ({where} m): expected a simple polygon, "
            "its vertices in order around it"
        )
    return shape


def _in_triangles(parts: Any) -> tuple[Array, Array]:
    """Positions and volumes of particles that integrate over parts of cells."""
    import shapely

    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(parts))
    area = shapely.area(triangles)
    triangles, area = triangles[area > ROUND_OFF], area[area > ROUND_OFF]
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    points, weights = _dolfinx.triangle_rule(CUT_DEGREE)
    barycentric = np.column_stack([1 - points.sum(axis=1), points])
    return (barycentric @ corners).reshape(-1, 2), np.outer(area, 2 * weights).ravel()
