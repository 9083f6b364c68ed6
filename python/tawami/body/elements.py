"""Elements of a mesh: their checks, and their parts in each cell of the grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.body import clipping
from tawami.body.points import ROUND_OFF, Points, areas, in_triangles
from tawami.grid.grid import Grid

#: A cell is full if less than this share is not covered. More than this share above 1 is an overlap.
COVERED = 1e-9


@dataclass(frozen=True)
class Elements:
    """Triangles of a mesh; a quadrilateral is two triangles.

    Attributes:
        corners: Positions [cells], counter-clockwise, n x 3 x 2.
        nodes: Their numbers in the mesh, n x 3.
        number: Number of the element among the elements that are used, n.
        material: Number of the material of each triangle, n.
    """

    corners: Array
    nodes: Indices
    number: Indices
    material: Indices


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
    scaled = clipping.on_lines(grid, x)
    nodes, number, first = list[Indices](), list[Indices](), 0
    for block in blocks:
        count = np.arange(first, first + len(block))
        _check_nodes(grid, x, scaled, block, first)
        if block.shape[1] == 4:
            nodes += list(_halves(scaled, block, first))
            number += [count, count]
        else:
            nodes.append(block)
            number.append(count)
        first += len(block)
    all_nodes, all_numbers = np.concatenate(nodes).astype(np.int64), np.concatenate(number)
    area = areas(scaled[all_nodes])
    flat = np.flatnonzero(np.abs(area) <= ROUND_OFF)
    if len(flat):
        raise InputError(
            f"mesh: {len(flat)} of its triangles have no area, the first in element "
            f"{all_numbers[flat[0]]}: expected elements that are not flat"
        )
    turned = area < 0
    all_nodes[turned] = all_nodes[turned][:, ::-1]
    return Elements(scaled[all_nodes], all_nodes, all_numbers, material[all_numbers])


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


def _halves(x: Array, quads: Indices, first: int) -> tuple[Indices, Indices]:
    """Two triangles of each quadrilateral, divided along a diagonal that is inside it."""
    along = (quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]), (quads[:, [1, 2, 3]], quads[:, [1, 3, 0]])
    signs = [np.sign(areas(x[a])) * np.sign(areas(x[b])) for a, b in along]
    twisted = np.flatnonzero((signs[0] <= 0) & (signs[1] <= 0))
    if len(twisted):
        raise InputError(
            f"mesh: {len(twisted)} of its quadrilaterals cross themselves, the first is element "
            f"{first + twisted[0]}: expected their corners in order around them"
        )
    take = (signs[0] > 0)[:, None]
    a, b = (np.where(take, along[0][k], along[1][k]) for k in range(2))
    return a, b


def check_apart(grid: Grid, elements: Elements) -> None:
    """Check that no two elements overlap.

    They do if both lie on the same side of a common side, if the middle of one is in another, or if
    sides of the border cross.

    Raises:
        InputError: Two elements overlap.
    """
    import shapely

    sides = np.concatenate([elements.nodes[:, [k, (k + 1) % 3]] for k in range(3)])
    of = np.tile(np.arange(len(elements.nodes)), 3)
    width = int(elements.nodes.max()) + 1
    key = sides @ [width, 1]
    order = np.argsort(key, kind="stable")
    twice = np.flatnonzero(np.diff(key[order]) == 0)
    if len(twice):
        _overlap(grid, elements, of[order[twice[0]]], of[order[twice[0] + 1]])
    shapes = shapely.polygons(elements.corners)
    middle = shapely.points(elements.corners.mean(axis=1))
    tree = shapely.STRtree(shapes)
    point, shape = tree.query(middle, predicate="within")
    wrong = np.flatnonzero(point != shape)
    if len(wrong):
        _overlap(grid, elements, point[wrong[0]], shape[wrong[0]])
    border = ~np.isin(key, sides[:, ::-1] @ [width, 1])
    corner = np.concatenate([elements.corners[:, [k, (k + 1) % 3]] for k in range(3)])[border]
    lines = shapely.linestrings(corner)
    a, b = shapely.STRtree(lines).query(lines, predicate="crosses")
    if len(a):
        _overlap(grid, elements, of[border][a[0]], of[border][b[0]])


def _overlap(grid: Grid, elements: Elements, a: int, b: int) -> NoReturn:
    x, y = grid.in_metres(elements.corners[a].mean(axis=0))
    raise InputError(
        f"mesh: elements {elements.number[a]} and {elements.number[b]} overlap near ({x:g}, {y:g}) m: "
        "one is turned inside out, or both are the same; expected every point in one element"
    )


def by_cells(grid: Grid, elements: Elements, num_materials: int) -> tuple[Indices, Indices, Points]:
    """The parts of elements in each cell.

    Returns:
        Numbers of the cells that are filled by one material; this material; points that integrate over
        the other parts.

    Raises:
        InputError: Elements cover more than a cell.
    """
    triangles, of = _cut(elements.corners)
    area = areas(triangles)
    large = area > 0
    triangles, of, area = triangles[large], of[large], area[large]
    cell = grid.cell_numbers(grid.cell_at(triangles.mean(axis=1)))
    key = cell * num_materials + elements.material[of]
    covered = np.bincount(key, area, minlength=grid.num_cells * num_materials)
    in_cell = covered.reshape(-1, num_materials).sum(axis=1)
    worst = int(in_cell.argmax())
    if in_cell[worst] > 1 + COVERED:
        x, y = grid.in_metres(grid.cell_indices(np.array(worst)) + 0.5)
        raise InputError(
            f"mesh: its elements cover {in_cell[worst]:.6g} times the cell at ({x:g}, {y:g}) m: "
            "expected every point in one element"
        )
    full = np.flatnonzero(covered > 1 - COVERED)
    rest = covered[key] <= 1 - COVERED
    cut = in_triangles(triangles[rest], cell[rest], elements.material[of[rest]])
    return full // num_materials, full % num_materials, cut


def _cut(corners: Array) -> tuple[Array, Indices]:
    """Triangles cut by the cells into triangles, and the triangle that each is a part of."""
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
