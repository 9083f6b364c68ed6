"""Elements of a mesh: checks, and what of them lies in which cell of the grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from tawami.base.errors import InputError
from tawami.body import cut_cells
from tawami.body.cut_cells import ROUND_OFF, Numbers, Points, areas, on_lines
from tawami.grid.grid import Grid

Array = npt.NDArray[np.float64]
#: A cell covered but for this share is full; one covered by this share more has an overlap.
COVERED = 1e-9


@dataclass(frozen=True)
class Elements:
    """Triangles of a mesh; a quadrilateral is two.

    Attributes:
        corners: Counter-clockwise [cells], n x 3 x 2.
        nodes: Their numbers in the mesh, n x 3.
        number: Of the element in the mesh, counted over the elements that are taken.
        tag: Number of the material of each.
    """

    corners: Array
    nodes: Numbers
    number: Numbers
    tag: Numbers


def triangles(grid: Grid, x: Array, blocks: list[Numbers], tag: Numbers) -> Elements:
    """The elements of a mesh as triangles.

    Args:
        grid: The grid.
        x: Positions of the nodes [m].
        blocks: Nodes of triangles (n x 3) and quadrilaterals (n x 4).
        tag: Number of the group of each element.
    """
    scaled = on_lines((x - grid.origin) / grid.h)
    nodes, number, first = list[Numbers](), list[Numbers](), 0
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
            f"mesh: element {all_numbers[flat[0]]} and {len(flat) - 1} others have no area: expected "
            "none that is flat"
        )
    turned = area < 0
    all_nodes[turned] = all_nodes[turned][:, ::-1]
    return Elements(scaled[all_nodes], all_nodes, all_numbers, tag[all_numbers])


def _check_nodes(grid: Grid, x: Array, scaled: Array, block: Numbers, first: int) -> None:
    inside = (scaled >= 0) & (scaled <= grid.cells)
    wrong = np.argwhere(~inside.all(axis=1)[block])
    if len(wrong):
        element, corner = wrong[0]
        px, py = x[block[element, corner]]
        raise InputError(
            f"mesh: element {first + element} has a node at ({px:g}, {py:g}) m, outside the grid, "
            f"{grid.extent}; enlarge the grid or move the mesh (lengths are metres)"
        )


def _halves(x: Array, quads: Numbers, first: int) -> tuple[Numbers, Numbers]:
    """Two triangles of each quadrilateral, on that diagonal which is inside of it."""
    along = (quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]), (quads[:, [1, 2, 3]], quads[:, [1, 3, 0]])
    signs = [np.sign(areas(x[a])) * np.sign(areas(x[b])) for a, b in along]
    twisted = np.flatnonzero((signs[0] <= 0) & (signs[1] <= 0))
    if len(twisted):
        raise InputError(
            f"mesh: quadrilateral {first + twisted[0]} and {len(twisted) - 1} others cross themselves: "
            "expected their corners in order around them"
        )
    take = (signs[0] > 0)[:, None]
    a, b = (np.where(take, along[0][k], along[1][k]) for k in range(2))
    return a, b


def check_apart(grid: Grid, elements: Elements) -> None:
    """Whether no element lies over another: no side with two on the same side of it, no middle of one
    in another, no border across another.
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
    x, y = grid.origin + grid.h * elements.corners[a].mean(axis=0)
    raise InputError(
        f"mesh: elements {elements.number[a]} and {elements.number[b]} lie over each other near "
        f"({x:g}, {y:g}) m: one is turned inside out, or is there twice; expected every point in one "
        "element"
    )


def by_cells(
    grid: Grid, elements: Elements, groups: int
) -> tuple[Numbers, Numbers, Points, Numbers]:
    """Cells that a group fills and the group, points that integrate over the rest and their group.

    The points of a group in a cell have a cell of their own, (cell, group), to be thinned out alone.
    """
    (nx, ny), groups = grid.cells, max(groups, 1)
    triangles, of = _cut(elements.corners, grid.cells)
    area = areas(triangles)
    large = area > 0
    triangles, of, area = triangles[large], of[large], area[large]
    cell = np.floor(triangles.mean(axis=1)).astype(np.int64)
    key = (cell @ [1, nx]) * groups + elements.tag[of]
    covered = np.bincount(key, area, minlength=nx * ny * groups)
    in_cell = covered.reshape(-1, groups).sum(axis=1)
    worst = int(in_cell.argmax())
    if in_cell[worst] > 1 + COVERED:
        x, y = grid.origin + grid.h * (np.array([worst % nx, worst // nx]) + 0.5)
        raise InputError(
            f"mesh: its elements cover {in_cell[worst]:.6g} times the cell at ({x:g}, {y:g}) m: "
            "expected every point in one element"
        )
    full = np.flatnonzero(covered > 1 - COVERED)
    rest = covered[key] <= 1 - COVERED
    points = cut_cells.in_triangles(
        triangles[rest], np.column_stack([key[rest], np.zeros_like(key[rest])])
    )
    group = np.repeat(elements.tag[of[rest]], len(points.x) // max(rest.sum(), 1))
    place = full // groups
    return np.column_stack([place % nx, place // nx]), full % groups, points, group


def _cut(corners: Array, cells: tuple[int, int]) -> tuple[Array, Numbers]:
    """Triangles cut by cells into triangles, and which one each is a part of."""
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
    cell = low[of] + np.column_stack([step % size[of, 0], step // size[of, 0]])
    boxes = shapely.box(*cell.T, *(cell + 1).T)
    parts = shapely.intersection(shapely.polygons(corners)[of], boxes)
    some = shapely.area(parts) > 0
    parts, of = parts[some], of[some]
    fans, of_fan = _fans(parts)
    return (
        np.concatenate([corners[alone], fans]),
        np.concatenate([np.flatnonzero(alone), of[of_fan]]),
    )


def _fans(parts: Any) -> tuple[Array, Numbers]:
    """Triangles of convex polygons, counter-clockwise, and which one each is of."""
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
