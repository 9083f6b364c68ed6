"""From a form to compiled kernels: its residual in UFL, the derived tangent, the FFCx kernels.

The tangent is `derivative(R, fields)` plus, for each quantity of the material law, the residual with
that quantity exchanged for its own consistent tangent. Forms are written and compiled without a mesh,
once per process and on disk.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import ufl
from ufl import SpatialCoordinate
from ufl.algorithms.analysis import has_type
from ufl.algorithms.check_arities import ArityMismatch, check_form_arity

from tawami.base.errors import FormError, InputError, MissingDependencyError, OutputError
from tawami.base.timing import tally
from tawami.fem import dolfinx, kernels, rules
from tawami.fem.rules import DEGREE, Rule, TangentRule
from tawami.form.form import Form
from tawami.form.quantities import Density
from tawami.form.symbols import PLACEHOLDERS, Symbols


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
        """The rule whose particle data these are (densities only)."""
        assert self.source != "fields"
        assert self.source != "traction"
        return "particle" if self.source == "reduced" else self.source


@dataclass(frozen=True)
class Integral:
    """A compiled integral and what it reads; `rank` is 1 for vectors and 2 for matrices."""

    rank: int
    kernel: kernels.Kernel
    slots: tuple[Slot, ...]
    constants: tuple[str, ...]

    @property
    def width(self) -> int:
        """Entries per cell of the packed coefficients."""
        return sum(slot.width for slot in self.slots)


@dataclass(frozen=True)
class CompiledForm:
    """A form ready to be attached to a grid.

    Attributes:
        form: What it was compiled from.
        element: Element of all fields on the mesh: biquadratic displacement, bilinear others.
        residual: Its integrals over cells, one per quadrature rule.
        edges: Compiles its integral over loaded edges, if it has one: not before there is a load.
        tangent: Derivative of `residual`, one per quadrature rule.
        couplings: What it has besides: products of two integrals of rank 1, cell by cell.
        ghost: Its integral over sides of partly filled cells, if it has one: of rank 2, the residual
            being linear there.
        densities: Particle data per rule: each density with its first column.
        used: Those of the form's parameters that its residual names with these options.
    """

    form: Form
    element: Any
    residual: tuple[Integral, ...]
    edges: Callable[[], Integral] | None
    tangent: tuple[Integral, ...]
    couplings: tuple[tuple[Integral, Integral], ...]
    ghost: Integral | None
    densities: Mapping[Rule, Mapping[Density, int]]
    used: frozenset[str]

    @functools.cached_property
    def traction(self) -> Integral | None:
        """The integral over loaded edges, if the form has one; a call for all ranks."""
        with tally.compiling():
            return None if self.edges is None else self.edges()

    def columns(self, rule: Rule) -> int:
        """Number of columns of the particle data of a rule."""
        return sum(density.size for density in self.densities[rule])


@contextmanager
def _refusals(form: Form) -> Iterator[None]:
    """What UFL, FFCx and the C compiler refuse, as a sentence."""
    try:
        yield
    except (Exception, ArityMismatch) as error:  # the second is no Exception in newer UFL
        if type(error).__name__ in ("VerificationError", "CompileError"):
            raise MissingDependencyError(
                f"form {form.name}: the C compiler failed on the code of FFCx: {error}. It needs gcc "
                "and Python's headers (on Debian: apt install g++ python3-dev) and room in ~/.cache"
            ) from error
        if isinstance(error, OSError):
            raise OutputError(
                f"the code of form {form.name} cannot be compiled, because the folder of compiled forms "
                f"cannot be written ({error}): expected room and write permission in ~/.cache, or "
                "another folder in the environment variable XDG_CACHE_HOME"
            ) from error
        advice = ""
        if isinstance(error, ArityMismatch):
            advice = ". Each term must be linear in one test function"
        raise FormError(f"form {form.name}: UFL or FFCx refused it: {error}{advice}") from error


def _of_type(form: Any, kind: str) -> Any | None:
    integrals = form.integrals_by_type(kind)
    return ufl.Form(integrals) if integrals else None


def _is_linear_in(form: Any, coefficient: Any) -> bool:
    """Whether a form names this coefficient and no other, once in every term."""
    if set(form.coefficients()) != {coefficient}:
        return False
    zero = ufl.zero(coefficient.ufl_shape)
    expand = ufl.algorithms.expand_derivatives
    at_zero = expand(ufl.replace(form, {coefficient: zero}))
    direction = ufl.Coefficient(coefficient.ufl_function_space(), count=PLACEHOLDERS - 2)
    slope = expand(ufl.derivative(form, coefficient, direction))
    return at_zero.empty() and coefficient not in slope.coefficients()


def _ghost(form: Form, symbols: Symbols, sides: Any) -> Any:
    """The matrix of the terms on sides of cells."""
    used = set(sides.coefficients())
    others = {density for density, symbol in symbols.placeholders.items() if symbol in used}
    matrix = ufl.replace(sides, {symbols.increments: symbols.trial})
    try:
        expanded = ufl.algorithms.expand_derivatives(matrix)
        check_form_arity(expanded, matrix.arguments())
        linear = len(matrix.arguments()) == 2 and symbols.traction not in used
    except ArityMismatch:
        linear = False
    if not linear or any(density.rule != "mean" for density in others):
        raise FormError(
            f"form {form.name}: expected terms with dG linear in the fields and, but for h, parameters "
            "and facet_mean(...), in nothing else, as "
            "facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG"
        )
    return matrix


def _by_rule(form: Any) -> list[Any]:
    """One form per quadrature rule. FFCx 0.5 puts several rules into one kernel, but a field that is
    evaluated under the rule with one point is then taken from there under the other rule as well,
    and UFL 2022 takes two integrals of one integrand under two rules for one.
    """
    rules: dict[tuple[int, str], list[Any]] = {}
    for integral in form.integrals():
        metadata = integral.metadata()
        rule = (metadata["quadrature_degree"], metadata.get("quadrature_rule", "default"))
        rules.setdefault(rule, []).append(integral)
    return [ufl.Form(rules[rule]) for rule in sorted(rules, reverse=True)]


def _reduced(tangent: Any) -> Any:
    """A tangent with the smaller rule in place of the full one."""
    full, reduced = (DEGREE[rule] for rule in ("particle", "reduced"))
    parts = []
    for part in tangent.integrals():
        metadata = part.metadata()
        if metadata["quadrature_degree"] == full:
            part = part.reconstruct(metadata={**metadata, "quadrature_degree": reduced})
        parts.append(part)
    return ufl.Form(parts)


def _compile(
    comm: Any, form: Form, options: Mapping[str, str], tangent_rule: TangentRule
) -> CompiledForm:
    symbols = Symbols(form, options)
    residual = symbols.residual()
    cells, edges = _of_type(residual, "cell"), _of_type(residual, "exterior_facet")
    for part in residual.integrals():
        if part.subdomain_id() != "everywhere":
            raise FormError(
                f"form {form.name}: a measure with a number, as dx({part.subdomain_id()}): expected dx, "
                "dx_c and ds as they are; where the body is follows from the particles"
            )
    if any(has_type(part.integrand(), SpatialCoordinate) for part in residual.integrals()):
        raise FormError(
            f"form {form.name}: the position x in a term: expected position-dependent data at the "
            "particles (material, volume) or in scene.traction(...)"
        )
    if edges is not None and not _is_linear_in(edges, symbols.traction):
        raise FormError(
            f"form {form.name}: expected edge terms linear in the traction t and in nothing else but "
            "the test functions, as - dot(t, w) * ds; give other loads through scene.traction(...)"
        )
    sides = _of_type(residual, "interior_facet")
    parts = [part for part in (cells, edges, sides) if part is not None]
    if cells is None or len(residual.integrals()) > sum(len(part.integrals()) for part in parts):
        raise FormError(
            f"form {form.name}: expected integrals over particles or cells, over edges (ds) and over "
            "sides of partly filled cells (dG) only"
        )
    if symbols.traction in cells.coefficients():
        raise FormError(f"form {form.name}: the traction t belongs into terms with ds, not with dx")
    with _refusals(form):
        tangent, couplings = symbols.tangent(cells), symbols.couplings(cells)
    at_particles: Rule = "particle"
    if tangent_rule == "reduced":
        tangent, at_particles = _reduced(tangent), "reduced"
    ghost = None if sides is None else _ghost(form, symbols, sides)
    densities: dict[Rule, dict[Density, int]] = {rule: {} for rule in (*DEGREE, "mean")}
    width = dict.fromkeys(densities, 0)
    for density in symbols.placeholders:
        densities[density.rule][density] = width[density.rule]
        width[density.rule] += density.size

    def integral(
        ufl_form: Any, kind: kernels.Kind = "cell", at_particles: Rule = "particle"
    ) -> Integral:
        used = set(ufl_form.coefficients())
        displacement, bilinear = dolfinx.DISPLACEMENT_DOFS, dolfinx.BILINEAR_DOFS
        kinds = {
            symbols.increments: Slot("fields", displacement + bilinear * (len(form.fields) - 1)),
            symbols.traction: Slot("traction", displacement),
        }
        exchange = {}
        for rule in densities:
            mine = {d: s for d, s in symbols.placeholders.items() if d.rule == rule and s in used}
            size = sum(density.size for density in mine)
            if size == 0:
                continue
            points = at_particles if rule == "particle" else rule
            together = ufl.Coefficient(symbols.space(points, size), count=2 + len(kinds))
            columns: list[int] = []
            for density, symbol in mine.items():
                first, start = len(columns), densities[rule][density]
                exchange[symbol] = ufl.as_vector([together[first + k] for k in range(density.size)])
                columns += range(start, start + density.size)
            kinds[together] = Slot(
                points, max(len(rules.rule_points(points)), 1) * size, tuple(columns)
            )
        ufl_form = ufl.replace(ufl_form, exchange)
        with _refusals(form):
            # FFCx checks this too, but in newer versions it then leaves its cache locked
            check_form_arity(ufl.algorithms.expand_derivatives(ufl_form), ufl_form.arguments())
            kernel = kernels.compile_kernel(comm, ufl_form, kind)
        order = ufl_form.coefficients()
        slots = tuple(kinds[order[i]] for i in kernel.coefficients)
        names = {constant: name for name, constant in symbols.constants.items()}
        constants = tuple(names[c] for c in ufl_form.constants())
        return Integral(len(ufl_form.arguments()), kernel, slots, constants)

    return CompiledForm(
        form=form,
        element=symbols.element,
        residual=tuple(integral(part) for part in _by_rule(cells)),
        edges=None if edges is None else lambda: integral(edges, "exterior_facet"),
        tangent=tuple(integral(part, at_particles=at_particles) for part in _by_rule(tangent)),
        ghost=integral(ghost, "interior_facet") if ghost is not None else None,
        couplings=tuple((integral(left), integral(right)) for left, right in couplings),
        densities=densities,
        used=_named(symbols, residual),
    )


def _named(symbols: Symbols, residual: Any) -> frozenset[str]:
    """Parameters that a residual names."""
    used = set(residual.constants())
    return frozenset(name for name in symbols.form.parameters if symbols.constants[name] in used)


_compiled: dict[tuple[Form, TangentRule, tuple[tuple[str, str], ...]], CompiledForm] = {}


def compile_form(
    comm: Any, form: Form, options: Mapping[str, str], tangent_rule: TangentRule = "full"
) -> CompiledForm:
    """Compile a form with its options; the result is kept for the process and on disk.

    Args:
        comm: Communicator; a collective call.
        form: The form.
        options: One value for each of the form's options.
        tangent_rule: Points of the sums over particles in the tangent: 'full', or 'reduced'.

    Raises:
        FormError: An unknown name, a forgotten test function, or what UFL and FFCx refuse.
    """
    key = (form, tangent_rule, tuple(sorted(options.items())))
    if key not in _compiled:
        with tally.compiling():
            _compiled[key] = _compile(comm, form, options, tangent_rule)
    return _compiled[key]


def check_used(
    compiled: CompiledForm, options: Mapping[str, str], given: Mapping[str, Any]
) -> None:
    """Whether a form with its options uses all parameters that it was given.

    Raises:
        InputError: One has no effect; the message names the option with which it has.
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
    return name in _named(symbols, symbols.residual())
