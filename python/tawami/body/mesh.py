"""Bodies from finite element meshes of other programs."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tawami.base.checks import one_of, path, shown
from tawami.base.errors import GeometryWarning, InputError
from tawami.base.files import unreadable
from tawami.body import cut_cells, elements
from tawami.body.body import Body
from tawami.body.cut_cells import Numbers
from tawami.grid.grid import Grid

if TYPE_CHECKING:
    import meshio

Array = npt.NDArray[np.float64]
#: Corners of the elements that are taken, and of those that are passed over: sides and points.
CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
SIDES = ("vertex", "line", "line3", "line4", "line5")
#: What Gmsh calls the array of the physical groups.
PHYSICAL = "gmsh:physical"
#: Nodes in the middle of sides that are off by this share of the side make it curved.
STRAIGHT = 1e-6


def mesh(
    grid: Grid,
    source: str | Path | meshio.Mesh,
    *,
    tags: str | None = None,
    per_axis: int = 2,
    gauss: bool = False,
) -> Body:
    """The elements of a mesh filled with particles, each group of elements of a material of its own.

    Triangles and quadrilaterals of any size beside the cells of the grid, linear or quadratic; these
    with straight sides between their corners, and a warning where they have others. A cell that one
    group fills gets `per_axis` x `per_axis` particles; of what a group has of another cell there are
    at most 28, whose volumes and moments up to degree 6 are those of its elements, to round-off.

    Args:
        grid: The grid.
        source: A file of any format that meshio reads (Gmsh's .msh, .vtu, .vtk, .inp, ...), or its
            Mesh. A third coordinate must be the same everywhere.
        tags: What tells the groups: the name of an array of cell data with whole numbers, or 'sets'
            for the cell sets of the mesh; by default Gmsh's physical groups where there are some,
            else the cell sets where there are some, else one group of all elements. `Body.names`
            are their names, or their numbers where they have none, in the order of the numbers.
        per_axis: Particles per full cell and axis.
        gauss: Put those at the Gauss points, with the Gauss weights, instead of evenly.

    Raises:
        InputError: A file that is not there or cannot be read; no triangles or quadrilaterals, or
            solids; elements outside the grid, without an area, turned inside out or one over another;
            a tag that is not there.

    Warns:
        GeometryWarning: Quadratic elements with curved sides.
    """
    cut_cells.check("mesh", grid, per_axis, gauss)
    read = _read(source)
    x = _plane(read)
    blocks = _blocks(read)
    tag, names = _tags(read, blocks, tags)
    _warn_of_curved_sides(read, blocks, x)
    parts = elements.triangles(grid, x, [b.data[:, : CORNERS[b.type]] for _, b in blocks], tag)
    elements.check_apart(grid, parts)
    full, of_full, cut, of_cut = elements.by_cells(grid, parts, len(names))
    whole = cut_cells.in_full_cells(full, per_axis, gauss)
    thin, weight, first = cut_cells.thinned(cut, len(full))
    positions = np.concatenate([whole.x, thin])
    volume = np.concatenate([whole.weight, weight])
    material = np.concatenate([np.repeat(of_full, per_axis**2), of_cut[first]])
    return Body(
        grid.origin + grid.h * positions, grid.h**2 * volume, material.astype(np.uint32), names
    )


# -- what the file holds -----------------------------------------------------


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
    except (Exception, SystemExit) as error:  # meshio ends the program where no reader fits
        said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise InputError(
            f"mesh: meshio cannot read '{source}' ({said}): expected a format that it knows, by the "
            "ending of the name; convert it with `meshio convert`"
        ) from error


def _plane(read: Any) -> Array:
    """Positions of the nodes [m], nodes x 2."""
    points = np.asarray(read.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"mesh: points of shape {points.shape}: expected nodes x 2 or 3")
    if points.shape[1] == 3 and len(points):
        z = points[:, 2]
        if not np.ptp(z) <= 1e-9 * np.nanmax(np.abs(points)):
            raise InputError(
                f"mesh: its nodes have z from {z.min():g} to {z.max():g} m: expected a plane mesh, "
                "with one z everywhere"
            )
    return points[:, :2]


def _blocks(read: Any) -> list[tuple[int, Any]]:
    """The blocks of plane elements with their numbers among all blocks."""
    found = [(k, block) for k, block in enumerate(read.cells) if len(block.data)]
    others = [b.type for _, b in found if b.type not in CORNERS and b.type not in SIDES]
    if others:
        raise InputError(
            f"mesh: it holds elements '{others[0]}': expected triangles and quadrilaterals, linear or "
            "quadratic (points and lines are passed over)"
        )
    blocks = [(k, block) for k, block in found if block.type in CORNERS]
    if not blocks:
        raise InputError(
            f"mesh: it holds {', '.join(sorted({b.type for _, b in found})) or 'no elements'}: expected "
            "triangles or quadrilaterals; in Gmsh the surface must be meshed and in a physical group"
        )
    return blocks


def _tags(
    read: Any, blocks: list[tuple[int, Any]], tags: str | None
) -> tuple[Numbers, tuple[str, ...]]:
    """Number of the group of each element, and the names of the groups."""
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
) -> tuple[Numbers, tuple[str, ...]]:
    """As `_tags`, from cell sets; those without plane elements are passed over."""
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
    whole = np.concatenate(group)
    if (whole < 0).any():
        raise InputError(
            f"mesh: {(whole < 0).sum()} elements, the first is {np.flatnonzero(whole < 0)[0]}, are in "
            f"none of the cell sets ({', '.join(map(repr, sets)) or 'there are none'}): expected each "
            "in one; name an array of cell data with tags=..."
        )
    return whole, tuple(names)


def _warn_of_curved_sides(read: Any, blocks: list[tuple[int, Any]], x: Array) -> None:
    furthest = 0.0
    for _, block in blocks:
        n = CORNERS[block.type]
        if block.data.shape[1] >= 2 * n:
            corner, middle = x[block.data[:, :n]], x[block.data[:, n : 2 * n]]
            after = np.roll(corner, -1, axis=1)
            side = np.linalg.norm(after - corner, axis=2)
            off = np.linalg.norm(middle - (corner + after) / 2, axis=2)
            furthest = max(furthest, float((off / np.maximum(side, 1e-300)).max()))
    if furthest > STRAIGHT:
        warnings.warn(
            f"mesh: quadratic elements have curved sides, by up to {furthest:.2g} of a side: they are "
            "taken as straight between their corners; refine the mesh where that matters",
            GeometryWarning,
            stacklevel=3,
        )
