"""Elements of a mesh: their checks, and their parts in each cell of the grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.body import clipping
from tawami.body.dealing import dealt
from tawami.body.points import Points, areas, in_triangles
from tawami.grid.grid import Grid

#: A cell is full if less than this share is not covered.
COVERED = 1e-9
#: Elements overlap if a disc of this radius fits into both [tolerances]: their nodes are up to
#: 3.4 tolerances away from their true places, by rounding and by moving them onto lines of the grid.
DEEP = 2.0
#: An element is flat if it is thinner than this [tolerances], which is round-off.
FLAT = 1e-6
#: Corners of the two halves of a quadrilateral, along one diagonal or the other.
DIAGONALS = (([0, 1, 2], [0, 2, 3]), ([1, 2, 3], [1, 3, 0]))


@dataclass(frozen=True)
class Elements:
    """Triangles of a mesh; a quadrilateral is two triangles.

    Attributes:
        corners: Positions [cells], counter-clockwise, n x 3 x 2.
        number: Number of the element among the elements that are used, n.
        material: Number of the material of each triangle, n.
        tolerance: Length below which two positions are the same [cells].
    """

    corners: Array
    number: Indices
    material: Indices
    tolerance: float


def triangles(grid: Grid, x: Array, blocks: list[Indices], material: Indices) -> Elements:
    """The elements of a mesh as triangles.

    Args:
        grid: The grid.
        x: Positions of the nodes [m].
        blocks: Nodes of triangles (n x 3) and quadrilaterals (n x 4).
        material: Number of the material of each element.

    Raises:
        InputError: An element is outside the grid, has no area, or crosses itself.
    """
    used = np.unique(np.concatenate([block.ravel() for block in blocks]))
    scaled = np.full(x.shape, np.nan)
    scaled[used] = clipping.on_lines(grid, x[used])
    tolerance = clipping.tolerance(scaled[used])
    corners, number, first = list[Array](), list[Indices](), 0
    for block in blocks:
        count = np.arange(first, first + len(block))
        _check_nodes(grid, x, scaled, block, first)
        if block.shape[1] == 4:
            corners += list(_halves(scaled[block], first, tolerance))
            number += [count, count]
        else:
            corners.append(scaled[block])
            number.append(count)
        first += len(block)
    parts, of = np.concatenate(corners), np.concatenate(number)
    area = areas(parts)
    large = np.abs(area) > FLAT * tolerance * longest(parts)
    flat = np.setdiff1d(of, of[large])
    if len(flat):
        px, py = grid.in_metres(parts[of == flat[0]].mean(axis=(0, 1)))
        raise InputError(
            f"mesh: {len(flat)} of its elements have no area, the first is element {flat[0]} at "
            f"({px:g}, {py:g}) m: expected elements that are not flat on cells of {grid.h:g} m; "
            "remove them from the mesh (lengths are metres)"
        )
    parts[area < 0] = parts[area < 0][:, ::-1]
    return Elements(parts[large], of[large], material[of[large]], tolerance)


def _check_nodes(grid: Grid, x: Array, scaled: Array, block: Indices, first: int) -> None:
    inside = (scaled >= 0) & (scaled <= grid.cells)
    wrong = np.argwhere(~inside.all(axis=1)[block])
    if len(wrong):
        element, corner = wrong[0]
        px, py = x[block[element, corner]]
        raise InputError(
            f"mesh: element {first + element} has a node at ({px:g}, {py:g}) m, outside the grid, "
            f"{grid.extent}; enlarge the grid or move the mesh (lengths are metres)"
        )


def _halves(corners: Array, first: int, tolerance: float) -> tuple[Array, Array]:
    """Two triangles of each quadrilateral (n x 4 x 2), divided along a diagonal that is inside it.

    One of them has no area if two corners are at the same place, as in triangles that are stored as
    quadrilaterals.
    """
    along = [(corners[:, a], corners[:, b]) for a, b in DIAGONALS]
    area = np.array([[areas(half) for half in halves] for halves in along])
    thinner = np.abs(area).min(axis=1)
    inside = np.where(area[:, 0] * area[:, 1] > 0, thinner, -thinner)
    side = np.array([longest(a) for a, _ in along])
    twisted = np.flatnonzero((inside < -tolerance * side).all(axis=0))
    if len(twisted):
        raise InputError(
            f"mesh: {len(twisted)} of its quadrilaterals cross themselves, the first is element "
            f"{first + twisted[0]}: expected their corners in order around them"
        )
    take = ((inside[0] > 0) | (inside[0] >= inside[1]))[:, None, None]
    a, b = (np.where(take, along[0][k], along[1][k]) for k in range(2))
    return a, b


def longest(triangles: Array) -> Array:
    """Longest side of triangles, n x 3 x 2."""
    sides = triangles - np.roll(triangles, -1, axis=1)
    return np.asarray(np.linalg.norm(sides, axis=2).max(axis=1))


def check_apart(grid: Grid, elements: Elements) -> None:
    """Check that no two elements overlap by more than the tolerance.

    Every triangle is made smaller by moving its sides inwards, which scales it about the centre of its
    inscribed circle. Two of these that meet have a disc in common.

    Raises:
        InputError: Two elements overlap.
    """
    import shapely

    x, depth = elements.corners, DEEP * elements.tolerance
    opposite = np.linalg.norm(np.roll(x, -1, axis=1) - np.roll(x, 1, axis=1), axis=2)
    around = opposite.sum(axis=1)
    radius = 2 * areas(x) / around
    centre = (x * (opposite / around[:, None])[..., None]).sum(axis=1)
    large = np.flatnonzero(radius > depth)
    share = (1 - depth / radius[large])[:, None, None]
    shapes = shapely.polygons(centre[large, None] + share * (x[large] - centre[large, None]))
    a, b = large[shapely.STRtree(shapes).query(shapes, predicate="intersects")]
    wrong = np.flatnonzero(elements.number[a] < elements.number[b])
    if not len(wrong):
        return
    a, b = a[wrong[0]], b[wrong[0]]
    common = shapely.intersection(*shapely.polygons(x[[a, b]]))
    px, py = grid.in_metres(shapely.get_coordinates(common.centroid)[0])
    raise InputError(
        f"mesh: elements {elements.number[a]} and {elements.number[b]} overlap by "
        f"{common.area * grid.h**2:.3g} m2 near ({px:g}, {py:g}) m: one is turned inside out, both are "
        "the same, or two surfaces lie over each other; expected every point in one element (to "
        f"{2 * depth * grid.h:.2g} m)"
    )


def by_cells(grid: Grid, elements: Elements, num_materials: int) -> tuple[Indices, Indices, Points]:
    """The parts of elements in each cell of this rank; a collective call.

    Returns:
        Numbers of the cells that are filled by one material; this material; points that integrate over
        the other parts.
    """
    triangles, of = _cut(grid, elements.corners)
    area = areas(triangles)
    large = area > 0
    triangles, of, area = triangles[large], of[large], area[large]
    cell = grid.cell_numbers(grid.cell_at(triangles.mean(axis=1)))
    mine = dealt(grid, cell)
    triangles, of, area, cell = triangles[mine], of[mine], area[mine], cell[mine]
    key, place = np.unique(cell * num_materials + elements.material[of], return_inverse=True)
    covered = np.bincount(place.ravel(), area, len(key)) > 1 - COVERED
    full, rest = key[covered], ~covered[place.ravel()]
    cut = in_triangles(triangles[rest], cell[rest], elements.material[of[rest]])
    return full // num_materials, full % num_materials, cut


def _cut(grid: Grid, corners: Array) -> tuple[Array, Indices]:
    """Triangles cut by this rank's cells into triangles, and the triangle that each is a part of."""
    import shapely

    low = np.floor(corners.min(axis=1)).astype(np.int64)
    high = np.maximum(np.ceil(corners.max(axis=1)).astype(np.int64), low + 1)
    size = high - low
    alone = (size == 1).all(axis=1)
    many = np.flatnonzero(~alone)
    if not len(many):
        return corners, np.arange(len(corners))
    count = size[many].prod(axis=1)
    of = np.repeat(many, count)
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    cell = low[of] + np.column_stack([step % size[of, 0], step // size[of, 0]])  # x fastest
    mine = dealt(grid, grid.cell_numbers(cell))
    of, cell = of[mine], cell[mine]
    parts = shapely.intersection(shapely.polygons(corners)[of], clipping.squares(cell))
    some = shapely.area(parts) > 0
    parts, of = parts[some], of[some]
    fans, of_fan = _fans(parts)
    return (
        np.concatenate([corners[alone], fans]),
        np.concatenate([np.flatnonzero(alone), of[of_fan]]),
    )


def _fans(parts: Any) -> tuple[Array, Indices]:
    """Triangles of convex polygons, counter-clockwise, and the polygon of each."""
    import shapely

    x, of = shapely.get_coordinates(shapely.normalize(parts), return_index=True)
    first = np.searchsorted(of, np.arange(len(parts)))
    last = np.append(first[1:], len(x)) - 1  # the first corner again
    inner = np.ones(len(x), dtype=bool)
    inner[first] = inner[last] = False
    inner[np.maximum(last - 1, first)] = False
    k = np.flatnonzero(inner)
    fans = np.stack([x[first[of[k]]], x[k], x[k + 1]], axis=1)
    clockwise = areas(fans) < 0
    fans[clockwise] = fans[clockwise][:, ::-1]
    return fans, of[k]
