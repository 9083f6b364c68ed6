"""The border of a mesh: sides of elements that belong to one element, with the names of their groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tawami.base import text
from tawami.base.arrays import Array, Indices
from tawami.base.errors import GeometryWarning
from tawami.base.warn import warn
from tawami.body import clipping, elements
from tawami.body.groups import PHYSICAL
from tawami.border.pieces import Border
from tawami.border.polyline import straight
from tawami.grid.grid import Grid

#: Elements that are lines; their first two nodes are the ends.
LINES = ("line", "line3", "line4", "line5")
#: Name of sides without a group.
UNNAMED = "border"


def border(grid: Grid, read: Any, x: Array, blocks: Sequence[Indices]) -> Border:
    """The border of the elements of a mesh.

    Sides of two elements are inside of the body. So are sides that lie on each other, where surfaces
    have their own nodes or nodes hang.

    Args:
        grid: The grid.
        read: The mesh, of meshio.
        x: Positions of the nodes [m].
        blocks: Corners of the elements that are used, n x 3 or n x 4.

    Warns:
        GeometryWarning: A side is in several groups.
    """
    used = np.unique(np.concatenate([block.ravel() for block in blocks]))
    scaled = np.full(x.shape, np.nan)
    scaled[used] = clipping.on_lines(grid, x[used])
    sides = np.concatenate([_sides(scaled, block) for block in blocks])
    sides = sides[sides[:, 0] != sides[:, 1]]  # triangles that are stored as quadrilaterals
    _, of, count = np.unique(
        np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    sides = sides[count[of.ravel()] == 1]
    groups = _line_groups(read) or _node_groups(read, sides)
    ends = grid.in_metres(scaled)
    whole = straight(ends[sides[:, 0]], ends[sides[:, 1]], _names(sides, groups))
    return whole.outside(2 * elements.DEEP * clipping.tolerance(scaled) * grid.h)


def _sides(x: Array, block: Indices) -> Indices:
    """Nodes at both ends of each side of elements, with the element on the left."""
    after = np.roll(block, -1, axis=1)
    a, b = x[block], x[after]
    area = (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).sum(axis=1)
    sides = np.stack([block, after], axis=-1)
    sides[area < 0] = sides[area < 0][..., ::-1]
    return np.asarray(sides.reshape(-1, 2))


def _line_groups(read: Any) -> dict[str, Indices]:
    """Sides of each group of lines (n x 2 nodes): physical groups of Gmsh, or cell sets."""
    found = dict[str, list[Indices]]()
    named = {abs(int(n)): name for name, (n, dim) in read.field_data.items() if int(dim) == 1}
    for k, block in enumerate(read.cells):
        if block.type not in LINES or not len(block.data):
            continue
        ends = np.asarray(block.data)[:, :2]
        for name, of_block in read.cell_sets.items():
            if not name.startswith("gmsh:") and of_block[k] is not None and len(of_block[k]):
                found.setdefault(str(name), []).append(
                    ends[np.asarray(of_block[k], dtype=np.int64)]
                )
        if PHYSICAL in read.cell_data:
            values = np.abs(np.ravel(read.cell_data[PHYSICAL][k]))
            for number in np.unique(values[values != 0]):
                name = str(named.get(int(number), int(number)))
                found.setdefault(name, []).append(ends[values == number])
    return {
        name: np.unique(np.sort(np.concatenate(parts), axis=1), axis=0)
        for name, parts in found.items()
    }


def _node_groups(read: Any, sides: Indices) -> dict[str, Indices]:
    """Sides of each set of nodes, which holds both ends; of several sets, the smallest has a side."""
    found, taken = dict[str, Indices](), np.zeros(len(sides), dtype=bool)
    for name, nodes in sorted(read.point_sets.items(), key=lambda item: len(item[1])):
        members = np.isin(sides, nodes).all(axis=1) & ~taken
        taken |= members
        found[str(name)] = np.sort(sides[members], axis=1)
    return found


def _names(sides: Indices, groups: dict[str, Indices]) -> list[str]:
    """The name of each side."""
    number = {tuple(side): k for k, side in enumerate(np.sort(sides, axis=1).tolist())}
    names = [""] * len(sides)
    several = dict[str, None]()
    for name, members in groups.items():
        for side in members.tolist():
            k = number.get(tuple(side), -1)
            if k >= 0 and names[k]:
                several[f"'{names[k]}' and '{name}'"] = None
            elif k >= 0:
                names[k] = name
    if several:
        warn(
            f"mesh: sides of its border are in several groups ({text.listed(list(several))}): each "
            "has the name of the first one; remove them from the others to use these by name",
            GeometryWarning,
        )
    return [name or UNNAMED for name in names]
