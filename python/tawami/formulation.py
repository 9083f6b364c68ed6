"""The contract of a weak form: what a file in `forms/` declares, and how its tangent is derived.

A form declares `fields`, `kinematics`, optionally `parameters` and `options`, and a function
`residual` whose arguments are picked by their names:

========================= ========================================================================
the fields, the tests     u, w, eps_v, q, ... as declared in `fields`
sigma, s, sigma_m         in-plane stress, its (three-dimensional) deviator, mean stress: of the law
K, mu                     bulk and shear modulus of the particle; `K**2 / mu`, `1 / K` work
sum_p(D, f), sum_p(f)     sum over particles of V_p D_p : f(x_p), and of V_p f(x_p); exact for f up
                          to degree 4 along x and along y (a warning tells of more)
sum_c(D, f), sum_c(f)     the same with f taken at the centre of the particle's cell
cell_mean(D)              volume-weighted mean over the particles of each cell
dx, dx_c, ds              area of the cells with particles (full rule, one point); loaded edges
t, h                      traction [Pa], cell size [m]
parameters, options       alpha, ...: as declared
========================= ========================================================================

Particle data enter as volume-weighted densities on the points of a fixed rule; there is exactly one
in each `sum_p`, which makes the integral equal to the sum over the particles (formulation.md,
section 2). The tangent is `derivative(R, fields)` plus, for each law quantity, its own consistent
tangent put in its place.
"""

from __future__ import annotations

import functools
import importlib.util
import inspect
import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import ufl

from tawami import _dolfinx
from tawami.errors import FormError, InputError

Rule = Literal["particle", "centre", "mean"]
Part = Literal["value", "strain", "volume"]

#: Quadrature degree of each rule: 5 x 5 points make the tangent of quadratic splines exact.
DEGREE: Mapping[Rule, int] = {"particle": 8, "centre": 1}
KINDS = ("displacement", "volumetric_strain", "pressure")
KINEMATICS: Mapping[str, tuple[str, ...]] = {
    "displacement": (),
    "cell": (),
    "mixed": ("volumetric_strain",),
    "deviatoric": ("pressure",),
}
#: FFCx 0.5 writes C that does not compile when a coefficient's number has two digits, so those that
#: reach it are numbered from 0 and those that only stand in while a form is written from here.
_PLACEHOLDERS = 1000
#: Components of the quantities that the material law gives.
LAW = {"sigma": 3, "s": 3, "sigma_m": 1}
#: Degree along x and y that the densities of `sum_p` integrate exactly.
EXACT_DEGREE = 4
#: Names that every form has.
RESERVED = frozenset((*LAW, "K", "mu", "t", "h", "dx", "dx_c", "ds", "sum_p", "sum_c", "cell_mean"))


class InexactSumWarning(UserWarning):
    """A `sum_p` of an expression of too high a degree to be the sum over the particles."""


OPERATIONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power
}  # fmt: skip


@dataclass(frozen=True)
class ParticleScalar:
    """A constant of the particle, as K or K**2/mu: an expression to be evaluated at the particles.

    Attributes:
        text: How it was written; two with the same text are the same density.
        evaluate: From the named arrays (one entry per particle) to its values.
    """

    text: str
    evaluate: Callable[[Mapping[str, Any]], Any] = field(compare=False)

    def _binary(self, other: Any, symbol: str, *, swap: bool = False) -> ParticleScalar:
        if not isinstance(other, ParticleScalar):
            if not isinstance(other, (int, float)):
                raise FormError(
                    f"'{self.text} {symbol} ...': a particle constant combines with numbers and other "
                    f"particle constants only, not with {type(other).__name__}. Put it into "
                    "sum_p(constant, expression) instead"
                )
            number = float(other)
            other = ParticleScalar(repr(other), lambda _: number)
        a, b = (other, self) if swap else (self, other)
        operation = OPERATIONS[symbol]
        return ParticleScalar(
            f"({a.text} {symbol} {b.text})", lambda v: operation(a.evaluate(v), b.evaluate(v))
        )

    def __add__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "+")

    def __radd__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "+", swap=True)

    def __sub__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "-")

    def __rsub__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "-", swap=True)

    def __mul__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "*")

    def __rmul__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "*", swap=True)

    def __truediv__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "/")

    def __rtruediv__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "/", swap=True)

    def __pow__(self, other: Any) -> ParticleScalar:
        return self._binary(other, "**")


