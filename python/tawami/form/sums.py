"""Sums over particles and means over cells, as a residual writes them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import (
    extract_arguments,
    extract_coefficients,
    extract_constants,
    has_type,
)
from ufl.classes import SpatialCoordinate, Zero
from ufl.utils.stacks import StackDict

from tawami.base.checks import shown
from tawami.base.errors import FormError, InexactSumWarning
from tawami.fem import dolfinx
from tawami.fem.rules import Rule
from tawami.form.form import Form
from tawami.form.lines import Lines
from tawami.form.operators import ADVICE
from tawami.form.particle_data import PLACEHOLDERS, ParticleData
from tawami.form.quantities import HISTORY, ONE, LawQuantity, ParticleScalar, Quantity

#: Degree along x and along y up to which the densities of `sum_p` integrate exactly.
EXACT_DEGREE = 4
#: Points of each kind of sum.
RULES: Mapping[str, Rule] = {"sum_p": "particle", "sum_c": "centre", "sum_v": "vertex"}


class Sums:
    """Sums over particles and means over cells.

    Args:
        form: The form.
        data: Its particle data.
        lines: The source of its residual.
        measure: Gives the measure of a rule.
        border: Gives the measure of the border, or of its parts with some names.
        old: The fields at the start of the step.
        reference: Whether sums over particles are integrals of densities over cells.
    """

    def __init__(
        self,
        form: Form,
        data: ParticleData,
        lines: Lines,
        measure: Callable[..., Any],
        border: Callable[[tuple[str, ...] | None], Any],
        old: Any,
        *,
        reference: bool,
    ) -> None:
        self._form, self._data, self._lines = form, data, lines
        self._measure, self._border = measure, border
        self._old, self._reference = old, reference

    @property
    def names(self) -> dict[str, Callable[..., Any]]:
        """The functions by the names under which a residual asks for them."""
        return {
            "sum_p": self.sum_p,
            "sum_b": self.sum_b,
            "sum_c": lambda *given: self._of_density("sum_c", given),
            "sum_v": lambda *given: self._of_density("sum_v", given),
            "cell_mean": self.cell_mean,
            "facet_mean": lambda quantity: ufl.avg(self.cell_mean(quantity, "facet_mean")),
        }

    def sum_p(self, *given: Any) -> Any:
        """sum_p V_p D_p : f(x_p), or sum_p V_p f(x_p)."""
        if self._reference:
            return self._of_density("sum_p", given)
        *weight, f = self._arguments("sum_p", given)
        for D in weight:
            f = _product("sum_p", D, f)
        for symbol in extract_coefficients(f):
            data = self._data.of(symbol)
            if data is not None and isinstance(data.quantity, LawQuantity):
                self._check_place("particle", data.quantity, "sum_p")
        return self._integral("sum_p", f, self._measure("particle", place=True))

    def sum_b(self, f: Any, on: str | Sequence[str] | None = None) -> Any:
        """sum_b dA_b f(x_b) over the points of the border, dA_b = 2 pi r dl_b in axisymmetry.

        Args:
            f: A number: an expression of fields at the point, data and the normal.
            on: Name or names of parts of the border; by default all of it.
        """
        if self._reference:
            raise FormError(
                "sum_b with assembly='dolfinx', which has no border: expected assembly='points'"
            )
        names = (on,) if isinstance(on, str) else on
        listed = isinstance(names, tuple | list) and all(isinstance(n, str) for n in names)
        if names is not None and not (listed and names):
            raise FormError(
                f"sum_b(..., on={shown(on)}): expected the name of a part of the border or a list of "
                'names, as on="top"'
            )
        f = ufl.as_ufl(f)
        for symbol in extract_coefficients(f):
            data = self._data.of(symbol)
            if data is not None and isinstance(data.quantity, LawQuantity):
                name = data.quantity.name.removeprefix(HISTORY)
                raise FormError(
                    f"sum_b of '{name}': laws are evaluated at particles, and the border has no stress "
                    "and no history: expected an elastic stress of the fields, as "
                    "2 * mu * dev(eps(u)) + K * eps_v * I"
                )
            if data is not None and data.rule != "particle":
                raise FormError("sum_b of cell_mean(...): expected K, mu or data alone")
        chosen = None if names is None else tuple(sorted({*names}))
        return self._integral("sum_b", f, self._border(chosen))

    def cell_mean(self, quantity: Any, caller: str = "cell_mean") -> Any:
        """Volume-weighted mean of a quantity over the particles of each cell."""
        found = self._quantity(ufl.as_ufl(quantity), caller)
        if isinstance(found, LawQuantity):
            raise FormError(
                f"{caller} takes data of the particles (K, mu), not the quantity '{found.name}' of the "
                "law"
            )
        return self._data.shaped("mean", found)

    def _arguments(self, caller: str, given: tuple[Any, ...]) -> list[Any]:
        if len(given) not in (1, 2):
            raise FormError(
                f"{caller} takes (quantity, expression) or (expression), not {len(given)} arguments"
            )
        return [ufl.as_ufl(argument) for argument in given]

    def _of_density(self, caller: str, given: tuple[Any, ...]) -> Any:
        """The sum with particle data as a density at the points of a rule."""
        rule = RULES[caller]
        *weight, f = self._arguments(caller, given)
        quantity = self._quantity(weight[0], caller) if weight else ONE
        read = [self._data.of(symbol) for symbol in extract_coefficients(f)]
        position = self._reference and has_type(f, SpatialCoordinate)
        old = self._old in extract_coefficients(f)
        if position or old or any(data is not None for data in read):
            way = " with assembly='dolfinx'" if caller == "sum_p" else ""
            raise FormError(
                f"{caller}{way}: particle data, old fields or the position in the expression: expected "
                f"{caller}(D, f), where D is one quantity of the law or an expression of K, mu, ... and "
                "f is one of the fields"
            )
        if isinstance(quantity, LawQuantity):
            self._check_place(rule, quantity, caller)
        if rule == "particle":
            self._check_degree(f)
        if weight and isinstance(weight[0], Zero):
            return ufl.Form([])
        D = self._data.shaped(rule, quantity)
        measure = self._measure(rule, place=not self._reference)
        return self._integral(caller, _product(caller, D, f), measure)

    def _integral(self, caller: str, f: Any, measure: Any) -> Any:
        if isinstance(f, Zero):
            return ufl.Form([])
        if f.ufl_shape != ():
            raise FormError(
                f"{caller} of an expression of shape {f.ufl_shape}: expected a number, as of "
                "inner(sigma, grad(w))"
            )
        return f * measure

    # -- quantities ----------------------------------------------------------

    def _quantity(self, D: Any, caller: str) -> Quantity:
        """The quantity of the particles that an expression is."""
        for symbol in extract_coefficients(D):
            data = self._data.of(symbol)
            if data is None or data.rule != "particle":
                raise self._not_a_quantity(D, caller)
            if isinstance(data.quantity, LawQuantity):
                return self._law_quantity(D, symbol, data.quantity, caller)
            check_of_particles(data.quantity)
        if extract_arguments(D) or has_type(D, SpatialCoordinate):
            raise self._not_a_quantity(D, caller)
        if extract_constants(D):
            raise FormError(
                f"{caller}(D, f): D contains a parameter, time or dt, which are no quantities of the "
                f"particles: expected parameter * {caller}(D, f)"
            )
        return self._scalar(D)

    def _law_quantity(self, D: Any, symbol: Any, quantity: LawQuantity, caller: str) -> Quantity:
        """A quantity of the law, or a number of the particle times it."""
        if self._data.shaped("particle", quantity) == D:
            return quantity
        direction = ufl.Argument(symbol.ufl_function_space(), 2)
        if D.ufl_shape == () and len(symbol) == 1:
            slope = expand_derivatives(ufl.derivative(D, symbol, direction))
            factor = ufl.replace(D, {symbol: ufl.as_vector([1.0])})
            at_zero = ufl.replace(D, {symbol: ufl.as_vector([0.0])})
            if symbol not in extract_coefficients(slope) and isinstance(at_zero, Zero):
                scalar = self._scalar(factor)
                if not scalar.varies:  # its columns are filled once
                    return LawQuantity(quantity.name, scalar)
        raise FormError(
            f"{caller}({quantity.name} ...): a quantity of the law combines with particle constants "
            f"only, as K * {quantity.name}: expected {caller}({quantity.name}, f)"
        )

    def _scalar(self, D: Any) -> ParticleScalar:
        """An expression of numbers of the particles as one such number."""
        parts = dict[Any, ParticleScalar]()
        for symbol in extract_coefficients(D):
            data = self._data.of(symbol)
            assert data is not None
            assert isinstance(data.quantity, ParticleScalar)
            parts[symbol] = data.quantity
        text = str(D)
        for symbol, part in parts.items():
            text = re.sub(rf"{re.escape(str(symbol))}\[0\]", part.text, text)
        if not parts:
            value = float(D.evaluate(None, {}, (), StackDict()))
            return ParticleScalar(text, lambda values: value * ONE.evaluate(values))

        def evaluate(values: Mapping[str, Any]) -> Any:
            columns = np.column_stack([part.evaluate(values) for part in parts.values()])
            rows, place = columns[:1], np.zeros(len(columns), dtype=np.int64)
            if (columns != rows).any():  # several materials
                rows, place = np.unique(columns, axis=0, return_inverse=True)
            with np.errstate(all="ignore"):
                found = [
                    D.evaluate(None, dict(zip(parts, row[:, None], strict=True)), (), StackDict())
                    for row in rows
                ]
            return np.array(found, dtype=float)[place.ravel()]

        return ParticleScalar(text, evaluate, any(part.varies for part in parts.values()))

    def _not_a_quantity(self, D: Any, caller: str) -> FormError:
        known = ", ".join(self._form.strain.quantities)
        return FormError(
            f"{caller} takes a particle quantity ({known}, K, mu, or arithmetic of K and mu) first, not "
            f"{D}"
        )

    # -- checks --------------------------------------------------------------

    def _check_place(self, rule: Rule, quantity: LawQuantity, caller: str) -> None:
        """Check that a law quantity is used at a place where its tangent is known.

        In B-bar this is the particle for the deviator, and the centre of the cell for the mean stress.
        """
        kinematics, strain = self._form.kinematics, self._form.strain
        if rule == "vertex":
            raise FormError(
                f"sum_v({quantity.name}, ...): expected constants of the particle (K, mu): the stress "
                "depends on the strain at the particle"
            )
        if quantity.name == "eps_p" and not kinematics.has_mean_stress:
            raise FormError(
                f"{caller}(eps_p, ...) with kinematics '{kinematics}', whose law receives the total "
                "strain: expected a field with the role 'volumetric_strain' or 'pressure'"
            )
        cell, centre = kinematics.volume_at_centre, rule == "centre"
        if not cell and centre:
            raise FormError(
                f"sum_c({quantity.name}, ...) needs kinematics 'cell': elsewhere the stress depends on "
                "the strain at the particle"
            )
        s, mean = strain.deviator, strain.mean
        if cell and quantity.name != (mean if centre else s):
            raise FormError(
                f"{caller}({quantity.name}, ...) with kinematics 'cell': expected sum_p({s}, ...) and "
                f"sum_c({mean}, ...) only"
            )

    def _check_degree(self, expression: Any) -> None:
        # on squares, UFL's estimate is a multiple of the degree along one axis; a quadratic has degree 2
        space = ufl.FunctionSpace(self._data.operators.domain, dolfinx.lagrange(2))
        quadratic = ufl.Coefficient(space, count=PLACEHOLDERS - 3)
        unit = ufl.algorithms.estimate_total_polynomial_degree(quadratic) / 2
        expanded = ufl.algorithms.apply_algebra_lowering.apply_algebra_lowering(expression)
        degree = ufl.algorithms.estimate_total_polynomial_degree(expanded) / unit
        if degree > EXACT_DEGREE:
            where = self._lines.text(self._lines.here())
            warnings.warn(
                f"{where}: sum_p of an expression of degree {degree:g} (degrees of factors add up) "
                "differs from the sum over the particles: expected at most degree "
                f"{EXACT_DEGREE}; use assembly='points'",
                InexactSumWarning,
                stacklevel=2,
            )


def check_of_particles(scalar: Quantity) -> None:
    """Check that particles have a quantity.

    Raises:
        FormError: Only points of the border have it.
    """
    if isinstance(scalar, LawQuantity) or not scalar.border:
        return
    if scalar.text.startswith("old "):
        name = scalar.text.removeprefix("old ").split("[")[0]
        raise FormError(
            f"old.{name}: only fields without a role have an old value at the particles; the old state "
            f"of the displacement is in the stress: expected old.{name} in sum_b(...) only"
        )
    raise FormError("the normal n at particles: expected n and dot_n(...) in sum_b(...) only")


def _product(caller: str, D: Any, f: Any) -> Any:
    """D : f, for a number, a vector or a tensor."""
    if isinstance(D, Zero):
        return ufl.as_ufl(0.0)
    if D.ufl_shape != f.ufl_shape:
        raise FormError(
            f"{caller} got a quantity of shape {D.ufl_shape} and an expression of shape {f.ufl_shape}: "
            f"expected the same shape{'; ' + ADVICE if 3 in D.ufl_shape else ''}"
        )
    return ufl.inner(D, f)
