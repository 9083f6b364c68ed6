"""From a form to compiled kernels of its residual and its derived tangent.

Forms are written and compiled without a mesh, once per process and on disk.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from tawami.base.errors import FormError, InputError
from tawami.base.space import PLANE, Space
from tawami.base.timing import tally
from tawami.fem.rules import Rule
from tawami.form.form import Form
from tawami.form.integral import Integral, KernelBuilder
from tawami.form.quantities import Density, LawQuantity, ParticleScalar
from tawami.form.symbols import Assembly, Symbols
from tawami.form.tangent import Linearisation, change_with_fields
from tawami.form.terms import at_points, by_rule, terms_of


@dataclass(frozen=True)
class BorderTerm:
    """The sums of a form over one part of the border.

    Attributes:
        on: Names of the parts of the border; None for all of it.
        residual: The integrals of rank 1.
        tangent: Their derivatives.
    """

    on: tuple[str, ...] | None
    residual: tuple[Integral, ...]
    tangent: tuple[Integral, ...]


@dataclass(frozen=True)
class CompiledForm:
    """A form that is ready to be attached to a grid.

    Attributes:
        form: The form.
        element: Element of all fields on the mesh: biquadratic displacement, bilinear others.
        residual: Integrals of the residual over cells, one for each quadrature rule.
        tangent: Derivative of `residual`, one integral for each quadrature rule.
        couplings: The other part of the tangent: products of two integrals of rank 1, cell by cell.
        sides: Compiles the integral of rank 2 over sides of partially filled cells, if there is one. It
            is called for the first body with such cells.
        border: Sums over the border.
        densities: Particle data of each rule: each density with its first column.
        border_data: Numbers of the points of the border, as columns.
        used: Parameters, data and constants (time, dt, b) that the residual reads with these options.
    """

    form: Form
    element: Any
    residual: tuple[Integral, ...]
    tangent: tuple[Integral, ...]
    couplings: tuple[tuple[Integral, Integral], ...]
    sides: Callable[[], Integral] | None
    border: tuple[BorderTerm, ...]
    densities: Mapping[Rule, Mapping[Density, int]]
    border_data: tuple[ParticleScalar, ...]
    used: frozenset[str]

    @property
    def is_linear(self) -> bool:
        """Whether the residual is linear in the fields if the laws are."""
        slots = [slot for integral in self.tangent for slot in integral.slots]
        known = all(slot.source != "fields" for slot in slots)
        return known and not self.form.strain.finite and not self.border

    @property
    def penalises(self) -> bool:
        """Whether the form has a ghost penalty."""
        return self.sides is not None

    @functools.cached_property
    def ghost(self) -> Integral | None:
        """The ghost penalty, if the form has one; a collective call."""
        with tally.compiling():
            return None if self.sides is None else self.sides()

    @property
    def may_hold(self) -> bool:
        """Whether sums over the border may hold the body, as an elastic foundation does."""
        first = range(next(iter(self.form.fields.values())).components)
        points = [one.points[1] for term in self.border for one in term.tangent if one.points]
        return any(
            all(
                any(component in first for component, _ in entries) for entries in (p.test, p.trial)
            )
            for p in points
        )

    def columns(self, rule: Rule) -> int:
        """Number of columns of the particle data of a rule."""
        return sum(density.size for density in self.densities[rule])

    def names(self, quantity: str) -> bool:
        """Whether the residual names a quantity of the law."""
        return any(
            isinstance(density.quantity, LawQuantity) and density.quantity.name == quantity
            for of_rule in self.densities.values()
            for density in of_rule
        )


_compiled: dict[tuple[Any, ...], CompiledForm] = {}


def compile_form(
    comm: Any,
    form: Form,
    options: Mapping[str, str],
    assembly: Assembly = "points",
    *,
    plastic_volume: bool = True,
    space: Space = PLANE,
    histories: Iterable[str] = (),
    fields_of_particles: Iterable[str] = (),
) -> CompiledForm:
    """Compile a form with its options; a collective call.

    Args:
        comm: Communicator.
        form: The form.
        options: One value for each of the form's options.
        assembly: 'points' for kernels at the particles, 'dolfinx' for integrals over cells only.
        plastic_volume: Whether plastic flow may change the volume. Otherwise eps_p is zero, and its
            terms are left out.
        space: Dimension and geometry.
        histories: Names of the history variables of the laws.
        fields_of_particles: Parameters whose value is one number for each particle.

    Raises:
        FormError: A name is unknown, a test function is missing, or UFL or FFCx rejects the form.
    """
    histories, fields = tuple(sorted({*histories})), tuple(sorted({*fields_of_particles}))
    chosen = tuple(sorted(options.items()))
    key = (form, assembly, plastic_volume, space, histories, fields, chosen)
    if key not in _compiled:
        if space.hoop and assembly == "dolfinx":
            raise FormError(
                "assembly='dolfinx' in axisymmetry: the hoop strain u_r / r is no polynomial, so that "
                "densities on a fixed rule are not exact: expected assembly='points'"
            )
        symbols = Symbols(
            form, options, plastic_volume=plastic_volume, assembly=assembly, space=space,
            histories=histories, fields_of_particles=fields,
        )  # fmt: skip
        with tally.compiling():
            _compiled[key] = _compile(comm, symbols)
    return _compiled[key]


def _compile(comm: Any, symbols: Symbols) -> CompiledForm:
    form, residual = symbols.form, symbols.residual()
    terms = terms_of(symbols, residual)
    with symbols.lines.errors(terms.cells):
        linearisation = Linearisation(symbols, terms.cells)
        tangent, couplings = linearisation.tangent(), linearisation.couplings()
    builder = KernelBuilder(comm, symbols)
    integral, ghost = builder.integral, terms.ghost

    def integrals(form: Any) -> tuple[Integral, ...]:
        if symbols.assembly == "dolfinx":
            return tuple(map(integral, by_rule(form)))
        sums, rest = at_points(form)
        kernels = [builder.at_points(part, rule) for rule, part in sums]
        return (*kernels, *map(integral, by_rule(rest)))

    def of_pair(pair: tuple[Any, Any]) -> tuple[Integral, Integral]:
        (left,), (right,) = map(integrals, pair)
        return left, right

    of_border = KernelBuilder(comm, symbols)

    def border_term(on: tuple[str, ...] | None, form: Any) -> BorderTerm:
        """Points of the border take the place of particles in kernels of their own."""
        with symbols.lines.errors(form):
            parts = form, change_with_fields(symbols, form)
        kernels = [
            tuple(of_border.at_points(part, "particle") for _, part in at_points(one)[0])
            for one in parts
        ]
        return BorderTerm(on, *kernels)

    border = tuple(border_term(on, form) for on, form in terms.border.items())
    numbers = [density.quantity for density in of_border.densities["particle"]]
    return CompiledForm(
        form=form,
        element=symbols.element,
        residual=integrals(terms.cells),
        tangent=integrals(tangent),
        sides=None if ghost is None else builder.prepared(ghost, "interior_facet"),
        border=border,
        couplings=tuple(map(of_pair, couplings)),
        densities=builder.densities,
        border_data=tuple(n for n in numbers if isinstance(n, ParticleScalar)),
        used=_used(symbols, residual),
    )


def _used(symbols: Symbols, residual: Any) -> frozenset[str]:
    """Constants and numbers of the particles that a residual reads."""
    constants, coefficients = set(residual.constants()), residual.coefficients()
    read = {name for name, constant in symbols.constants.items() if constant in constants}
    data = [data for c in coefficients if (data := symbols.data.of(c)) is not None]
    read |= {d.quantity.text for d in data if isinstance(d.quantity, ParticleScalar)}
    return frozenset(read)


def check_used(
    compiled: CompiledForm, options: Mapping[str, str], given: Mapping[str, Any]
) -> None:
    """Check that a form with its options uses all given parameters.

    Args:
        compiled: The compiled form.
        options: Its options.
        given: Parameters and options that a user gave.

    Raises:
        InputError: A parameter has no effect; the message names the option with which it has.
    """
    form = compiled.form
    for name in [n for n in given if n in form.parameters and n not in compiled.used]:
        switches = [
            f"{option}='{choice}'"
            for option, choices in form.options.items()
            for choice in choices
            if _uses(form, {**options, option: choice}, name)
        ]
        raise InputError(
            f"{name} = {given[name]!r}: form {form.name} does not use it with its present options: "
            f"expected {' or '.join(switches) or f'no {name}'}"
        )


def _uses(form: Form, options: Mapping[str, str], name: str) -> bool:
    symbols = Symbols(form, options)
    return name in _used(symbols, symbols.residual())