@dataclass(frozen=True)
class LawQuantity:
    """A quantity that the material law gives, with its consistent tangent."""

    name: str


Quantity = ParticleScalar | LawQuantity
K = ParticleScalar("K", lambda values: values["K"])
MU = ParticleScalar("mu", lambda values: values["mu"])
ONE = ParticleScalar("1", lambda values: np.ones_like(values["mu"]))


@dataclass(frozen=True)
class Density:
    """Particle data on the points of a rule: `part` of `quantity`, with `size` components."""

    rule: Rule
    quantity: Quantity
    part: Part = "value"

    @property
    def size(self) -> int:
        """Number of components."""
        if isinstance(self.quantity, ParticleScalar):
            return 1
        return LAW[self.quantity.name] * (3 if self.part == "strain" else 1)


@dataclass(frozen=True, eq=False)
class Form:
    """A weak form; compared by identity.

    Args:
        fields: Unknowns: name -> (kind, name of the test function). Kinds are 'displacement' (in
            the basis the scene chooses), 'volumetric_strain' and 'pressure' [Pa] (both bilinear).
        kinematics: 'displacement', 'mixed', 'cell' or 'deviatoric': the strain that the material
            law receives.
        residual: Function that returns the residual as a UFL form.
        parameters: Numbers that may change without compiling again: name -> {"default": ...,
            "minimum": ..., "maximum": ...}, the limits optional.
        options: Choices that make a different form: name -> the possible values, default first.
        name: What messages call it.

    Raises:
        FormError: A declaration that does not fit together.
    """

    fields: Mapping[str, tuple[str, str]]
    kinematics: str
    residual: Callable[..., Any]
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    options: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    name: str = "of the driver script"

    def __post_init__(self) -> None:
        for name, declared in self.fields.items():
            if isinstance(declared, str) or len(declared) != 2:
                self._fail(f"field '{name}' is {declared!r}: expected (kind, test function)")
        for name, limits in self.parameters.items():
            if "default" not in limits:
                self._fail(f"parameter '{name}' has no \"default\"")
        names = [*self.fields, *(test for _, test in self.fields.values())]
        names += [*self.parameters, *self.options, *RESERVED]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            self._fail(f"{_list(twice)} stands for two things: expected another name for one")
        kinds = [kind for kind, _ in self.fields.values()]
        for name, (kind, _) in self.fields.items():
            if kind not in KINDS:
                self._fail(f"field '{name}' is of kind '{kind}': expected one of {_list(KINDS)}")
        if self.kinematics not in KINEMATICS:
            self._fail(f"kinematics = '{self.kinematics}': expected one of {_list(KINEMATICS)}")
        wanted = ("displacement", *KINEMATICS[self.kinematics])
        if tuple(kinds) != wanted:
            self._fail(
                f"kinematics '{self.kinematics}' needs fields of the kinds {_list(wanted)}, in this "
                f"order; it declares {_list(kinds)}"
            )

    def _fail(self, message: str) -> None:
        raise FormError(f"form {self.name}: {message}")

    @staticmethod
    def load(source: str | Path | ModuleType | Form) -> Form:
        """The form of a shipped name ('u_epsv'), a file, or a module; a `Form` passes through.

        Raises:
            FormError: No such form, or a file that does not declare what a form needs.
        """
        if isinstance(source, Form):
            return source
        if isinstance(source, ModuleType):
            return _from_module(source, getattr(source, "residual", None))
        if not isinstance(source, str | Path):
            raise FormError(
                f"form = {source!r}: expected the name of a shipped form, the path of a .py file, a "
                "module or a Form"
            )
        path = Path(source)
        if path.suffix != ".py":
            path = Path(__file__).parent / "forms" / f"{source}.py"
            if not path.exists():
                raise FormError(
                    f"form '{source}' is not shipped: expected one of {_list(shipped())}, "
                    "or the path of a .py file"
                )
        elif not path.exists():
            raise FormError(f"form file '{source}' does not exist")
        resolved = path.resolve()
        return _from_file(resolved, resolved.stat().st_mtime_ns)

    def settings(self, given: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, str]]:
        """Parameters and options of this form, defaults filled in.

        Raises:
            InputError: An unknown name, or a value out of its limits.
        """
        parameters = {name: declared["default"] for name, declared in self.parameters.items()}
        options = {name: choices[0] for name, choices in self.options.items()}
        for name, value in given.items():
            if name in parameters:
                parameters[name] = self._number(name, value)
            elif name in options:
                if value not in self.options[name]:
                    raise InputError(
                        f"{name} = {value!r}: expected one of {_list(self.options[name])}"
                    )
                options[name] = value
            else:
                known = [*parameters, *options]
                has = f"it has {_list(known)}" if known else "it has none"
                raise InputError(f"form {self.name} has no parameter '{name}': {has}")
        return parameters, options

    def _number(self, name: str, value: Any) -> float:
        limits = self.parameters[name]
        low, high = limits.get("minimum", -math.inf), limits.get("maximum", math.inf)
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise InputError(f"{name} = {value!r}: expected a number") from None
        if not (math.isfinite(number) and low <= number <= high):
            raise InputError(f"{name} = {value!r}: expected a finite number from {low} to {high}")
        return number


