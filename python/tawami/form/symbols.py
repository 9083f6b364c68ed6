"""The names that a residual may use, as UFL symbols on a mesh without cells."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any, Literal

import ufl
from ufl import SpatialCoordinate

from tawami.base.errors import FormError
from tawami.base.space import PLANE, Space
from tawami.base.text import meant, quoted
from tawami.fem import dolfinx
from tawami.fem.rules import DEGREE, FAMILY, Rule
from tawami.form.fields import element_of
from tawami.form.foreign import Known, check_symbols
from tawami.form.form import Form
from tawami.form.lines import Lines, Measure
from tawami.form.operators import ADVICE, Operators
from tawami.form.particle_data import PLACEHOLDERS, ParticleData
from tawami.form.quantities import HISTORY, Density, density, named
from tawami.form.sums import Sums

#: Evaluation of a form: by kernels at the particles, or by integrals over cells in plain dolfinx.
Assembly = Literal["points", "dolfinx"]
#: Traction and measure of the terms with which forms took loads on edges of the grid before.
OF_EDGES = ("t", "ds")
#: What the terms of a residual are.
TERMS = (
    "expressions of one shape in a sum, and a number in each term of sum_p, as dot(a, b) of vectors or "
    "inner(A, B) of tensors"
)


class Symbols:
    """The names that a residual may use.

    Args:
        form: The form.
        options: The value of each of its options.
        plastic_volume: Whether plastic flow may change the volume; otherwise eps_p is zero.
        assembly: 'dolfinx' for sums over particles as integrals over cells.
        space: Dimension and geometry.
        histories: Names of the history variables of the laws.
        fields_of_particles: Parameters whose value is one number for each particle.

    Attributes:
        data: Placeholders of the particle data that the residual, or its tangent, uses.
        constants: Constants by name: h, time, dt, b and the parameters.
        increments, trial, test_function: Increments of all fields, their trial and their test function.
        old: All fields at the start of the step.
        fields, tests, trials: The parts of these for each field; test functions by their own name.
        operators: Differential operators of the geometry.
        lines: Source of the residual.
        names: Function that makes the symbol of each name that the residual may ask for.
    """

    def __init__(
        self,
        form: Form,
        options: Mapping[str, str],
        *,
        plastic_volume: bool = True,
        assembly: Assembly = "points",
        space: Space = PLANE,
        histories: Collection[str] = (),
        fields_of_particles: Collection[str] = (),
    ) -> None:
        self.form, self.assembly, self.space = form, assembly, space
        self.lines = Lines(form.name, form.residual)
        self.domain = domain = dolfinx.domain()
        self.operators = Operators(space, domain)
        self.element = element_of(form.fields)
        functions = ufl.FunctionSpace(domain, self.element)
        self.increments, self.old = (ufl.Coefficient(functions, count=k) for k in (0, 2))
        self.trial = ufl.TrialFunction(functions)
        self.fields, self.trials = self._split(self.increments), self._split(self.trial)
        self.test_function = ufl.TestFunction(functions)
        tests = self._split(self.test_function)
        self.tests = {field.test: tests[name] for name, field in form.fields.items()}
        shapes = dict.fromkeys(("h", "time", "dt"), ()) | {"b": (space.dim,)}
        shapes |= dict.fromkeys(form.parameters, ())
        self.constants = {
            name: Known(domain, shape, count=k) for k, (name, shape) in enumerate(shapes.items())
        }
        self.data = ParticleData(self.operators, plastic_volume=plastic_volume)
        self.names = self._all_names(options, histories, fields_of_particles)

    def _all_names(
        self,
        options: Mapping[str, str],
        histories: Collection[str],
        fields_of_particles: Collection[str],
    ) -> dict[str, Callable[[], Any]]:
        """Function that makes the symbol of each name: particle data are read only if asked for."""
        form, data = self.form, self.data
        sums = Sums(
            form, data, self.lines, self.measure, self.border, self.old,
            reference=self.assembly == "dolfinx",
        )  # fmt: skip
        ready = {
            **self.fields, **self.tests, **self.constants, **options, **self.operators.names,
            **sums.names, "x": SpatialCoordinate(self.domain),
            "old": Old(form, self._split(self.old), data),
            "dx": self.measure("particle"), "dx_c": self.measure("centre"),
            "dG": self._sides,
            "jump_n": self._jump_n, "jump_nn": self._jump_nn, "dot_n": self._dot_n,
        }  # fmt: skip
        names: dict[str, Callable[[], Any]] = {
            **{name: partial(data.law, HISTORY + name) for name in histories},
            **{name: partial(ready.get, name) for name in ready},
            "n": self._normal,
            **{name: partial(data.scalar, named(name)) for name in ("K", "mu", "rho")},
            **{name: partial(data.law, name) for name in form.strain.quantities},
        }
        for name in (*form.data, *fields_of_particles):
            names[name] = partial(data.scalar, named(name, varies=True))
        return names

    def measure(self, rule: Rule, *, place: bool = False) -> Measure:
        """Integrals over cells with the points of a rule, or sums over particles at this place."""
        metadata: dict[str, Any] = {
            "quadrature_degree": DEGREE[rule], "quadrature_rule": FAMILY[rule]
        }  # fmt: skip
        if place:
            metadata["place"] = rule
            return Measure(self.lines, "dx", self.domain, metadata)
        return Measure(self.lines, "dx", self.domain, metadata, self.operators.volume)

    def border(self, on: tuple[str, ...] | None) -> Measure:
        """Sums over the points of the border, or over those of the parts with some names."""
        rule: Rule = "particle"
        metadata: dict[str, Any] = {
            "quadrature_degree": DEGREE[rule], "quadrature_rule": FAMILY[rule],
            "place": "border", "on": on,
        }  # fmt: skip
        return Measure(self.lines, "dx", self.domain, metadata)

    def data_of(self, symbol: Any, component: int, axes: tuple[int, ...]) -> Density | None:
        """Particle data that a symbol which is no placeholder stands for: an old field.

        Args:
            symbol: A terminal of UFL.
            component: Its component.
            axes: Axes of the derivatives of this component.
        """
        if symbol != self.old:
            return None
        if len(axes) > 1:
            raise FormError(
                "a second derivative of an old field: expected old fields and their gradients"
            )
        names = [
            (f"{name}[{k}]" if field.components > 1 else name, field.own)
            for name, field in self.form.fields.items()
            for k in range(field.components)
        ]
        name, own = names[component]
        if axes and not own:
            raise FormError(
                f"a derivative of the old displacement ({name}): expected old.u alone, or gradients of "
                "the increment u"
            )
        text = "old " + "".join((name, *(f",{self.space.axes[i]}" for i in axes)))
        return density("particle", named(text, varies=True, border=not own), self.space)

    @property
    def _sides(self) -> Measure:
        metadata = {"quadrature_degree": 4}
        return Measure(self.lines, "interior_facet", self.domain, metadata, self.operators.volume)

    def _split(self, function: Any) -> dict[str, Any]:
        names = list(self.form.fields)
        parts = [function] if len(names) == 1 else ufl.split(function)
        return dict(zip(names, parts, strict=True))

    # -- the border ----------------------------------------------------------

    def _normal(self) -> Any:
        """Outward normal of the border, with the components of a field."""
        axes = range(self.space.dim)
        return ufl.as_vector([self.data.scalar(named(f"n[{k}]", border=True)) for k in axes])

    def _dot_n(self, f: Any) -> Any:
        """A n of a tensor, or g . n of a vector, n the normal of the border."""
        return self.operators.along(f, self._normal())

    # -- jumps ---------------------------------------------------------------

    def _jump_n(self, f: Any) -> Any:
        """Jump of the normal derivative across a side."""
        n = ufl.FacetNormal(self.domain)
        slope = ufl.dot(ufl.grad(f), n)
        return slope("+") + slope("-")

    def _jump_nn(self, f: Any) -> Any:
        """Jump of the second normal derivative across a side."""
        n = ufl.FacetNormal(self.domain)
        bend = ufl.dot(ufl.dot(ufl.grad(ufl.grad(f)), n), n)
        return bend("+") - bend("-")

    # -- the residual --------------------------------------------------------

    def call(self, **other: Any) -> Any:
        """The residual of the form file, with other symbols for some names."""
        form = self.form
        try:
            wanted = inspect.signature(form.residual).parameters
        except (TypeError, ValueError) as error:
            raise FormError(
                f"form {form.name}: the arguments of its residual cannot be read ({error}): expected a "
                "function written in Python"
            ) from None
        unknown = [name for name in wanted if name not in self.names]
        if {*unknown} & {*OF_EDGES}:
            raise FormError(
                f"{self.lines.text(self.lines.first)}: residual asks for {quoted(unknown)}: tractions "
                "act without a term of the form: remove - dot(t, w) * ds; state other terms of the "
                "border as sum_b(...)"
            )
        if unknown:
            hint = meant(unknown[0], self.names)
            raise FormError(
                f"{self.lines.text(self.lines.first)}: residual asks for {quoted(unknown)}, which is "
                f"not defined: expected names among {quoted(sorted(self.names))}{hint}"
            )
        try:
            made = {name: self.names[name]() for name in wanted}
            return form.residual(**(made | {n: s for n, s in other.items() if n in made}))
        except FormError as error:
            raise self._located(error) from None
        except Warning:
            raise
        except Exception as error:
            raise self._failed(error) from error

    def _failed(self, error: Exception) -> FormError:
        """The error of a residual that raised another one, with line and remedy."""
        where = self.lines.text(self.lines.of(error))
        name = error.name if isinstance(error, NameError) else None
        if name in self.names:
            return FormError(
                f"{where}: the residual uses '{name}', which is not among its arguments: expected "
                f"residual(..., {name})"
            )
        if name is not None:
            of_ufl = f"; 'from ufl import {name}' is missing" if hasattr(ufl, name) else ""
            hint = of_ufl or meant(name, self.names)
            return FormError(f"{where}: the residual uses '{name}', which is not defined{hint}")
        said, advice = str(error).lower(), ""
        if any(word in said for word in ("shape", "rank", "dimension", "scalar")):
            advice = f": expected {TERMS}"
            advice += f". If shapes differ: {ADVICE}" if self.space.hoop else ""
        return FormError(f"{where}: its residual raised {error!r}{advice}")

    def _located(self, error: FormError) -> FormError:
        """An error of a name of the residual, with form and line."""
        if str(error).startswith("form "):
            return error
        return FormError(f"{self.lines.text(self.lines.of(error))}: {error}")

    def residual(self) -> Any:
        """The residual, after a check that it is a UFL form with every test function."""
        residual = self.call()
        if not isinstance(residual, ufl.Form):
            raise FormError(
                f"form {self.form.name}: residual returned {type(residual).__name__}: expected a UFL "
                "form (sums of sum_p(...) and of expressions * dx)"
            )
        check_symbols(self, residual)
        for unknown, field in self.form.fields.items():
            space = ufl.FunctionSpace(self.domain, dolfinx.lagrange(1, field.components))
            stranger = ufl.Coefficient(space, count=PLACEHOLDERS - 1)
            named = field.test in inspect.signature(self.form.residual).parameters
            if not named or residual.equals(self.call(**{field.test: stranger})):
                raise FormError(
                    f"{self.lines.text(self.lines.first)}: the test function '{field.test}' of field "
                    f"'{unknown}' does not appear in its residual: every field needs its equation, as "
                    f"a term sum_p({field.test} * ...)"
                )
        return residual


class Old:
    """The fields at the start of the step, as `old.p_w`, and at finite strain `old.J` = det F.

    In sums over the border also the displacement since the start of the scene.
    """

    def __init__(self, form: Form, fields: Mapping[str, Any], data: ParticleData) -> None:
        self._form, self._fields, self._data = form, fields, data

    def __getattr__(self, name: str) -> Any:
        known = [*self._form.own_fields]
        if name == next(iter(self._form.fields)):
            return self._fields[name]
        if name == "J" and self._form.strain.finite:
            return self._data.scalar(named("old J", varies=True))
        if name not in known:
            if name in self._form.fields:
                why = "only fields without a role have an old value; those of the law are in its stress"
                raise FormError(f"old.{name}: {why}: expected {quoted(known) or 'none here'}")
            raise FormError(
                f"old.{name}: expected {quoted(known) or 'no old field: each field has a role'}"
                f"{meant(name, known)}"
            )
        return self._fields[name]
