"""A body as its particles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from tawami.base import checks
from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.base.ranks import raise_together
from tawami.base.space import PLANE, Counts, Position
from tawami.base.text import position
from tawami.body.part import Part
from tawami.border.pieces import Border

#: Share of a cell by which two bodies may overlap in it.
ROUNDING = 1e-3


@dataclass(frozen=True)
class Body:
    """Positions and volumes of the particles of a body.

    `one + other` is a body with the particles of both, in this order, and with the groups of both;
    groups of the same name become one. `sum([...])` joins several. Parts of the border that both have
    in common are inside of it. It has no border if one of them has none. `body[mask]` has some of the
    particles and no border.

    On several ranks `box`, `polygon`, `disc`, `level_set` and `mesh` give each rank the particles in its
    cells, which they divide. The arrays of a body hold these, and so do masks and fields that
    are made of them. `Body(x, volume)` is a whole body, the same on every rank.

    Attributes:
        x: Positions [m], particles x 2.
        volume: Volumes per metre depth [m2], one per particle. In axisymmetry, areas: the scene
            multiplies them by 2 pi r.
        material_of: Number of the material of each particle. None: all have the first material.
        names: Names of the materials, in the order of their numbers. Empty: they have no names.
        lattice: Origin [m], side of a cell [m] and numbers of cells of the grid that it was made for.
            None: unknown.
        border: The border of the body, with the names of its parts. None: unknown, as for loose
            particles; `polyline` makes one.
        part: The part of the body on this rank. None: it is whole.
    """

    x: Array
    volume: Array
    material_of: npt.NDArray[np.uint32] | None = None
    names: tuple[str, ...] = ()
    lattice: tuple[Position, float, Counts] | None = field(default=None, repr=False)
    border: Border | None = field(default=None, repr=False)
    part: Part | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        materials = f", materials {', '.join(self.names)}" if self.names else ""
        count = f"{len(self.x)} particles"
        if self.part is not None:
            count = f"{len(self.x)} of {self.part.total} particles on this rank"
        return f"Body({count}, {np.sum(self.volume):g} m2{materials})"

    @property
    def number(self) -> Indices:
        """Number of each particle in the whole body."""
        return np.arange(len(self.x)) if self.part is None else self.part.number

    def __getitem__(self, mask: npt.ArrayLike) -> Body:
        """The body of some of the particles, without a border; a call for all ranks.

        Args:
            mask: True for each particle that it has.

        Raises:
            InputError: No mask of the particles.
        """
        chosen = checks.any_array("body[mask]", mask)
        if chosen.dtype != bool or chosen.shape != (len(self.x),):
            raise InputError(
                f"body[mask]: {chosen.dtype} of shape {chosen.shape}: expected a mask of its "
                f"{len(self.x)} particles, as body.x[:, 1] > 0.5"
            )
        return replace(
            self,
            x=self.x[chosen],
            volume=self.volume[chosen],
            material_of=None if self.material_of is None else self.material_of[chosen],
            border=None,
            part=None if self.part is None else self.part.chosen(chosen),
        ).in_own_cells()

    def in_own_cells(self) -> Body:
        """The body with the particles of each rank as a scene divides them; a call for all ranks.

        Raises:
            InputError: Particles are outside the grid.
        """
        if self.part is None:
            return self
        given = () if self.material_of is None else (self.material_of,)
        part, (x, volume, *material) = self.part.in_own_cells(self.x, self.volume, *given)
        of = material[0] if material else None
        return replace(self, x=x, volume=volume, material_of=of, part=part)

    def named(self, name: str) -> Body:
        """The same body as one group, to which a scene gives a material by this name.

        Raises:
            InputError: Not a name, or the body has several materials.
        """
        if not isinstance(name, str) or not name:
            raise InputError(f"named({checks.shown(name)}): expected a name, as 'clay'")
        if len(self.names) > 1 or (self.material_of is not None and np.any(self.material_of)):
            groups = f"the groups {_listed(self.names)}" if self.names else "several materials"
            raise InputError(
                f"named('{name}'): the body has {groups}: expected a body with one; name "
                "bodies before joining them"
            )
        return replace(self, material_of=None, names=(name,))

    def __add__(self, other: Body) -> Body:
        """A body with the particles and groups of both.

        Raises:
            InputError: They overlap, were made for different grids, or one of them has names and the
                other has none.
        """
        if not isinstance(other, Body):
            return NotImplemented
        if (self.part is None) != (other.part is None):
            return self._divided(other) + other._divided(self)
        one, others = _arrays(self), _arrays(other)
        lattice = self.lattice or other.lattice
        if self.lattice is not None and other.lattice is not None:
            if self.lattice != other.lattice:
                raise InputError(
                    "Body + Body: they were made for different grids: expected the same origin, h and "
                    "cells; make both with the grid of the scene"
                )
            comm: Any = MPI.COMM_SELF
            first, second = one, others
            if self.part is not None and other.part is not None:
                comm = self.part.grid.comm
                first, second = self.part.by_cells(*one), other.part.by_cells(*others)
            with raise_together(comm):
                _check_apart(first, second, *self.lattice)
        names, number = _groups(self, other)
        x, volume = (np.concatenate(arrays) for arrays in zip(one, others, strict=True))
        for part in (self, other):
            checks.instance("Body + Body: border", part.border, Border | None, "a tawami.Border")
        border = self.border and other.border and self.border.joined(other.border)
        joined = None
        if self.part is not None and other.part is not None:
            joined = self.part.followed_by(other.part)
        return Body(x, volume, number, names, lattice, border, joined).in_own_cells()

    def _divided(self, other: Body) -> Body:
        """The part of a whole body that a rank holds of its sum with another one."""
        if self.part is not None or other.part is None:
            return self
        _arrays(self)
        part, mask = Part.of_whole(other.part.grid, self.x)
        number = self.material_of
        return replace(
            self, x=self.x[mask], volume=self.volume[mask], part=part,
            material_of=None if number is None else np.asarray(number)[mask],
        )  # fmt: skip

    def __radd__(self, other: Literal[0]) -> Body:
        """Join bodies with `sum([...])`, which begins with 0."""
        return self if isinstance(other, int) and other == 0 else NotImplemented


def _groups(one: Body, other: Body) -> tuple[tuple[str, ...], npt.NDArray[np.uint32] | None]:
    """Names of the groups of both bodies, and the number of the group of each particle."""
    parts = (one, other)
    if bool(one.names) != bool(other.names):
        raise InputError(
            f"Body + Body: one has the groups {_listed(one.names or other.names)} and the other has no "
            "names: expected names for both or none; body.named('sand') gives one"
        )
    names = tuple(dict.fromkeys(one.names + other.names))
    if len(names) < 2 and all(part.material_of is None for part in parts):
        return names, None
    numbers = []
    for part in parts:
        own = np.zeros(len(part.x)) if part.material_of is None else part.material_of
        number = checks.numbering("Body + Body: material_of", own, len(part.x))
        if part.names:
            if number.max(initial=0) >= len(part.names):
                raise InputError(
                    f"Body + Body: material_of has the number {number.max()} and names are "
                    f"{_listed(part.names)}: expected a name for each number"
                )
            number = np.array([names.index(name) for name in part.names], dtype=np.uint32)[number]
        numbers.append(number)
    return names, np.concatenate(numbers)


def _arrays(part: Body) -> tuple[Array, Array]:
    """Positions and volumes of a body."""
    x = checks.array("Body + Body: x", part.x, 2)
    volume = checks.array("Body + Body: volume", part.volume, 1)
    if x.shape != (len(volume), PLANE.dim):
        raise InputError(
            f"Body + Body: x of shape {x.shape} with {len(volume)} volumes: expected {PLANE.dim} "
            "coordinates for each"
        )
    return x, volume


def _check_apart(
    one: tuple[Array, Array], other: tuple[Array, Array], origin: Position, h: float, cells: Counts
) -> None:
    """Check that no cell holds more than its volume, given positions and volumes of two bodies.

    Raises:
        InputError: They overlap.
    """
    index = [
        np.clip(np.floor((x - origin) / h), 0, np.subtract(cells, 1)).astype(np.int64)
        for x, _ in (one, other)
        if len(x)
    ]
    if len(index) < 2:  # one of them has no particles on this rank
        return
    first = np.min([part.min(axis=0) for part in index], axis=0)
    shape = np.max([part.max(axis=0) for part in index], axis=0) - first + 1
    strides, size = np.cumprod([1, *shape[:-1]]), h ** len(cells)
    covered = [
        np.bincount((part - first) @ strides, volume, int(shape.prod())) / size
        for part, (_, volume) in zip(index, (one, other), strict=True)
    ]
    excess = sum(covered) - np.maximum(1.0, np.maximum(*covered))
    worst = int(np.argmax(excess))
    if excess[worst] > ROUNDING:
        place = origin + h * (first + np.unravel_index(worst, shape, order="F") + 0.5)
        raise InputError(
            f"Body + Body: they overlap by at least {size * np.maximum(excess, 0.0).sum():.3g} m2, most "
            f"in the cell at {position(place)} m: expected bodies side by side; subtract one from the "
            "other, as polygons of shapely or as functions of level_set"
        )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))
