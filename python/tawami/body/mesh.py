"""Bodies from finite element meshes of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.errors import GeometryWarning, InputError
from tawami.base.warn import warn
from tawami.body import clipping, elements, facets, mesh_files
from tawami.body.body import Body
from tawami.body.filling import PER_AXIS, Filling
from tawami.body.groups import materials
from tawami.grid.grid import Grid

if TYPE_CHECKING:
    import meshio

#: Corners of the elements that are used.
CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
#: Elements that are ignored: points and lines.
IGNORED = ("vertex", "line", "line3", "line4", "line5")


def mesh(
    grid: Grid,
    source: str | Path | meshio.Mesh,
    *,
    tags: str | None = None,
    groups: Sequence[str] | None = None,
    per_axis: int = PER_AXIS,
    gauss: bool = False,
) -> Body:
    """The elements of a mesh filled with particles; each group of elements has its own material.
    A call for all ranks, each of which reads the mesh.

    The elements are triangles and quadrilaterals of any size, linear or quadratic. The sides of
    quadratic elements are taken as straight, with a warning if they are not. A cell that one group
    fills gets `per_axis` x `per_axis` particles. In any other cell each group gets at most 28, which
    have the volume and the moments up to degree 6 of its elements, to round-off.

    Nodes may be rounded: positions that differ by less than 1e-6 of the size of the mesh, or of a cell
    if that is larger, are the same. Nodes this near to a line of the grid are moved onto it, the mesh
    is plane if z varies by less, and gaps and overlaps of four times this width are accepted. Sides may
    have hanging nodes, or two surfaces their own nodes along a common side.

    The sides of the border have the names of the groups of lines in the mesh: physical groups of curves
    in Gmsh, cell sets of lines, submodel parts with conditions in Kratos; in Abaqus, node sets that hold
    both ends of a side. Sides in no group are named 'border'.

    Args:
        grid: The grid.
        source: A mesh of meshio, or a file: .msh of Gmsh, .inp of Abaqus, .mdpa of Kratos, .vtu, .vtk
            and others that meshio reads. If it has a third coordinate, this must be the same at all
            nodes of elements.
        tags: Source of the groups: the name of an array of cell data with whole numbers, or
            'sets' for the cell sets of the mesh. By default Gmsh's physical groups if there are any,
            else the cell sets if there are any, else all elements are one group. `Body.names` are the
            names of the groups in the order of their numbers, or the numbers if they have no names.
        groups: Names of the groups that are the body, in the order of their numbers, where a mesh has
            more groups than materials. Elements in none of them are left out. By default every element
            must be in one group.
        per_axis: Particles per full cell and axis.
        gauss: Place the particles of full cells at the Gauss points with the Gauss weights.

    Raises:
        InputError: The file does not exist or cannot be read; it has no triangles or quadrilaterals,
            or has solids; elements are outside the grid, have no area, are turned inside out or
            overlap; the tags or groups do not exist; or an element is in several groups or in none.

    Warns:
        GeometryWarning: Quadratic elements have curved sides, sides of the border are in several groups,
            or meshio has a warning.
    """
    filling = Filling("mesh", grid, per_axis, gauss)
    read = mesh_files.read(source)
    blocks = _blocks(read)
    material, names = materials(read, blocks, tags, groups)
    ends = np.cumsum([len(block.data) for _, block in blocks])[:-1]
    nodes = [
        (CORNERS[block.type], block.data[of >= 0])
        for (_, block), of in zip(blocks, np.split(material, ends), strict=True)
    ]
    corners = [data[:, :n] for n, data in nodes]
    x = _plane(grid, read, np.unique(np.concatenate([c.ravel() for c in corners])))
    material = material[material >= 0]
    parts = elements.triangles(grid, x, corners, material)
    elements.check_apart(grid, parts)
    _warn_of_curved_sides(nodes, x, elements.DEEP * parts.tolerance * grid.h)
    full, of_full, cut = elements.by_cells(grid, parts, max(len(names), 1))
    border = facets.border(grid, read, x, corners)
    return filling.body(full, cut, material=of_full, names=names, border=border)


def _plane(grid: Grid, read: Any, used: Indices) -> Array:
    """Positions of the nodes [m], nodes x 2; those of elements must lie in a plane."""
    points = np.asarray(read.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"mesh: points of shape {points.shape}: expected nodes x 2 or 3")
    plane = points[:, :2]
    if points.shape[1] == 3:
        z = points[used, 2]
        if not np.ptp(z) <= clipping.tolerance(grid.in_cells(plane[used])) * grid.h:
            raise InputError(
                f"mesh: its nodes have z from {z.min():g} to {z.max():g} m: expected a plane mesh in "
                "x and y, with one z everywhere"
            )
    return plane


def _blocks(read: Any) -> list[tuple[int, Any]]:
    """The blocks of plane elements, each with its number among all blocks."""
    found = [(k, block) for k, block in enumerate(read.cells) if len(block.data)]
    others = [b.type for _, b in found if b.type not in CORNERS and b.type not in IGNORED]
    if others:
        raise InputError(
            f"mesh: it holds elements '{others[0]}': expected triangles and quadrilaterals, linear or "
            "quadratic (points and lines are ignored)"
        )
    blocks = [(k, block) for k, block in found if block.type in CORNERS]
    for _, block in blocks:
        if block.data.min() < 0 or block.data.max() >= len(read.points):
            raise InputError(
                f"mesh: its elements have nodes {block.data.min()} to {block.data.max()}: expected "
                f"numbers from 0 to {len(read.points) - 1}, as there are {len(read.points)} nodes"
            )
    if not blocks:
        raise InputError(
            f"mesh: it holds {', '.join(sorted({b.type for _, b in found})) or 'no elements'}: expected "
            "triangles or quadrilaterals; mesh the surface before the file is saved (Gmsh saves only "
            "physical groups, if there are any)"
        )
    return blocks


def _warn_of_curved_sides(nodes: list[tuple[int, Indices]], x: Array, rounding: float) -> None:
    """Warn of middle nodes that are off their side by more than rounding [m]."""
    furthest = 0.0
    for n, data in nodes:
        if data.shape[1] >= 2 * n:
            corner, middle = x[data[:, :n]], x[data[:, n : 2 * n]]
            after = np.roll(corner, -1, axis=1)
            side = np.linalg.norm(after - corner, axis=2)
            off = np.linalg.norm(middle - (corner + after) / 2, axis=2)
            share = off / np.maximum(side, 1e-300)
            furthest = max(furthest, float(share[off > rounding].max(initial=0.0)))
    if furthest > 0:
        warn(
            f"mesh: quadratic elements have curved sides, by up to {furthest:.2g} of a side: they are "
            "taken as straight between their corners; refine the mesh if this is not accurate enough",
            GeometryWarning,
        )
