"""The terms of a residual by where they are integrated, and what each kind may contain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import ufl
from ufl import SpatialCoordinate
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import (
    extract_arguments,
    extract_coefficients,
    has_type,
)
from ufl.classes import Zero

from tawami.base.errors import FormError
from tawami.fem.rules import Rule
from tawami.form.arity import check_arity, is_multilinear
from tawami.form.lines import line_of
from tawami.form.points import Integrand
from tawami.form.sums import check_of_particles
from tawami.form.symbols import Symbols


@dataclass(frozen=True)
class Terms:
    """Terms of a residual as UFL forms.

    Attributes:
        cells: Sums over particles and integrals over cells.
        border: Sums over the border by the names of its parts; None is all of it.
        ghost: Matrix of the integrals over sides of partially filled cells, which are linear.
    """

    cells: Any
    border: Mapping[tuple[str, ...] | None, Any]
    ghost: Any | None


def terms_of(symbols: Symbols, residual: Any) -> Terms:
    """The terms of a residual.

    Raises:
        FormError: A term is of a kind that is not supported; the message says what is expected.
    """
    name = symbols.form.name
    for part in residual.integrals():
        _check(symbols, part)
    inside, border = _without_border(residual)
    cells, sides = (_of_type(inside, kind) for kind in ("cell", "interior_facet"))
    if cells is None:
        raise FormError(
            f"form {name}: expected sums over particles or integrals over cells: it has none"
        )
    return Terms(cells, border, None if sides is None else _matrix(symbols, sides))


def _check(symbols: Symbols, part: Any) -> None:
    """Check one integral of a residual."""
    where = symbols.lines.text(line_of(part))
    if not extract_arguments(part) and not isinstance(part.integrand(), Zero):
        raise FormError(f"{where}: a term has no test function: expected one in each term")
    with symbols.lines.errors(ufl.Form([part])):
        if part.integral_type() != "interior_facet":  # jumps are of derivatives across a side
            symbols.operators.check(part.integrand())
        check_arity(ufl.Form([part]), where)
    if "place" in part.metadata():
        with symbols.lines.errors(ufl.Form([part])):
            expanded = expand_derivatives(ufl.Form([part]))
            if not expanded.empty():
                integrand = Integrand(expanded, symbols)
                for density in integrand.data if part.metadata()["place"] != "border" else ():
                    check_of_particles(density.quantity)
        return
    coefficients = extract_coefficients(part.integrand())
    if symbols.old in coefficients:
        raise FormError(
            f"{where}: an old field outside a sum over particles: expected old fields in sum_p(...) only"
        )
    read = [symbols.data.of(symbol) for symbol in coefficients]
    if symbols.assembly == "points" and any(data and data.rule != "mean" for data in read):
        raise FormError(
            f"{where}: particle data outside a sum over particles: expected sum_p(...), or cell_mean(K) "
            "and the like in terms with dx"
        )
    of_space = symbols.space.hoop  # the factor 2 pi r
    if has_type(part.integrand(), SpatialCoordinate) and not of_space:
        raise FormError(
            f"{where}: the position x outside a sum over particles: expected x in sum_p(...) only"
        )


def by_rule(form: Any) -> list[Any]:
    """One form for each quadrature rule.

    FFCx 0.5 puts several rules into one kernel, but evaluates a field under all of them at the point of
    the one-point rule. UFL 2022 takes integrals of one integrand under two rules for the same.
    """
    rules: dict[tuple[int, str], list[Any]] = {}
    for integral in form.integrals():
        metadata = integral.metadata()
        rule = (metadata["quadrature_degree"], metadata.get("quadrature_rule", "default"))
        rules.setdefault(rule, []).append(integral)
    return [ufl.Form(rules[rule]) for rule in sorted(rules, reverse=True)]


def at_points(form: Any) -> tuple[list[tuple[Rule, Any]], Any]:
    """Sums over particles of a form by place, with expanded derivatives, and integrals over cells."""
    sums: dict[Rule, list[Any]] = {}
    rest = []
    for integral in form.integrals():
        expanded = expand_derivatives(ufl.Form([integral]))
        if expanded.empty():
            continue
        place = integral.metadata().get("place")
        if place is None:
            rest.append(integral)
        else:
            sums.setdefault(place, []).extend(expanded.integrals())
    return [(rule, ufl.Form(parts)) for rule, parts in sums.items()], ufl.Form(rest)


def _without_border(form: Any) -> tuple[Any, dict[tuple[str, ...] | None, Any]]:
    """A form without its sums over the border, and these by the names of their parts."""
    rest, border = [], dict[tuple[str, ...] | None, list[Any]]()
    for part in form.integrals():
        if part.metadata().get("place") == "border":
            border.setdefault(part.metadata()["on"], []).append(part)
        else:
            rest.append(part)
    return ufl.Form(rest), {on: ufl.Form(parts) for on, parts in border.items()}


def _of_type(form: Any, kind: str) -> Any | None:
    integrals = form.integrals_by_type(kind)
    return ufl.Form(integrals) if integrals else None


def _matrix(symbols: Symbols, sides: Any) -> Any:
    """The matrix of the terms on sides of cells."""
    used = set(sides.coefficients())
    others = {data for symbol in used if (data := symbols.data.of(symbol)) is not None}
    matrix = ufl.replace(sides, {symbols.increments: symbols.trial})
    linear = len(matrix.arguments()) == 2 and is_multilinear(matrix)
    if not linear or any(density.rule != "mean" for density in others):
        raise FormError(
            f"form {symbols.form.name}: expected terms with dG that are linear in the fields and "
            "contain nothing else but h, parameters and facet_mean(...), as "
            "facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG"
        )
    return matrix
