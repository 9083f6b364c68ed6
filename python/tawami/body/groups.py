"""Groups of the elements of a mesh, which become the materials of a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tawami.base.arrays import Indices, Mask
from tawami.base.checks import names, one_of, shown
from tawami.base.errors import InputError

#: Name of the array of physical groups in meshes that come from Gmsh.
PHYSICAL = "gmsh:physical"
#: The blocks of elements that are used, each with its number among all blocks of the mesh.
Blocks = list[tuple[int, Any]]


def materials(
    read: Any, blocks: Blocks, tags: str | None, groups: Sequence[str] | None
) -> tuple[Indices, tuple[str, ...]]:
    """Number of the material of each element, and the names of the materials.

    Args:
        read: The mesh, of meshio.
        blocks: The blocks of elements.
        tags: Name of an array of cell data, 'sets', or None.
        groups: Names of the groups that are materials; elements in none of them get the number -1.

    Raises:
        InputError: The mesh has no such array or groups, or an element is in several or none of them.
    """
    what, members = _members(read, blocks, tags)
    if groups is not None:
        if not members:
            raise InputError(
                f"mesh: groups = {shown(groups)}: its elements have no groups: expected groups=None"
            )
        members = {name: members[name] for name in names("mesh: groups", groups, tuple(members))}
        if not members:
            raise InputError(
                f"mesh: groups = {shown(groups)}: expected the names of one or more groups"
            )
    if not members:
        return np.zeros(sum(len(block.data) for _, block in blocks), dtype=np.int64), ()
    inside = np.array(list(members.values()))
    several = np.flatnonzero(inside.sum(axis=0) > 1)
    known = ", ".join(map(repr, members))
    if len(several):
        both = [name for name, mask in members.items() if mask[several[0]]]
        raise InputError(
            f"mesh: {len(several)} of its elements are in several {what}, the first, element "
            f"{several[0]}, in '{both[0]}' and '{both[1]}': expected each in one; name those that are "
            f"materials with groups=[...] (there are {known})"
        )
    without = np.flatnonzero(~inside.any(axis=0))
    if len(without) and groups is None:
        raise InputError(
            f"mesh: {len(without)} of its elements, the first is {without[0]}, are in none of the "
            f"{what} ({known}): expected each in one; groups=[{known}] leaves out the others"
        )
    return np.where(inside.any(axis=0), inside.argmax(axis=0), -1), tuple(members)


def _members(read: Any, blocks: Blocks, tags: str | None) -> tuple[str, dict[str, Mask]]:
    """Kind of the groups, and a mask over the elements for each group that is not empty."""
    physical, sets = _physical(read, blocks), _sets(read, blocks)
    if tags is None:
        return ("physical groups", physical) if physical else ("cell sets", sets)
    if one_of(tags, (PHYSICAL,)) and physical:
        return "physical groups", physical
    if one_of(tags, ("sets",)) and "sets" not in read.cell_data:
        return "cell sets", sets
    if not one_of(tags, read.cell_data):
        known = ", ".join(repr(name) for name in read.cell_data) or "none"
        raise InputError(
            f"mesh: tags = {shown(tags)}: it has no such cell data: expected one of its arrays "
            f"({known}), or 'sets' for its cell sets ({', '.join(map(repr, sets)) or 'none'})"
        )
    values = _values(read, blocks, tags)
    return f"numbers of '{tags}'", {str(n): values == n for n in np.unique(values)}


def _physical(read: Any, blocks: Blocks) -> dict[str, Mask]:
    """Physical groups of Gmsh, in the order of their numbers; 0 is no group.

    A negative number means that the group has the opposite orientation. The array has one group for
    each element; if there are several, they are sets with the names of the groups.
    """
    if PHYSICAL not in read.cell_data:
        return {}
    values = np.abs(_values(read, blocks, PHYSICAL))
    named = {abs(int(n)): name for name, (n, dim) in read.field_data.items() if int(dim) == 2}
    sets = _sets(read, blocks)
    found = dict[str, Mask]()
    for number in sorted({*np.unique(values).tolist(), *named} - {0}):
        name = str(named.get(number, number))
        mask = (values == number) | sets.get(name, False) | found.get(name, False)
        if mask.any():
            found[name] = mask
    return found


def _sets(read: Any, blocks: Blocks) -> dict[str, Mask]:
    """Cell sets with elements that are used."""
    found = dict[str, Mask]()
    for name, of_block in read.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        masks = [np.zeros(len(block.data), dtype=bool) for _, block in blocks]
        for mask, (k, _) in zip(masks, blocks, strict=True):
            members = np.asarray(of_block[k], dtype=np.int64)
            if len(members) and not (members.min() >= 0 and members.max() < len(mask)):
                raise InputError(
                    f"mesh: cell set '{name}' has the elements {members.min()} to {members.max()} of "
                    f"block {k}: expected numbers from 0 to {len(mask) - 1}"
                )
            mask[members] = True
        if any(mask.any() for mask in masks):
            found[str(name)] = np.concatenate(masks)
    return found


def _values(read: Any, blocks: Blocks, name: str) -> Indices:
    """An array of cell data for the elements that are used."""
    data = [np.asarray(read.cell_data[name][k]) for k, _ in blocks]
    values = np.concatenate([np.ravel(part) for part in data])
    if (
        len(values) != sum(len(block.data) for _, block in blocks)
        or values.dtype.kind not in "iuf"
        or not np.isfinite(values).all()
        or (values.astype(np.int64) != values).any()
    ):
        raise InputError(f"mesh: cell data '{name}': expected a whole number for each element")
    return np.asarray(values, dtype=np.int64)
