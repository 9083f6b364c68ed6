"""Compiled integrals and the coefficients that their kernels read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Literal

import ufl
from ufl.algorithms.check_arities import ArityMismatch, check_form_arity

from tawami.base.errors import FormError, TawamiError
from tawami.fem import kernels
from tawami.fem.kernels import Kernel, Kind
from tawami.fem.rules import DEGREE, Rule, rule_points
from tawami.form import points
from tawami.form.form import Form
from tawami.form.points import PointForm
from tawami.form.quantities import Density
from tawami.form.symbols import Symbols


@dataclass(frozen=True)
class Slot:
    """One coefficient of a kernel, in packed order.

    Attributes:
        source: 'fields' (the increments), 'traction', or the rule of particle densities.
        width: Entries per cell.
        columns: Columns of the particle data (densities only).
    """

    source: Literal["fields", "traction"] | Rule
    width: int
    columns: tuple[int, ...] = ()

    @property
    def data(self) -> Rule:
        """The rule of its particle data (densities only)."""
        assert self.source != "fields"
        assert self.source != "traction"
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
    """

    rank: int
    kernel: Kernel
    slots: tuple[Slot, ...]
    constants: tuple[str, ...]
    points: tuple[Rule, PointForm] | None = None

    @property
    def width(self) -> int:
        """Entries per cell of the packed coefficients."""
        return sum(slot.width for slot in self.slots)


class KernelBuilder:
    """Compiles the integrals of a form.

    Args:
        comm: Communicator.
        symbols: Symbols of the form, with the densities of all its integrals.

    Attributes:
        densities: Particle data of each rule: each density with its first column.
    """

    def __init__(self, comm: Any, symbols: Symbols) -> None:
        self._comm, self._symbols = comm, symbols
        self.densities: dict[Rule, dict[Density, int]] = {rule: {} for rule in (*DEGREE, "mean")}
        width = dict.fromkeys(self.densities, 0)
        for density in symbols.placeholders:
            self.densities[density.rule][density] = width[density.rule]
            width[density.rule] += density.size

    def integral(self, form: Any, kind: Kind = "cell") -> Integral:
        """Compile a UFL form with integrals of one kind and rule.

        Args:
            form: The form.
            kind: Domain of the integrals.
        """
        symbols, slots, packed = self._symbols, self._field_slots(), {}
        for rule, densities, columns in self._used(form):
            vector = ufl.Coefficient(symbols.space(rule, len(columns)), count=2 + len(slots))
            for symbol, first in densities.items():
                size = symbol.ufl_shape[0]
                packed[symbol] = ufl.as_vector([vector[first + k] for k in range(size)])
            num_points = max(len(rule_points(rule)), 1)
            slots[vector] = Slot(rule, num_points * len(columns), columns)
        return self._compiled(ufl.replace(form, packed), slots, kind)

    def at_points(self, form: Any, place: Rule) -> Integral:
        """Compile sums over particles with the fields at points of one kind.

        Args:
            form: The form.
            place: 'particle', or 'centre' or 'vertex' of the cell of each particle.
        """
        slots: dict[Any, Slot] = {}
        data: dict[Any, tuple[Any, int]] = {}
        for rule, densities, columns in self._used(form):
            vector = points.vector(len(columns), 1 + len(slots))
            slots[vector] = Slot(rule, len(columns), columns)
            data |= {symbol: (vector, first) for symbol, first in densities.items()}
        with ufl_errors(self._symbols.form):
            found = points.at_point(form, self._symbols.increments, data)
        size = len(found.fields)
        slots |= {points.vector(size, 0): Slot("fields", size)}
        return replace(self._compiled(found.form, slots), points=(place, found))

    def _used(self, form: Any) -> Iterator[tuple[Rule, dict[Any, int], tuple[int, ...]]]:
        """Of each rule of a form: its placeholders, each with its first place among the columns, and the
        columns of the particle data.
        """
        used = set(form.coefficients())
        for rule, columns in self.densities.items():
            first, numbers = {}, list[int]()
            for density, symbol in self._symbols.placeholders.items():
                if density.rule == rule and symbol in used:
                    first[symbol], start = len(numbers), columns[density]
                    numbers += range(start, start + density.size)
            if first:
                yield rule, first, tuple(numbers)

    def _compiled(self, form: Any, slots: Mapping[Any, Slot], kind: Kind = "cell") -> Integral:
        """Compile a form whose coefficients are those of the slots."""
        symbols = self._symbols
        with ufl_errors(symbols.form):
            # newer versions of FFCx leave their cache locked if they find the error themselves
            check_form_arity(ufl.algorithms.expand_derivatives(form), form.arguments())
            kernel = kernels.compile_kernel(self._comm, form, kind)
        order = form.coefficients()
        names = {constant.count(): name for name, constant in symbols.constants.items()}
        return Integral(
            len(form.arguments()),
            kernel,
            tuple(slots[order[i]] for i in kernel.coefficients),
            tuple(names[constant.count()] for constant in form.constants()),
        )

    def _field_slots(self) -> dict[Any, Slot]:
        """Slots of the increments and of the traction."""
        displacement, *others = (f.num_dofs for f in self._symbols.form.fields.values())
        return {
            self._symbols.increments: Slot("fields", displacement + sum(others)),
            self._symbols.traction: Slot("traction", displacement),
        }


@contextmanager
def ufl_errors(form: Form) -> Iterator[None]:
    """Raise the errors of UFL and FFCx as errors of tawami; each names the form."""
    try:
        yield
    except TawamiError as error:  # of the cache of compiled forms
        raise type(error)(f"form {form.name}: {error}") from error
    except (Exception, ArityMismatch) as error:  # the second is no Exception in newer UFL
        advice = ""
        if isinstance(error, ArityMismatch):
            advice = ". Each term must be linear in one test function"
        raise FormError(f"form {form.name}: UFL or FFCx rejected it: {error}{advice}") from error
