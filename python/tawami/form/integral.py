"""Compiled integrals and the coefficients that their kernels read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import ufl
from ufl.algorithms.analysis import has_type
from ufl.classes import SpatialCoordinate

from tawami.fem import kernels
from tawami.fem.kernels import Kernel, Kind
from tawami.fem.rules import DEGREE, Rule, rule_points
from tawami.form import points
from tawami.form.arity import check_arity
from tawami.form.lines import without_line
from tawami.form.points import Integrand, PointForm
from tawami.form.quantities import Density
from tawami.form.symbols import Symbols


@dataclass(frozen=True)
class Slot:
    """One coefficient of a kernel, in packed order.

    Attributes:
        source: 'fields' (the increments), 'position' (x of a point), or the rule of particle
            densities.
        width: Entries per cell.
        columns: Columns of the particle data (densities only).
    """

    source: Literal["fields", "position"] | Rule
    width: int
    columns: tuple[int, ...] = ()

    @property
    def data(self) -> Rule:
        """The rule of its particle data (densities only)."""
        assert self.source != "fields"
        assert self.source != "position"
        return self.source


@dataclass(frozen=True)
class Integral:
    """A compiled integral.

    Attributes:
        rank: 1 for vectors, 2 for matrices.
        kernel: The compiled kernel.
        slots: Coefficients that the kernel reads.
        constants: Names of the constants that it reads.
        points: Place of its points and what its numbers stand for; None for an integral over cells.
        reads_position: Whether an integral over cells reads the position x.
    """

    rank: int
    kernel: Kernel
    slots: tuple[Slot, ...]
    constants: tuple[str, ...]
    points: tuple[Rule, PointForm] | None = None
    reads_position: bool = False

    @property
    def width(self) -> int:
        """Entries per cell of the packed coefficients."""
        return sum(slot.width for slot in self.slots)


class KernelBuilder:
    """Compiles the integrals of a form.

    Args:
        comm: Communicator.
        symbols: Symbols of the form.

    Attributes:
        densities: Particle data of each rule that its integrals read: each with its first column.
    """

    def __init__(self, comm: Any, symbols: Symbols) -> None:
        self._comm, self._symbols = comm, symbols
        self.densities: dict[Rule, dict[Density, int]] = {rule: {} for rule in (*DEGREE, "mean")}

    def integral(self, form: Any, kind: Kind = "cell") -> Integral:
        """Compile a UFL form with integrals of one kind and rule.

        Args:
            form: The form.
            kind: Domain of the integrals.
        """
        return self.prepared(form, kind)()

    def prepared(self, form: Any, kind: Kind) -> Callable[[], Integral]:
        """A function that compiles a UFL form as `integral`; its data have their columns already."""
        symbols, packed = self._symbols, {}
        width = sum(field.num_dofs for field in symbols.form.fields.values())
        slots = {symbols.increments: Slot("fields", width)}
        found = {symbol: symbols.data.of(symbol) for symbol in form.coefficients()}
        symbol_of = {data: symbol for symbol, data in found.items() if data is not None}
        for rule, first, columns in self._columns(symbol_of):
            space = symbols.data.function_space(rule, len(columns))
            vector = ufl.Coefficient(space, count=3 + len(slots))
            for data, start in first.items():
                components = [vector[start + k] for k in range(data.size)]
                packed[symbol_of[data]] = ufl.as_vector(components)
            num_points = max(len(rule_points(rule)), 1)
            slots[vector] = Slot(rule, num_points * len(columns), columns)
        form = ufl.Form([without_line(part) for part in ufl.replace(form, packed).integrals()])
        reads = any(has_type(part.integrand(), SpatialCoordinate) for part in form.integrals())
        return lambda: replace(self._compiled(form, slots, kind), reads_position=reads)

    def at_points(self, form: Any, place: Rule) -> Integral:
        """Compile sums over particles with the fields at points of one kind.

        Args:
            form: The form.
            place: 'particle', or 'centre' or 'vertex' of the cell of each particle.
        """
        slots: dict[Any, Slot] = {}
        where: dict[Density, tuple[Any, int]] = {}
        symbols = self._symbols
        with symbols.lines.errors(form):
            integrand = Integrand(form, symbols)
            for rule, first, columns in self._columns(integrand.data):
                vector = points.vector(len(columns), 1 + len(slots))
                slots[vector] = Slot(rule, len(columns), columns)
                where |= {data: (vector, start) for data, start in first.items()}
            position = points.vector(symbols.space.dim, 1 + len(slots))
            if integrand.reads_position:
                slots[position] = Slot("position", symbols.space.dim)
            found = integrand.form(where, position)
        size = len(found.fields)
        slots |= {points.vector(size, 0): Slot("fields", size)}
        return replace(self._compiled(found.form, slots), points=(place, found))

    def _columns(
        self, read: Iterable[Density]
    ) -> Iterator[tuple[Rule, dict[Density, int], tuple[int, ...]]]:
        """Of each rule of some data: each of them with its first place among the columns that are read,
        and these columns of the particle data.
        """
        for rule, columns in self.densities.items():
            first, numbers = {}, list[int]()
            for data in (data for data in read if data.rule == rule):
                if data not in columns:
                    columns[data] = sum(other.size for other in columns)
                first[data] = len(numbers)
                numbers += range(columns[data], columns[data] + data.size)
            if first:
                yield rule, first, tuple(numbers)

    def _compiled(self, form: Any, slots: Mapping[Any, Slot], kind: Kind = "cell") -> Integral:
        """Compile a form whose coefficients are those of the slots."""
        symbols = self._symbols
        with symbols.lines.errors(form):
            # newer versions of FFCx leave their cache locked if they find the error themselves
            check_arity(form, symbols.lines.text(None))
            kernel = kernels.compile_kernel(self._comm, form, kind)
        order = form.coefficients()
        names = {constant.count(): name for name, constant in symbols.constants.items()}
        return Integral(
            len(form.arguments()),
            kernel,
            tuple(slots[order[i]] for i in kernel.coefficients),
            tuple(names[constant.count()] for constant in form.constants()),
        )
