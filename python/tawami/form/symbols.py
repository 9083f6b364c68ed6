"""The names that a residual may use, as UFL symbols on a mesh without cells."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Mapping
from typing import Any, Literal

import ufl

from tawami.base.errors import FormError, InexactSumWarning
from tawami.base.space import PLANE
from tawami.base.text import quoted
from tawami.fem import dolfinx
from tawami.fem.rules import DEGREE, FAMILY, Rule
from tawami.form.fields import element_of
from tawami.form.form import Form
from tawami.form.quantities import (
    MU,
    ONE,
    Density,
    K,
    LawQuantity,
    ParticleScalar,
    Quantity,
)

#: First number of placeholders. FFCx 0.5 writes C code that does not compile if the number of a
#: coefficient has two digits, so the coefficients that reach FFCx are numbered from 0.
PLACEHOLDERS = 1000
#: Degree along x and along y up to which the densities of `sum_p` integrate exactly.
EXACT_DEGREE = 4
#: Evaluation of a form: by kernels at the particles, or by integrals over cells in plain dolfinx.
Assembly = Literal["points", "dolfinx"]


class Symbols:
    """The names that a residual may use.

    Args:
        form: The form.
        options: The value of each of its options.
        plastic_volume: Whether plastic flow may change the volume; otherwise sums of eps_p are empty.
        assembly: 'dolfinx' for sums over particles as integrals over cells.

    Attributes:
        names: Symbols by name.
        placeholders: Coefficient for each density that the residual, or its tangent, uses.
        increments, trial: Increments of all fields, and their trial function.
        fields, tests, trials: The parts of these for each field; test functions by their own name.
    """

    def __init__(
        self,
        form: Form,
        options: Mapping[str, str],
        *,
        plastic_volume: bool = True,
        assembly: Assembly = "points",
    ) -> None:
        self.form, self.assembly = form, assembly
        self._plastic_volume = plastic_volume
        domain = dolfinx.domain()
        self.element = element_of(form.fields)
        space = ufl.FunctionSpace(domain, self.element)
        self.domain = domain
        self.increments = ufl.Coefficient(space, count=0)
        self.trial = ufl.TrialFunction(space)
        test = ufl.TestFunction(space)
        self.fields = self._split(self.increments)
        self.trials = self._split(self.trial)
        tests = self._split(test)
        self.tests = {field.test: tests[name] for name, field in form.fields.items()}
        self.traction = ufl.Coefficient(
            ufl.FunctionSpace(domain, dolfinx.lagrange(2, PLANE.dim)), count=1
        )
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
        """Space of vectors with `size` components at the points of a rule."""
        if rule == "mean":
            element = dolfinx.per_cell(size)
        elif rule == "vertex":
            element = dolfinx.at_vertices(size)
        else:
            element = dolfinx.at_points(DEGREE[rule], size)
        return ufl.FunctionSpace(self.domain, element)

    def density(self, density: Density) -> Any:
        """The placeholder of a density."""
        if density not in self.placeholders:
            count = PLACEHOLDERS + len(self.placeholders)
            self.placeholders[density] = ufl.Coefficient(
                self.space(density.rule, density.size), count=count
            )
        return self.placeholders[density]

    def _quantity(self, quantity: Any, caller: str) -> Quantity:
        if isinstance(quantity, (int, float)):
            return ParticleScalar(repr(quantity), lambda v: quantity * ONE.evaluate(v))
        if isinstance(quantity, ufl.Constant):
            name = next((n for n, c in self.constants.items() if c == quantity), "c")
            raise FormError(
                f"form {self.form.name}: {caller}({name}, ...): {name} is a parameter, no quantity of "
                f"the particles: expected {name} * {caller}(f)"
            )
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
        if rule == "particle" and self.assembly == "dolfinx":
            self._check_degree(expression)
        if _is_plastic_volume(quantity) and not self._plastic_volume:
            return ufl.Form([])
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
        """Check that a law quantity is used at a place where its tangent is known.

        In B-bar this is the particle for the deviator, and the centre of the cell for the mean stress.
        """
        if rule == "vertex":
            raise FormError(
                f"form {self.form.name}: sum_v({quantity.name}, ...): expected constants of the "
                "particle (K, mu): the stress depends on the strain at the particle"
            )
        if _is_plastic_volume(quantity) and not self.form.kinematics.has_mean_stress:
            raise FormError(
                f"form {self.form.name}: {caller}(eps_p, ...) with kinematics "
                f"'{self.form.kinematics}', whose law receives the total strain: expected kinematics "
                "'mixed' or 'deviatoric'"
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
        # on squares, UFL's estimate is a multiple of the degree along one axis; u_x has degree 2
        unit = ufl.algorithms.estimate_total_polynomial_degree(self.traction[0]) / 2
        expanded = ufl.algorithms.apply_algebra_lowering.apply_algebra_lowering(expression)
        degree = ufl.algorithms.estimate_total_polynomial_degree(expanded) / unit
        if degree > EXACT_DEGREE:
            warnings.warn(
                f"form {self.form.name}: sum_p of an expression of degree {degree:g} (degrees of "
                "factors add up) differs from the sum over the particles: expected at most degree "
                f"{EXACT_DEGREE}; move terms that are nonlinear in the fields to the material law",
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
        """Jump of the normal derivative across a side."""
        n = ufl.FacetNormal(self.domain)
        slope = ufl.dot(ufl.grad(f), n)
        return slope("+") + slope("-")

    def _jump_nn(self, f: Any) -> Any:
        """Jump of the second normal derivative across a side."""
        n = ufl.FacetNormal(self.domain)
        bend = ufl.dot(ufl.dot(ufl.grad(ufl.grad(f)), n), n)
        return bend("+") - bend("-")

    def call(self, **other: Any) -> Any:
        """The residual of the form file, with other symbols for some names."""
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
                f"form {form.name}: residual asks for {quoted(unknown)}, which is not defined: expected "
                f"names among {quoted(sorted(names))}"
            )
        try:
            return form.residual(**{name: names[name] for name in wanted})
        except (FormError, Warning):
            raise
        except Exception as error:
            advice = ""
            if "LawQuantity" in str(error) or "ParticleScalar" in str(error):
                advice = ". Sums take quantities of the particles, as sum_p(sigma, grad(w))"
            raise FormError(f"form {form.name}: its residual raised {error!r}{advice}") from error

    def residual(self) -> Any:
        """The residual, after a check that it is a UFL form with every test function."""
        residual = self.call()
        if not isinstance(residual, ufl.Form):
            raise FormError(
                f"form {self.form.name}: residual returned {type(residual).__name__}: expected a UFL "
                "form (sums of sum_p(...) and of expressions * dx or * ds)"
            )
        for unknown, field in self.form.fields.items():
            test, components = field.test, field.components
            space = ufl.FunctionSpace(self.domain, dolfinx.lagrange(1, components))
            stranger = ufl.Coefficient(space, count=PLACEHOLDERS - 1)
            named = test in inspect.signature(self.form.residual).parameters
            if not named or residual.equals(self.call(**{test: stranger})):
                raise FormError(
                    f"form {self.form.name}: the test function '{test}' of field '{unknown}' does not "
                    "appear in its residual: every field needs its equation"
                )
        return residual


def _is_plastic_volume(quantity: Quantity) -> bool:
    return isinstance(quantity, LawQuantity) and quantity.name == "eps_p"