def shipped() -> list[str]:
    """Names of the forms that come with tawami."""
    return sorted(path.stem for path in (Path(__file__).parent / "forms").glob("[!_]*.py"))


@functools.cache
def _from_file(path: Path, _modified: int) -> Form:
    specification = importlib.util.spec_from_file_location(f"tawami_form_{path.stem}", path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    try:
        specification.loader.exec_module(module)
    except Exception as error:
        raise FormError(f"form file '{path.name}' cannot be read: {error!r}") from error
    return _from_module(module, getattr(module, "residual", None), f"'{path.stem}'")


@functools.cache
def _from_module(module: ModuleType, _residual: Any, name: str | None = None) -> Form:
    """The form of a module; another one once the module is reloaded with another residual."""
    missing = [n for n in ("fields", "kinematics", "residual") if not hasattr(module, n)]
    name = name or f"'{module.__name__}'"
    if missing:
        raise FormError(f"form {name} declares no {_list(missing)}: see tawami.formulation")
    return Form(
        fields=module.fields,
        kinematics=module.kinematics,
        residual=module.residual,
        parameters=getattr(module, "parameters", {}),
        options=getattr(module, "options", {}),
        name=name,
    )


def _list(names: Any) -> str:
    return ", ".join(f"'{name}'" for name in names)


# -- compilation ---------------------------------------------------------------


@dataclass(frozen=True)
class Slot:
    """One coefficient of a kernel, in packed order.

    Attributes:
        source: 'fields' (the increments), 'traction', or the rule of particle densities.
        width: Entries per cell.
        columns: Columns of the rule's particle data (densities only).
    """

    source: Literal["fields", "traction"] | Rule
    width: int
    columns: tuple[int, ...] = ()


@dataclass(frozen=True)
class Integral:
    """A compiled integral and what it reads."""

    kernel: _dolfinx.Kernel
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
        traction: Its integral over loaded edges, if it has one.
        tangent: Derivative of `residual`, one per quadrature rule.
        densities: Particle data per rule: each density with its first column.
    """

    form: Form
    element: Any
    residual: tuple[Integral, ...]
    traction: Integral | None
    tangent: tuple[Integral, ...]
    densities: Mapping[Rule, Mapping[Density, int]]

    def columns(self, rule: Rule) -> int:
        """Number of columns of the particle data of a rule."""
        return sum(density.size for density in self.densities[rule])


class _Symbols:
    """Everything a residual may name, on a mesh that is not there yet."""

    def __init__(self, form: Form, options: Mapping[str, str]) -> None:
        self.form = form
        domain = _dolfinx.domain()
        elements = [_dolfinx.lagrange(2, 2)] + [_dolfinx.lagrange(1)] * (len(form.fields) - 1)
        self.element = elements[0] if len(elements) == 1 else _dolfinx.mixed(elements)
        space = ufl.FunctionSpace(domain, self.element)
        self.domain = domain
        self.increments = ufl.Coefficient(space, count=0)
        self.trial = ufl.TrialFunction(space)
        test = ufl.TestFunction(space)
        self.fields = self._split(self.increments)
        self.trials = self._split(self.trial)
        tests = self._split(test)
        self.tests = {form.fields[name][1]: tests[name] for name in form.fields}
        self.traction = ufl.Coefficient(ufl.FunctionSpace(domain, _dolfinx.lagrange(2, 2)), count=1)
        self.constants = {
            name: ufl.Constant(domain, count=k) for k, name in enumerate(("h", *form.parameters))
        }
        self.measures = {
            rule: ufl.dx(domain=domain, metadata={"quadrature_degree": degree})
            for rule, degree in DEGREE.items()
        }
        self.placeholders: dict[Density, Any] = {}
        self.names = {
            **self.fields,
            **self.tests,
            **self.constants,
            **{name: LawQuantity(name) for name in LAW},
            **options,
            "K": K,
            "mu": MU,
            "t": self.traction,
            "dx": self.measures["particle"],
            "dx_c": self.measures["centre"],
            "ds": ufl.ds(domain=domain, metadata={"quadrature_degree": 4}),
            "sum_p": functools.partial(self._sum, "particle"),
            "sum_c": functools.partial(self._sum, "centre"),
            "cell_mean": self._cell_mean,
        }

    def _split(self, function: Any) -> dict[str, Any]:
        names = list(self.form.fields)
        parts = [function] if len(names) == 1 else ufl.split(function)
        return dict(zip(names, parts, strict=True))

    def space(self, rule: Rule, size: int) -> Any:
        element = (
            _dolfinx.per_cell(size) if rule == "mean" else _dolfinx.at_points(DEGREE[rule], size)
        )
        return ufl.FunctionSpace(self.domain, element)

    def density(self, density: Density) -> Any:
        """The coefficient that stands for a density while the form is being written."""
        if density not in self.placeholders:
            count = _PLACEHOLDERS + len(self.placeholders)
            self.placeholders[density] = ufl.Coefficient(
                self.space(density.rule, density.size), count=count
            )
        return self.placeholders[density]

    def _quantity(self, quantity: Any, caller: str) -> Quantity:
        if isinstance(quantity, (int, float)):
            return ONE * quantity
        if not isinstance(quantity, (ParticleScalar, LawQuantity)):
            raise FormError(
                f"form {self.form.name}: {caller} takes a particle quantity (sigma, s, sigma_m, K, "
                f"mu, or arithmetic of K and mu) first, not {quantity}"
            )
        return quantity

    def _sum(self, rule: Rule, *arguments: Any) -> Any:
        caller = {"particle": "sum_p", "centre": "sum_c"}[rule]
        if len(arguments) not in (1, 2):
            raise FormError(
                f"form {self.form.name}: {caller} takes (quantity, expression) or (expression), "
                f"not {len(arguments)} arguments"
            )
        quantity = self._quantity(arguments[0], caller) if len(arguments) == 2 else ONE
        expression = ufl.as_ufl(arguments[-1])
        if isinstance(quantity, LawQuantity):
            self._check_place(rule, quantity)
        if rule == "particle":
            self._check_degree(expression)
        c = self.density(Density(rule, quantity))
        weight = ufl.as_matrix([[c[0], c[2]], [c[2], c[1]]]) if len(c) == 3 else c[0]
        if weight.ufl_shape != expression.ufl_shape:
            raise FormError(
                f"form {self.form.name}: {caller} got a quantity of shape {weight.ufl_shape} and an "
                f"expression of shape {expression.ufl_shape}: expected the same shape"
            )
        return ufl.inner(weight, expression) * self.measures[rule]

    def _check_place(self, rule: Rule, quantity: LawQuantity) -> None:
        """In B-bar the deviator depends on the strain at the particle and the mean stress on that
        at the centre: only there are their tangents known.
        """
        cell, centre = self.form.kinematics == "cell", rule == "centre"
        if not cell and centre:
            raise FormError(
                f"form {self.form.name}: sum_c({quantity.name}, ...) needs kinematics 'cell': "
                "elsewhere the stress depends on the strain at the particle"
            )
        if cell and quantity.name != ("sigma_m" if centre else "s"):
            raise FormError(
                f"form {self.form.name}: {'sum_c' if centre else 'sum_p'}({quantity.name}, ...) with "
                "kinematics 'cell': expected sum_p(s, ...) and sum_c(sigma_m, ...) only"
            )

    def _check_degree(self, expression: Any) -> None:
        # UFL's estimate for squares is a multiple of the degree along one axis; 1 for u_x would be 2.
        unit = ufl.algorithms.estimate_total_polynomial_degree(self.traction[0]) / 2
        expanded = ufl.algorithms.apply_algebra_lowering.apply_algebra_lowering(expression)
        degree = ufl.algorithms.estimate_total_polynomial_degree(expanded) / unit
        if degree > EXACT_DEGREE:
            warnings.warn(
                f"form {self.form.name}: sum_p of an expression of degree {degree:g} (products count "
                f"together) is not exactly the sum over the particles, which it is up to "
                f"{EXACT_DEGREE}; what is nonlinear in the fields belongs into the material law",
                InexactSumWarning,
                stacklevel=2,
            )

    def _cell_mean(self, quantity: Any) -> Any:
        quantity = self._quantity(quantity, "cell_mean")
        if isinstance(quantity, LawQuantity):
            raise FormError(
                f"form {self.form.name}: cell_mean takes constants (K, mu), not '{quantity.name}'"
            )
        return self.density(Density("mean", quantity))[0]

    def call(self, **other: Any) -> Any:
        """The residual as the form file states it, with some names standing for something else."""
        form = self.form
        names = {**self.names, **other}
        wanted = inspect.signature(form.residual).parameters
        unknown = [name for name in wanted if name not in names]
        if unknown:
            raise FormError(
                f"form {form.name}: residual asks for {_list(unknown)}, which is neither a field nor "
                f"anything else it can have: expected names among {_list(sorted(names))}"
            )
        try:
            return form.residual(**{name: names[name] for name in wanted})
        except (FormError, Warning):
            raise
        except Exception as error:
            raise FormError(f"form {form.name}: its residual raised {error!r}") from error

    def residual(self) -> Any:
        """The residual, checked to be a UFL form that uses every test function."""
        residual = self.call()
        if not isinstance(residual, ufl.Form):
            raise FormError(
                f"form {self.form.name}: residual returned {type(residual).__name__}: expected a UFL "
                "form (sums of sum_p(...) and of expressions * dx or * ds)"
            )
        for unknown, (_, test) in self.form.fields.items():
            components = 2 if self.fields[unknown].ufl_shape else 1
            space = ufl.FunctionSpace(self.domain, _dolfinx.lagrange(1, components))
            stranger = ufl.Coefficient(space, count=_PLACEHOLDERS - 1)
            named = test in inspect.signature(self.form.residual).parameters
            if not named or residual.equals(self.call(**{test: stranger})):
                raise FormError(
                    f"form {self.form.name}: the test function '{test}' of field '{unknown}' does not "
                    "appear in its residual: every field needs its equation"
                )
        return residual

    def _direction(self, density: Density) -> Any:
        """Change of a law quantity with the fields: C : strain(du) + c d_eps_v."""
        assert isinstance(density.quantity, LawQuantity)
        kinematics, n = self.form.kinematics, LAW[density.quantity.name]
        du, *volumetric = self.trials.values()
        change = [ufl.as_ufl(0.0)] * n
        if density.rule == "particle":
            e = ufl.sym(ufl.grad(du))
            strain = (e[0, 0], e[1, 1], 2 * e[0, 1])
            c = self.density(Density(density.rule, density.quantity, "strain"))
            change = [sum(c[3 * i + j] * strain[j] for j in range(3)) for i in range(n)]
        volume = None
        if kinematics == "mixed":
            volume = volumetric[0]
        elif kinematics == "cell" and density.rule == "centre":
            volume = ufl.div(du)
        if volume is not None:
            c = self.density(Density(density.rule, density.quantity, "volume"))
            change = [change[i] + c[i] * volume for i in range(n)]
        return ufl.as_vector(change)

    def tangent(self, residual: Any) -> Any:
        """Derivative with respect to the fields, the law's part by its consistent tangent."""
        tangent = ufl.algorithms.expand_derivatives(
            ufl.derivative(residual, self.increments, self.trial)
        )
        for density, symbol in list(self.placeholders.items()):
            if isinstance(density.quantity, LawQuantity) and density.part == "value":
                # Linear in each density: what is bilinear after the exchange is its share.
                tangent += ufl.lhs(ufl.replace(residual, {symbol: self._direction(density)}))
        return tangent


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
    direction = ufl.Coefficient(coefficient.ufl_function_space(), count=_PLACEHOLDERS - 2)
    slope = expand(ufl.derivative(form, coefficient, direction))
    return at_zero.empty() and coefficient not in slope.coefficients()


def _by_rule(form: Any) -> list[Any]:
    """One form per quadrature rule. FFCx 0.5 puts several rules into one kernel, but a field that is
    evaluated under the rule with one point is then taken from there under the other rule as well,
    and UFL 2022 takes two integrals of one integrand under two rules for one.
    """
    rules: dict[int, list[Any]] = {}
    for integral in form.integrals():
        rules.setdefault(integral.metadata()["quadrature_degree"], []).append(integral)
    return [ufl.Form(rules[degree]) for degree in sorted(rules, reverse=True)]


def _compile(comm: Any, form: Form, options: Mapping[str, str]) -> CompiledForm:
    symbols = _Symbols(form, options)
    residual = symbols.residual()
    cells, edges = _of_type(residual, "cell"), _of_type(residual, "exterior_facet")
    for part in residual.integrals():
        if part.subdomain_id() != "everywhere":
            raise FormError(
                f"form {form.name}: a measure with a number, as dx({part.subdomain_id()}): expected dx, "
                "dx_c and ds as they are; where the body is follows from the particles"
            )
    if edges is not None and not _is_linear_in(edges, symbols.traction):
        raise FormError(
            f"form {form.name}: expected edge terms linear in the traction t and in nothing else but "
            "the test functions, as - dot(t, w) * ds; give other loads through scene.traction(...)"
        )
    if cells is None or len(residual.integrals()) > len(cells.integrals()) + (
        len(edges.integrals()) if edges is not None else 0
    ):
        raise FormError(
            f"form {form.name}: expected integrals over particles or cells, and over edges (ds) only"
        )
    if symbols.traction in cells.coefficients():
        raise FormError(f"form {form.name}: the traction t belongs into terms with ds, not with dx")
    tangent = symbols.tangent(cells)
    densities: dict[Rule, dict[Density, int]] = {"particle": {}, "centre": {}, "mean": {}}
    width = dict.fromkeys(densities, 0)
    for density in symbols.placeholders:
        densities[density.rule][density] = width[density.rule]
        width[density.rule] += density.size

    def integral(ufl_form: Any, *, facets: bool = False) -> Integral:
        used = set(ufl_form.coefficients())
        kinds = {symbols.increments: Slot("fields", 18 + 4 * (len(form.fields) - 1)),
                 symbols.traction: Slot("traction", 18)}  # fmt: skip
        exchange = {}
        for rule in densities:
            mine = {d: s for d, s in symbols.placeholders.items() if d.rule == rule and s in used}
            size = sum(density.size for density in mine)
            if size == 0:
                continue
            together = ufl.Coefficient(symbols.space(rule, size), count=2 + len(kinds))
            columns: list[int] = []
            for density, symbol in mine.items():
                first, start = len(columns), densities[rule][density]
                exchange[symbol] = ufl.as_vector([together[first + k] for k in range(density.size)])
                columns += range(start, start + density.size)
            points = len(_dolfinx.reference_points(DEGREE[rule])) if rule != "mean" else 1
            kinds[together] = Slot(rule, points * size, tuple(columns))
        ufl_form = ufl.replace(ufl_form, exchange)
        try:
            kernel = _dolfinx.compile_kernel(comm, ufl_form, facets=facets)
        except Exception as error:
            raise FormError(
                f"form {form.name}: UFL or FFCx refused it: {error}. Each term must be linear in one "
                "test function"
            ) from error
        order = ufl_form.coefficients()
        slots = tuple(kinds[order[i]] for i in kernel.coefficients)
        names = {constant: name for name, constant in symbols.constants.items()}
        return Integral(kernel, slots, tuple(names[c] for c in ufl_form.constants()))

    return CompiledForm(
        form=form,
        element=symbols.element,
        residual=tuple(integral(part) for part in _by_rule(cells)),
        traction=integral(edges, facets=True) if edges is not None else None,
        tangent=tuple(integral(part) for part in _by_rule(tangent)),
        densities=densities,
    )


_compiled: dict[tuple[Form, tuple[tuple[str, str], ...]], CompiledForm] = {}


def compile_form(comm: Any, form: Form, options: Mapping[str, str]) -> CompiledForm:
    """Compile a form with its options; the result is kept for the process and on disk.

    Args:
        comm: Communicator; a collective call.
        form: The form.
        options: One value for each of the form's options.

    Raises:
        FormError: An unknown name, a forgotten test function, or what UFL and FFCx refuse.
    """
    key = (form, tuple(sorted(options.items())))
    if key not in _compiled:
        _compiled[key] = _compile(comm, form, options)
    return _compiled[key]
