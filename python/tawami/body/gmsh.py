"""Files of Gmsh: meshio reads nodes and elements, this module the physical groups.

meshio keeps one physical group for each element, loses names that a line and a surface share, and does
not read version 4 if an entity is in no group (Gmsh's option Mesh.SaveAll).
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tawami.base.errors import InputError
from tawami.body.groups import PHYSICAL

#: Numbers of the physical groups of each surface.
OfSurface = dict[int, list[int]]


def is_gmsh(path: Path) -> bool:
    """Whether a file is of Gmsh, version 2 or later."""
    with path.open("rb") as file:
        return b"$MeshFormat" in file.read(200)


def read(path: Path, by_meshio: Callable[[Path, str], Any]) -> Any:
    """A mesh of meshio; its cell sets include the physical groups of surfaces.

    Args:
        path: The file.
        by_meshio: Reads a file of a format with meshio.

    Raises:
        InputError: The mesh is partitioned.
    """
    data = path.read_bytes()
    section = _section(data, b"Entities")
    if b"$PartitionedEntities" in data:
        raise InputError(
            f"mesh: '{path}' is partitioned: expected a mesh in one part; save it without partitions"
        )
    if section is None:
        mesh = by_meshio(path, "gmsh")
        groups = _groups_of_elements(mesh)
    else:
        with tempfile.TemporaryDirectory() as folder:
            rest = Path(folder) / path.name
            rest.write_bytes(data[: section.start()] + data[section.end() :])
            mesh = by_meshio(rest, "gmsh")
        groups = _groups_of_entities(mesh, _entities(data, section.group(1)))
    named = {abs(number): name for number, name in _names(data)}
    mesh.field_data = {named.get(n, str(n)): np.array([n, 2]) for n in sorted(groups)}
    mesh.cell_sets = {named.get(n, str(n)): groups[n] for n in sorted(groups)}
    first = [np.zeros(len(block.data), dtype=np.int64) for block in mesh.cells]
    for number in sorted(groups, reverse=True):
        for values, members in zip(first, groups[number], strict=True):
            values[members] = number
    mesh.cell_data[PHYSICAL] = first
    return mesh


def _section(data: bytes, name: bytes) -> re.Match[bytes] | None:
    return re.search(rb"\$" + name + rb"\s*?\n(.*?)\$End" + name + rb"\s*?\n", data, re.DOTALL)


def _names(data: bytes) -> list[tuple[int, str]]:
    """Numbers and names of the physical groups of surfaces."""
    section = _section(data, b"PhysicalNames")
    lines = (
        re.findall(rb'^\s*2\s+(-?\d+)\s+"(.*)"', section.group(1), re.MULTILINE) if section else []
    )
    return [(int(number), name.decode(errors="replace")) for number, name in lines]


def _entities(data: bytes, section: bytes) -> OfSurface:
    """Physical groups of the surfaces of a file of version 4."""
    head = re.search(rb"\$MeshFormat\s+(\S+)\s+(\d)\s+(\d)", data)
    version, binary, size = head.groups() if head else (b"4.1", b"0", b"8")
    take = _binary(section, int(size)) if binary == b"1" else _text(section)
    found = OfSurface()
    for dim, count in enumerate(take("size", 4)):
        for _ in range(count):
            (tag,) = take("int", 1)
            take("double", 3 if dim == 0 and version != b"4.0" else 6)
            numbers = take("int", take("size", 1)[0])
            if dim > 0:
                take("int", take("size", 1)[0])  # what bounds it
            if dim == 2:
                found[tag] = [abs(number) for number in numbers]
    return found


def _text(section: bytes) -> Callable[[str, int], list[int]]:
    words = iter(section.split())
    return lambda _, n: [int(float(next(words))) for _ in range(n)]


def _binary(section: bytes, size: int) -> Callable[[str, int], list[int]]:
    types: dict[str, np.dtype[Any]] = {
        "int": np.dtype("i4"),
        "double": np.dtype("f8"),
        "size": np.dtype(f"u{size}"),
    }
    place = 0

    def take(kind: str, n: int) -> list[int]:
        nonlocal place
        values = np.frombuffer(section, types[kind], n, place)
        place += values.nbytes
        return [] if kind == "double" else [int(value) for value in values]

    return take


def _groups_of_entities(mesh: Any, of_surface: OfSurface) -> dict[int, list[Any]]:
    """Elements of each physical group, in each block of a file of version 4."""
    tags = mesh.cell_data.get("gmsh:geometrical", [])
    found = dict[int, list[Any]]()
    for number in {number for numbers in of_surface.values() for number in numbers}:
        surfaces = [tag for tag, numbers in of_surface.items() if number in numbers]
        found[number] = [
            np.flatnonzero(np.isin(values, surfaces) & (block.dim == 2))
            for block, values in zip(mesh.cells, tags, strict=True)
        ]
    return found


def _groups_of_elements(mesh: Any) -> dict[int, list[Any]]:
    """The same for version 2, which repeats an element for each of its groups: one of them stays."""
    _join_blocks(mesh)
    values = mesh.cell_data.get(PHYSICAL, [])
    found = dict[int, list[Any]]()
    for k, (block, numbers) in enumerate(zip(mesh.cells, values, strict=bool(values))):
        if block.dim != 2:
            continue
        nodes, numbers = np.sort(block.data, axis=1), np.abs(numbers)
        _, first, of = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
        pairs = np.unique(np.column_stack([nodes, numbers]), axis=0)
        if len(pairs) < len(nodes):  # an element is twice in one group: an overlap, which stays
            first = of = np.arange(len(nodes))
        kept = np.sort(first)
        place = np.asarray(np.searchsorted(kept, first))[np.ravel(of)]
        for number in set(numbers.tolist()) - {0}:
            members = found.setdefault(number, [np.empty(0, dtype=np.int64) for _ in mesh.cells])
            members[k] = np.unique(place[numbers == number])
        block.data = block.data[kept]
        for data in mesh.cell_data.values():
            data[k] = data[k][kept]
    return found


def _join_blocks(mesh: Any) -> None:
    """One block for each type of element."""
    types = list(dict.fromkeys(block.type for block in mesh.cells))
    at = [[k for k, block in enumerate(mesh.cells) if block.type == kind] for kind in types]
    for name, data in mesh.cell_data.items():
        mesh.cell_data[name] = [np.concatenate([data[k] for k in same]) for same in at]
    for same in at:
        mesh.cells[same[0]].data = np.concatenate([mesh.cells[k].data for k in same])
    mesh.cells = [mesh.cells[same[0]] for same in at]
