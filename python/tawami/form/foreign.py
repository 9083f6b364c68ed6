"""Symbols in a residual that are not among its arguments: measures, constants and functions of UFL."""

from __future__ import annotations

import math
from typing import Any

import ufl
from ufl.algorithms.analysis import (
    extract_arguments,
    extract_coefficients,
    extract_constants,
    extract_type,
)
from ufl.classes import ComplexValue, FloatValue, Imag

from tawami.base.errors import FormError
from tawami.form.lines import line_of
from tawami.form.named import first_lines

#: Measures of UFL by name.
MEASURES = {name: getattr(ufl, name) for name in ("dx", "ds", "dS")}


class Known(ufl.Constant):  # type: ignore[misc]
    """A constant of a residual: equal to itself alone, whatever number another one has."""

    def __eq__(self, other: object) -> bool:
        """Compare by identity."""
        return self is other

    __hash__ = ufl.Constant.__hash__


def check_symbols(symbols: Any, residual: Any) -> None:
    """Check that a residual contains no measure, constant, function or complex number of its own.

    Args:
        symbols: Symbols of the form.
        residual: Its residual, a UFL form.

    Raises:
        FormError: It does.
    """
    for part in residual.integrals():
        where = symbols.lines.text(line_of(part))
        if part.ufl_domain() != symbols.domain or "quadrature_degree" not in part.metadata():
            named = first_lines(symbols.form.residual, MEASURES)
            if line_of(part) is None and named:
                where = symbols.lines.text(min(named.values()))
            raise FormError(
                f"{where}: a measure of UFL: expected dx or dx_c as arguments, residual(..., dx), or "
                "sum_p(...) without a measure"
            )
        _check_integrand(symbols, part.integrand(), where)


def _check_integrand(symbols: Any, integrand: Any, where: str) -> None:
    """Check the symbols and numbers of one integrand."""
    if not {*extract_constants(integrand)} <= {*symbols.constants.values()}:
        raise FormError(
            f"{where}: a Constant of UFL: expected a number, or one of 'parameters', as parameters = "
            '{"k": {"default": 1.0}}'
        )
    own = {symbols.increments, symbols.old}
    for coefficient in extract_coefficients(integrand):
        if coefficient not in own and symbols.data.of(coefficient) is None:
            raise FormError(
                f"{where}: a Coefficient of UFL, or a Function of dolfinx: expected a field, or numbers "
                'of the particles, as data = {"kappa": "permeability [m2]"} with '
                'scene.data("kappa", ...)'
            )
    tests = symbols.test_function
    if any(argument != tests for argument in extract_arguments(integrand)):
        raise FormError(
            f"{where}: a test or trial function of UFL: expected those of 'fields', as "
            "residual(u, w, ...); the tangent is derived"
        )
    if extract_type(integrand, ComplexValue) or extract_type(integrand, Imag):
        raise FormError(f"{where}: a complex number: expected real ones")
    if any(not math.isfinite(float(value)) for value in extract_type(integrand, FloatValue)):
        raise FormError(f"{where}: NaN or infinity: expected finite numbers")
