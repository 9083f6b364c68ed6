"""Compiled integrals and the coefficients that their kernels read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import ufl
from ufl.algorithms.check_arities import ArityMismatch, check_form_arity

from tawami.base.errors import FormError, TawamiError
from tawami.fem import dolfinx, kernels
from tawami.fem.kernels import Kernel, Kind
from tawami.fem.rules import DEGREE, Rule, rule_points
from tawami.form.form import Form
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
        return "particle" if self.source == "reduced" else self.source


@dataclass(frozen=True)
class Integral:
    """A compiled integral.

    Attributes:
        rank: 1 for vectors, 2 for matrices.
        kernel: The compiled kernel.
        slots: Coefficients that the kernel reads.
        constants: Names of the constants that it reads.
    """

    rank: int
    kernel: Kernel
    slots: tuple[Slot, ...]
    constants: tuple[str, ...]

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

    def integral(self, form: Any, kind: Kind = "cell", at_particles: Rule = "particle") -> Integral:
        """Compile a UFL form with integrals of one kind and rule.

        Args:
            form: The form.
            kind: What it integrates over.
            at_particles: Rule at whose points the densities of sums over particles are given.
        """
        symbols, slots, packed = self._symbols, self._field_slots(), {}
        used = set(form.coefficients())
        for rule, columns in self.densities.items():
            symbol_of = {
                density: symbol
                for density, symbol in symbols.placeholders.items()
                if density.rule == rule and symbol in used
            }
            if not symbol_of:
                continue
            points = at_particles if rule == "particle" else rule
            size = sum(density.size for density in symbol_of)
            vector = ufl.Coefficient(symbols.space(points, size), count=2 + len(slots))
            numbers: list[int] = []
            for density, symbol in symbol_of.items():
                first, start = len(numbers), columns[density]
                packed[symbol] = ufl.as_vector([vector[first + k] for k in range(density.size)])
                numbers += range(start, start + density.size)
            num_points = max(len(rule_points(points)), 1)
            slots[vector] = Slot(points, num_points * size, tuple(numbers))
        form = ufl.replace(form, packed)
        with ufl_errors(symbols.form):
            # newer versions of FFCx leave their cache locked if they find the error themselves
            check_form_arity(ufl.algorithms.expand_derivatives(form), form.arguments())
            kernel = kernels.compile_kernel(self._comm, form, kind)
        order = form.coefficients()
        names = {constant: name for name, constant in symbols.constants.items()}
        return Integral(
            len(form.arguments()),
            kernel,
            tuple(slots[order[i]] for i in kernel.coefficients),
            tuple(names[constant] for constant in form.constants()),
        )

    def _field_slots(self) -> dict[Any, Slot]:
        """Slots of the increments and of the traction."""
        displacement, bilinear = dolfinx.DISPLACEMENT_DOFS, dolfinx.BILINEAR_DOFS
        num_bilinear = len(self._symbols.form.fields) - 1
        return {
            self._symbols.increments: Slot("fields", displacement + bilinear * num_bilinear),
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
