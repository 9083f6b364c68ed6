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

#: Numbers of the physical groups of each curve and surface, by dimension and number.
OfEntity = dict[tuple[int, int], list[int]]
#: Elements of each physical group in each block, by dimension and number of the group.
Groups = dict[tuple[int, int], list[Any]]


def is_gmsh(path: Path) -> bool:
    """Whether a file is of Gmsh, version 2 or later."""
    with path.open("rb") as file:
        return b"$MeshFormat" in file.read(200)


def read(path: Path, by_meshio: Callable[[Path, str], Any]) -> Any:
    """A mesh of meshio; its cell sets include the physical groups of surfaces and curves.

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
    named = _names(data)
    surfaces = sorted(number for dim, number in groups if dim == 2)
    mesh.field_data = {named.get((2, n), str(n)): np.array([n, 2]) for n in surfaces}
    mesh.cell_sets = {}
    for dim, number in sorted(groups):  # a curve and a surface may have one name
        members = groups[dim, number]
        same = mesh.cell_sets.setdefault(named.get((dim, number), str(number)), members)
        if same is not members:
            same[:] = [np.union1d(a, b) for a, b in zip(same, members, strict=True)]
    first = [np.zeros(len(block.data), dtype=np.int64) for block in mesh.cells]
    for number in reversed(surfaces):
        for values, members in zip(first, groups[2, number], strict=True):
            values[members] = number
    mesh.cell_data[PHYSICAL] = first
    return mesh


def _section(data: bytes, name: bytes) -> re.Match[bytes] | None:
    return re.search(rb"\$" + name + rb"\s*?\n(.*?)\$End" + name + rb"\s*?\n", data, re.DOTALL)


def _names(data: bytes) -> dict[tuple[int, int], str]:
    """Names of the physical groups of curves and surfaces, by dimension and number."""
    section = _section(data, b"PhysicalNames")
    pattern = rb'^\s*([12])\s+(-?\d+)\s+"(.*)"'
    lines = re.findall(pattern, section.group(1), re.MULTILINE) if section else []
    return {(int(d), abs(int(number))): name.decode(errors="replace") for d, number, name in lines}


def _entities(data: bytes, section: bytes) -> OfEntity:
    """Physical groups of the curves and surfaces of a file of version 4."""
    head = re.search(rb"\$MeshFormat\s+(\S+)\s+(\d)\s+(\d)", data)
    version, binary, size = head.groups() if head else (b"4.1", b"0", b"8")
    take = _binary(section, int(size)) if binary == b"1" else _text(section)
    found = OfEntity()
    for dim, count in enumerate(take("size", 4)):
        for _ in range(count):
            (tag,) = take("int", 1)
            take("double", 3 if dim == 0 and version != b"4.0" else 6)
            numbers = take("int", take("size", 1)[0])
            if dim > 0:
                take("int", take("size", 1)[0])  # what bounds it
            if dim in (1, 2):
                found[dim, tag] = [abs(number) for number in numbers]
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


def _groups_of_entities(mesh: Any, of_entity: OfEntity) -> Groups:
    """Elements of each physical group, in each block of a file of version 4."""
    tags = mesh.cell_data.get("gmsh:geometrical", [])
    found = Groups()
    for dim, number in {(d, number) for (d, _), numbers in of_entity.items() for number in numbers}:
        entities = [t for (d, t), numbers in of_entity.items() if d == dim and number in numbers]
        found[dim, number] = [
            np.flatnonzero(np.isin(values, entities) & (block.dim == dim))
            for block, values in zip(mesh.cells, tags, strict=True)
        ]
    return found


def _groups_of_elements(mesh: Any) -> Groups:
    """The same for version 2, which repeats an element for each of its groups: one of them stays."""
    _join_blocks(mesh)
    values = mesh.cell_data.get(PHYSICAL, [])
    found = Groups()
    for k, (block, numbers) in enumerate(zip(mesh.cells, values, strict=bool(values))):
        if block.dim not in (1, 2):
            continue
        nodes, numbers = np.sort(block.data, axis=1), np.abs(numbers)
        _, first, of = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
        pairs = np.unique(np.column_stack([nodes, numbers]), axis=0)
        if len(pairs) < len(nodes):  # an element is twice in one group: an overlap, which stays
            first = of = np.arange(len(nodes))
        kept = np.sort(first)
        place = np.asarray(np.searchsorted(kept, first))[np.ravel(of)]
        for number in set(numbers.tolist()) - {0}:
            none = [np.empty(0, dtype=np.int64) for _ in mesh.cells]
            members = found.setdefault((block.dim, number), none)
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
