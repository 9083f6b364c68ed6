"""Bodies from finite element meshes of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.checks import one_of, path, shown
from tawami.base.errors import GeometryWarning, InputError
from tawami.base.files import unreadable
from tawami.base.warn import warn
from tawami.body import clipping, elements
from tawami.body.body import Body
from tawami.body.filling import PER_AXIS, Filling
from tawami.grid.grid import Grid

if TYPE_CHECKING:
    import meshio

#: Corners of the elements that are used.
CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
#: Elements that are ignored: points and lines.
IGNORED = ("vertex", "line", "line3", "line4", "line5")
#: Name that Gmsh gives to the array of the physical groups.
PHYSICAL = "gmsh:physical"


def mesh(
    grid: Grid,
    source: str | Path | meshio.Mesh,
    *,
    tags: str | None = None,
    per_axis: int = PER_AXIS,
    gauss: bool = False,
) -> Body:
    """The elements of a mesh filled with particles; each group of elements has its own material.

    The elements are triangles and quadrilaterals of any size, linear or quadratic. The sides of
    quadratic elements are taken as straight, with a warning if they are not. A cell that one group
    fills gets `per_axis` x `per_axis` particles. In any other cell each group gets at most 28, which
    have the volume and the moments up to degree 6 of its elements, to round-off.

    Nodes may be rounded: positions that differ by less than 1e-6 of the size of the mesh, or of a cell
    if that is larger, are the same. Nodes this near to a line of the grid are moved onto it, the mesh
    is plane if z varies by less, and gaps and overlaps of four times this width are accepted. Sides may
    have hanging nodes, or two surfaces their own nodes along a common side.

    Args:
        grid: The grid.
        source: A mesh of meshio, or a file that meshio reads (Gmsh's .msh, .vtu, .vtk, .inp, ...). If
            it has a third coordinate, this must be the same at all nodes of elements.
        tags: What tells the groups apart: the name of an array of cell data with whole numbers, or
            'sets' for the cell sets of the mesh. By default Gmsh's physical groups if there are any,
            else the cell sets if there are any, else all elements are one group. `Body.names` are the
            names of the groups in the order of their numbers, or the numbers if they have no names.
        per_axis: Particles per full cell and axis.
        gauss: Place the particles of full cells at the Gauss points with the Gauss weights.

    Raises:
        InputError: The file does not exist or cannot be read; it has no triangles or quadrilaterals,
            or has solids; elements are outside the grid, have no area, are turned inside out or
            overlap; or the tags do not exist.

    Warns:
        GeometryWarning: Quadratic elements have curved sides.
    """
    filling = Filling("mesh", grid, per_axis, gauss)
    read = _read(source)
    blocks = _blocks(read)
    corners = [b.data[:, : CORNERS[b.type]] for _, b in blocks]
    x = _plane(grid, read, np.unique(np.concatenate([c.ravel() for c in corners])))
    material, names = _materials(read, blocks, tags)
    parts = elements.triangles(grid, x, corners, material)
    elements.check_apart(grid, parts)
    _warn_of_curved_sides(blocks, x, elements.DEEP * parts.tolerance * grid.h)
    full, of_full, cut = elements.by_cells(grid, parts, max(len(names), 1))
    return filling.body(full, cut, material=of_full, names=names)


# -- reading the mesh ----------------------------------------------------------


def _read(source: Any) -> Any:
    import meshio

    if isinstance(source, meshio.Mesh):
        return source
    if not isinstance(source, str | Path):
        raise InputError(
            f"mesh: source = {shown(source)}: expected the path of a mesh file or a meshio.Mesh"
        )
    problem = unreadable(path("mesh: source", source))
    if problem is not None:
        raise InputError(
            f"mesh: '{source}' cannot be read ({problem}): expected a mesh that meshio reads"
        )
    try:
        return meshio.read(source)
    except (Exception, SystemExit) as error:  # meshio ends the program if no reader fits
        reason = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise InputError(
            f"mesh: meshio cannot read '{source}' ({reason}): expected a format that it recognises by "
            "the extension of the name; convert it with `meshio convert`"
        ) from error


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
                f"mesh: its nodes have z from {z.min():g} to {z.max():g} m: expected a plane mesh, "
                "with one z everywhere"
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
    if not blocks:
        raise InputError(
            f"mesh: it holds {', '.join(sorted({b.type for _, b in found})) or 'no elements'}: expected "
            "triangles or quadrilaterals; in Gmsh the surface must be meshed and in a physical group"
        )
    return blocks


def _materials(
    read: Any, blocks: list[tuple[int, Any]], tags: str | None
) -> tuple[Indices, tuple[str, ...]]:
    """Number of the material of each element, and the names of the materials."""
    sets = {name: s for name, s in read.cell_sets.items() if not name.startswith("gmsh:")}
    if tags is None:
        used = PHYSICAL if PHYSICAL in read.cell_data else "sets" if sets else None
    else:
        used = tags
    if used is None:
        return np.zeros(sum(len(block.data) for _, block in blocks), dtype=np.int64), ()
    if isinstance(used, str) and used == "sets" and "sets" not in read.cell_data:
        return _of_sets(sets, blocks)
    if not one_of(used, read.cell_data):
        known = ", ".join(repr(name) for name in read.cell_data) or "none"
        raise InputError(
            f"mesh: tags = {shown(tags)}: it has no such cell data: expected one of its arrays "
            f"({known}), or 'sets' for its cell sets ({', '.join(map(repr, sets)) or 'none'})"
        )
    values = np.concatenate([np.asarray(read.cell_data[used][k]).ravel() for k, _ in blocks])
    numbers = values.astype(np.int64)
    if len(values) != sum(len(block.data) for _, block in blocks) or (numbers != values).any():
        raise InputError(f"mesh: cell data '{used}': expected a whole number for each element")
    known_names = {
        int(data[0]): str(name) for name, data in read.field_data.items() if int(data[1]) == 2
    }
    present, of_element = np.unique(numbers, return_inverse=True)
    return of_element, tuple(known_names.get(int(n), str(n)) for n in present)


def _of_sets(
    sets: dict[str, Any], blocks: list[tuple[int, Any]]
) -> tuple[Indices, tuple[str, ...]]:
    """The same from cell sets; sets without plane elements are ignored."""
    group = [np.full(len(block.data), -1) for _, block in blocks]
    names = list[str]()
    for name, of_block in sets.items():
        members = [np.asarray(of_block[k], dtype=np.int64) for k, _ in blocks]
        if not any(len(m) for m in members):
            continue
        for mine, chosen in zip(group, members, strict=True):
            if (mine[chosen] >= 0).any():
                other = names[int(mine[chosen].max())]
                raise InputError(
                    f"mesh: elements are in the cell sets '{other}' and '{name}': expected each in "
                    "one; name an array of cell data with tags=..."
                )
            mine[chosen] = len(names)
        names.append(name)
    of_element = np.concatenate(group)
    without = np.flatnonzero(of_element < 0)
    if len(without):
        raise InputError(
            f"mesh: {len(without)} elements, the first is {without[0]}, are in none of the cell sets "
            f"({', '.join(map(repr, sets)) or 'there are none'}): expected each in one; name an array "
            "of cell data with tags=..."
        )
    return of_element, tuple(names)


def _warn_of_curved_sides(blocks: list[tuple[int, Any]], x: Array, rounding: float) -> None:
    """Warn of middle nodes that are off their side by more than rounding [m]."""
    furthest = 0.0
    for _, block in blocks:
        n = CORNERS[block.type]
        if block.data.shape[1] >= 2 * n:
            corner, middle = x[block.data[:, :n]], x[block.data[:, n : 2 * n]]
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
