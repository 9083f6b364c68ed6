"""Vectors of the coefficients of all fields, distributed over the ranks."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask, of_components
from tawami.base.exchange import Exchange
from tawami.base.rows import Rows
from tawami.field.functions import ActiveFunctions
from tawami.field.owned import Owned
from tawami.form.fields import Field
from tawami.grid.basis import Basis
from tawami.grid.grid import Grid
from tawami.grid.window import Window


@dataclass(frozen=True)
class Place:
    """Place of a field among the coefficients.

    Attributes:
        basis: Its functions.
        components: Number of components of each function.
        degree: Degree along each axis of its element on the mesh.
        start: Its first coefficient.
        num_functions: Number of its functions.
    """

    basis: Basis
    components: int
    degree: int
    start: int
    num_functions: int

    @property
    def stop(self) -> int:
        """The coefficient after its last one."""
        return self.start + self.components * self.num_functions

    @property
    def slice(self) -> slice:
        """All of its coefficients."""
        return slice(self.start, self.stop)

    def holds(self, coefficients: Any) -> Any:
        """Whether numbers of coefficients are those of this field."""
        return (coefficients >= self.start) & (coefficients < self.stop)


def places_of(fields: Mapping[str, Field], basis: Basis, cells: Sequence[int]) -> dict[str, Place]:
    """Places of fields on a number of cells along each axis."""
    found, start = dict[str, Place](), 0
    for name, field in fields.items():
        its_basis = cast(Basis, field.basis or basis)
        count = math.prod(_rust.basis_len(its_basis, n) for n in cells)
        found[name] = Place(its_basis, field.components, field.degree, start, count)
        start = found[name].stop
    return found


class Coefficients:
    """Coefficients of all fields in the window of a rank; each belongs to one rank.

    Attributes:
        grid, window: The grid, and its part that the rank knows.
        fields: Place of each field by name.
        of_grid: The same among the coefficients of the whole grid.
        num_displacement: Number of displacement coefficients; the other fields follow.
        size: Number of coefficients.
        functions: The active functions.
        owner: Rank of each active coefficient; -1 for others.
        exchange: The exchange of coefficients between ranks.
    """

    grid: Grid
    window: Window
    fields: Mapping[str, Place]
    of_grid: Mapping[str, Place]
    num_displacement: int
    size: int
    functions: ActiveFunctions
    owner: Indices
    exchange: Exchange

    @functools.cached_property
    def own(self) -> Mask:
        """Whether each coefficient belongs to this rank; on one rank, inactive ones too."""
        if self.grid.comm.size == 1:
            return np.ones(self.size, dtype=bool)
        return np.asarray(self.owner == self.grid.comm.rank)

    def dot(self, a: Array, b: Array) -> float:
        """Scalar product over all ranks of vectors of coefficients, or of those of the displacement.

        A collective call.
        """
        if self.grid.comm.size == 1:
            return float(a @ b)
        own = self.own[: len(a)]
        return float(self.grid.comm.allreduce(float(a[own] @ b[own])))

    def norm(self, a: Array) -> float:
        """Euclidean norm over all ranks, as :meth:`dot`, whose squares do not overflow."""
        return ranks.norm_of(self.grid.comm, a[self.own[: len(a)]])

    def largest(self, a: Array) -> float:
        """Largest size of the coefficients of all ranks; a collective call."""
        return ranks.largest(self.grid.comm, float(np.abs(a).max(initial=0.0)))

    @functools.cached_property
    def in_grid(self) -> Indices:
        """Number of each coefficient among those of the whole grid."""
        found = []
        for here, there in zip(self.fields.values(), self.of_grid.values(), strict=True):
            function = self.window.in_grid(here.basis, np.arange(here.num_functions))
            number = there.start + there.components * function[:, None]
            found.append((number + np.arange(here.components)).ravel())
        return np.concatenate(found)

    @property
    def size_of_grid(self) -> int:
        """Number of coefficients of the whole grid."""
        return list(self.of_grid.values())[-1].stop

    @property
    def num_displacement_of_grid(self) -> int:
        """Number of displacement coefficients of the whole grid."""
        return next(iter(self.of_grid.values())).stop

    def places(self, in_grid: Any) -> Indices:
        """Places of coefficients with these numbers in the whole grid; -1 outside the window."""
        number = np.asarray(in_grid, dtype=np.int64)
        found = np.full(number.shape, -1)
        for here, there in zip(self.fields.values(), self.of_grid.values(), strict=True):
            mine = there.holds(number)
            function, component = np.divmod(number[mine] - there.start, there.components)
            place = self.window.functions(here.basis, function)
            found[mine] = np.where(place >= 0, here.start + here.components * place + component, -1)
        return found

    def at(self, values: Array, in_grid: Any) -> Array:
        """Values of coefficients of the whole grid, on every rank, zero for inactive ones.

        A collective call.

        Args:
            values: Of the coefficients of the window, or of those of the displacement.
            in_grid: Numbers of some coefficients in the whole grid, the same on every rank.
        """
        place = self.places(in_grid)
        if self.grid.comm.size == 1:
            return np.asarray(values[place])
        mine = (place >= 0) & self.own[place]
        return ranks.sum_of(self.grid.comm, np.where(mine, values[place], 0.0))

    def vectors_at(self, values: Array, functions: Indices) -> Array:
        """Values of displacement functions of the whole grid, on every rank, functions x dim.

        A collective call.

        Args:
            values: Of the functions of the window, functions x dim.
            functions: Numbers of some functions in the whole grid, the same on every rank.
        """
        return self.at(values.ravel(), of_components(functions, values.shape[1]))

    def has_particles(self, cells: Indices) -> Mask:
        """Whether cells (i, j) of the grid hold particles, on any rank; a collective call."""
        number = self.window.found(cells)
        mine = (number >= 0) & np.isin(number, self.functions.cells.astype(np.int64))
        return ranks.any_of(self.grid.comm, mine)

    def owned(self, values: Array) -> Owned:
        """Values of coefficients, or of those of the displacement, each on the rank that owns it."""
        of_displacement = len(values) == self.num_displacement
        size = list(self.of_grid.values())[0 if of_displacement else -1].stop
        if self.grid.comm.size == 1:
            active = self.owner[: len(values)] >= 0
            return Owned(self.grid.comm, None, np.where(active, values, 0.0), size)
        own = np.flatnonzero(self.own[: len(values)])
        number = self.in_grid[own]
        order = np.argsort(number)
        return Owned(self.grid.comm, number[order], values[own[order]], size)

    def whole(self, values: Array) -> Array:
        """Coefficients of the whole grid, or those of the displacement, from those of the window.

        A collective call.
        """
        return self.owned(values).whole

    def part(self, in_grid: Array) -> Array:
        """Coefficients of the window, or those of the displacement, from those of the whole grid."""
        if self.grid.comm.size == 1:
            return in_grid
        of_displacement = len(in_grid) < self.size_of_grid
        return np.asarray(
            in_grid[self.in_grid[: self.num_displacement if of_displacement else None]]
        )

    def sum(self, of_cells: Array) -> Array:
        """The sum over all ranks of vectors of coefficients from their cells; a collective call.

        Args:
            of_cells: On the coefficients of the window, or on those of the displacement.
        """
        values = np.ascontiguousarray(of_cells)
        if len(values) == self.size:
            return self.exchange.add(values)
        place = next(iter(self.fields.values()))
        vectors = values.reshape(place.num_functions, place.components, *values.shape[1:])
        return self.functions.exchange(place.basis).add(vectors).reshape(values.shape)

    def gathered(self, rows: Rows) -> Rows:
        """A matrix on the coefficients of the whole grid, on every rank; a collective call.

        Args:
            rows: The parts of the ranks, on the coefficients of their windows.
        """
        shape, number = (rows.shape[0], self.size_of_grid), self.in_grid[rows.column]
        return Rows.gathered(self.grid.comm, rows.row, number, rows.values, shape)

    def by_owner(self, rows: Rows) -> Rows:
        """A matrix on the coefficients of the window: each entry on the rank that owns its coefficient.

        A collective call.

        Args:
            rows: The parts of the ranks, whose sum is the matrix.
        """
        comm = self.grid.comm
        if comm.size == 1:
            return rows
        to = self.owner[rows.column]
        row, number, values = (
            ranks.exchanged(comm, part, to)
            for part in (rows.row, self.in_grid[rows.column], rows.values)
        )
        return Rows.of(row, self.places(number), values, rows.shape)
