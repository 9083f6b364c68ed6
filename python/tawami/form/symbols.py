"""Everything that a residual may name, as UFL on a mesh that is not there yet."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Mapping
from typing import Any

import ufl

from tawami.base.errors import FormError, InexactSumWarning
from tawami.fem import dolfinx
from tawami.fem.rules import DEGREE, FAMILY, Rule
from tawami.form.form import Form, listed
from tawami.form.quantities import (
    COMPONENTS,
    MU,
    ONE,
    Density,
    K,
    LawQuantity,
    ParticleScalar,
    Quantity,
)

#: FFCx 0.5 writes C that does not compile when a coefficient's number has two digits, so those that
#: reach it are numbered from 0 and those that only stand in while a form is written from here.
PLACEHOLDERS = 1000
#: Degree along x and y that the densities of `sum_p` integrate exactly.
EXACT_DEGREE = 4


class Symbols:
    """Everything a residual may name, on a mesh that is not there yet."""

    def __init__(self, form: Form, options: Mapping[str, str]) -> None:
        self.form = form
        domain = dolfinx.domain()
        elements = [dolfinx.lagrange(2, 2)] + [dolfinx.lagrange(1)] * (len(form.fields) - 1)
        self.element = elements[0] if len(elements) == 1 else dolfinx.mixed(elements)
        space = ufl.FunctionSpace(domain, self.element)
        self.domain = domain
        self.increments = ufl.Coefficient(space, count=0)
        self.trial = ufl.TrialFunction(space)
        test = ufl.TestFunction(space)
        self.fields = self._split(self.increments)
        self.trials = self._split(self.trial)
        tests = self._split(test)
        self.tests = {form.fields[name][1]: tests[name] for name in form.fields}
        self.traction = ufl.Coefficient(ufl.FunctionSpace(domain, dolfinx.lagrange(2, 2)), count=1)
        self.constants = {
            name: ufl.Constant(domain, count=k) for k, name in enumerate(("h", *form.parameters))
        }
        self.measures = {
            rule: ufl.dx(
                domain=domain,
                metadata={"quadrature_degree": degree, "quadrature_rule": FAMILY[rule]},
            )
            for rule, degree in DEGREE.items()
        }
        self.placeholders: dict[Density, Any] = {}
        self.names = {
            **self.fields,
            **self.tests,
            **self.constants,
            **{name: LawQuantity(name) for name in form.strain.quantities},
            **options,
            "K": K,
            "mu": MU,
            "t": self.traction,
            "dx": self.measures["particle"],
            "dx_c": self.measures["centre"],
            "ds": ufl.ds(domain=domain, metadata={"quadrature_degree": 4}),
            "dG": ufl.dS(domain=domain, metadata={"quadrature_degree": 4}),
            "facet_mean": lambda quantity: ufl.avg(self._cell_mean(quantity)),
            "jump_n": self._jump_n,
            "jump_nn": self._jump_nn,
            "sum_p": functools.partial(self._sum, "particle"),
            "sum_c": functools.partial(self._sum, "centre"),
            "sum_v": functools.partial(self._sum, "vertex"),
            "cell_mean": self._cell_mean,
        }

    def _split(self, function: Any) -> dict[str, Any]:
        names = list(self.form.fields)
        parts = [function] if len(names) == 1 else ufl.split(function)
        return dict(zip(names, parts, strict=True))

    def space(self, rule: Rule, size: int) -> Any:
        """Space of vectors of a size at the points of a rule."""
        if rule == "mean":
            element = dolfinx.per_cell(size)
        elif rule == "vertex":
            element = dolfinx.at_vertices(size)
        else:
            element = dolfinx.at_points(DEGREE[rule], size)
        return ufl.FunctionSpace(self.domain, element)

    def density(self, density: Density) -> Any:
        """The coefficient that stands for a density while the form is being written."""
        if density not in self.placeholders:
            count = PLACEHOLDERS + len(self.placeholders)
            self.placeholders[density] = ufl.Coefficient(
                self.space(density.rule, density.size), count=count
            )
        return self.placeholders[density]

    def _quantity(self, quantity: Any, caller: str) -> Quantity:
        if isinstance(quantity, (int, float)):
            return ParticleScalar(repr(quantity), lambda v: quantity * ONE.evaluate(v))
        if not isinstance(quantity, (ParticleScalar, LawQuantity)):
            raise FormError(
                f"form {self.form.name}: {caller} takes a particle quantity "
                f"({', '.join(self.form.strain.quantities)}, K, mu, or arithmetic of K and mu) first, "
                f"not {quantity}"
            )
        return quantity

    def _sum(self, rule: Rule, *arguments: Any) -> Any:
        caller = {"particle": "sum_p", "centre": "sum_c", "vertex": "sum_v"}[rule]
        if len(arguments) not in (1, 2):
            raise FormError(
                f"form {self.form.name}: {caller} takes (quantity, expression) or (expression), "
                f"not {len(arguments)} arguments"
            )
        quantity = self._quantity(arguments[0], caller) if len(arguments) == 2 else ONE
        expression = ufl.as_ufl(arguments[-1])
        if isinstance(quantity, LawQuantity):
            self._check_place(rule, quantity, caller)
        if rule == "particle":
            self._check_degree(expression)
        c = self.density(Density(rule, quantity))
        weight = c[0]
        if len(c) == 3:
            weight = ufl.as_matrix([[c[0], c[2]], [c[2], c[1]]])
        elif len(c) == 4:
            weight = ufl.as_matrix([[c[0], c[1]], [c[2], c[3]]])
        if weight.ufl_shape != expression.ufl_shape:
            raise FormError(
                f"form {self.form.name}: {caller} got a quantity of shape {weight.ufl_shape} and an "
                f"expression of shape {expression.ufl_shape}: expected the same shape"
            )
        return ufl.inner(weight, expression) * self.measures[rule]

    def _check_place(self, rule: Rule, quantity: LawQuantity, caller: str) -> None:
        """In B-bar the deviator is taken at the particle and the mean stress at the centre: only
        there are their tangents known.
        """
        if rule == "vertex":
            raise FormError(
                f"form {self.form.name}: sum_v({quantity.name}, ...): expected constants of the "
                "particle (K, mu): the stress depends on the strain at the particle"
            )
        cell, centre = self.form.kinematics.volume_at_centre, rule == "centre"
        if not cell and centre:
            raise FormError(
                f"form {self.form.name}: sum_c({quantity.name}, ...) needs kinematics 'cell': "
                "elsewhere the stress depends on the strain at the particle"
            )
        s, mean = self.form.strain.deviator, self.form.strain.mean
        if cell and quantity.name != (mean if centre else s):
            raise FormError(
                f"form {self.form.name}: {caller}({quantity.name}, ...) with "
                f"kinematics 'cell': expected sum_p({s}, ...) and sum_c({mean}, ...) only"
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

    def _jump_n(self, f: Any) -> Any:
        """Jump of the normal derivative across a facet."""
        n = ufl.FacetNormal(self.domain)
        slope = ufl.dot(ufl.grad(f), n)
        return slope("+") + slope("-")

    def _jump_nn(self, f: Any) -> Any:
        """Jump of the second normal derivative across a facet."""
        n = ufl.FacetNormal(self.domain)
        bend = ufl.dot(ufl.dot(ufl.grad(ufl.grad(f)), n), n)
        return bend("+") - bend("-")

    def call(self, **other: Any) -> Any:
        """The residual as the form file states it, with some names standing for something else."""
        form = self.form
        names = {**self.names, **other}
        try:
            wanted = inspect.signature(form.residual).parameters
        except (TypeError, ValueError) as error:
            raise FormError(
                f"form {form.name}: the arguments of its residual cannot be read ({error}): expected a "
                "function written in Python"
            ) from None
        unknown = [name for name in wanted if name not in names]
        if unknown:
            raise FormError(
                f"form {form.name}: residual asks for {listed(unknown)}, which is neither a field nor "
                f"anything else it can have: expected names among {listed(sorted(names))}"
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
            space = ufl.FunctionSpace(self.domain, dolfinx.lagrange(1, components))
            stranger = ufl.Coefficient(space, count=PLACEHOLDERS - 1)
            named = test in inspect.signature(self.form.residual).parameters
            if not named or residual.equals(self.call(**{test: stranger})):
                raise FormError(
                    f"form {self.form.name}: the test function '{test}' of field '{unknown}' does not "
                    "appear in its residual: every field needs its equation"
                )
        return residual

    def _strain_change(self, quantity: LawQuantity, du: Any) -> list[Any]:
        """Change of a law quantity with the strain (or grad u) at the particle."""
        direction = self.form.strain.direction(du)
        part = self.form.strain.gradient_part
        c, m = self.density(Density("particle", quantity, part)), len(direction)
        n = COMPONENTS[quantity.name]
        return [sum(c[m * i + j] * direction[j] for j in range(m)) for i in range(n)]

    def _volume_change(self, du: Any) -> Any:
        """Change of div u (ln det f) where it is taken from the displacement."""
        return self.form.strain.volume_change(next(iter(self.fields.values())), du)

    def _direction(self, density: Density) -> Any:
        """Change of a law quantity with the fields: C : strain(du) (or grad(du)) + c d_eps_v."""
        assert isinstance(density.quantity, LawQuantity)
        kinematics, n = self.form.kinematics, COMPONENTS[density.quantity.name]
        du, *volumetric = self.trials.values()
        change = [ufl.as_ufl(0.0)] * n
        if density.rule == "particle":
            change = self._strain_change(density.quantity, du)
        volume = None
        if kinematics.has_eps_v and density.quantity.name != "ln_J":
            volume = volumetric[0]
        elif kinematics.volume_at_centre and density.rule == "centre":
            volume = self._volume_change(du)
        if volume is not None:
            c = self.density(Density(density.rule, density.quantity, "volume"))
            change = [change[i] + c[i] * volume for i in range(n)]
        return ufl.as_vector(change)

    def couplings(self, residual: Any) -> list[tuple[Any, Any]]:
        """What the tangent of B-bar has besides: the deviator at the particles changes with the volume
        at the centre, and the mean stress there with the strain at the particles. The centre being
        one point of the cell, each is a product of two linear forms of the cell, (left, right).
        """
        if not self.form.kinematics.volume_at_centre:
            return []
        du = next(iter(self.tests.values()))
        at_centre, at_particles = self.measures["centre"], self.measures["particle"]
        area = self.constants["h"] ** 2
        products = []
        for density, symbol in list(self.placeholders.items()):
            if not isinstance(density.quantity, LawQuantity) or density.part != "value":
                continue
            if density.rule == "particle":
                change = self.density(Density("particle", density.quantity, "volume"))
                of_volume = self._volume_change(du) / area * at_centre
                products.append((_with(residual, symbol, change), of_volume))
            else:
                (of_strain,) = self._strain_change(density.quantity, du)
                one = ufl.as_vector([1 / area])
                products.append((_with(residual, symbol, one), of_strain * at_particles))
        return products

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


def _with(form: Any, symbol: Any, value: Any) -> Any:
    """The terms of a form with a symbol that they are linear in, another value in its place."""
    slope = ufl.derivative(form, symbol, ufl.Argument(symbol.ufl_function_space(), 2))
    slope = ufl.algorithms.expand_derivatives(slope)
    (argument,) = (a for a in slope.arguments() if a.number() == 2)
    return ufl.replace(slope, {argument: value})
