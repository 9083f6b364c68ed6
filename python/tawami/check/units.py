"""Units of the terms of a residual: each base unit is rescaled, and each term must change by a power of
it that is the same for all terms of an equation.
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import extract_constants, extract_type
from ufl.classes import FacetNormal, Terminal

from tawami.base.dimensions import Dimension, dimension, size, text_of
from tawami.form.form import Form
from tawami.form.lines import line_of
from tawami.form.quantities import LawQuantity, ParticleScalar
from tawami.form.symbols import Symbols

#: Units of names that every form has; those of other quantities of the law are numbers.
UNITS: Mapping[str, str] = {
    "h": "m", "time": "s", "dt": "s", "b": "m/s2", "K": "Pa", "mu": "Pa", "rho": "kg/m3",
    **dict.fromkeys(("sigma", "s", "sigma_m", "P", "P_s", "tau_m"), "Pa"),
}  # fmt: skip
#: Unit of the measure of an integral, per metre of depth.
MEASURES = {"border": "m", "cell": "m2", "interior_facet": "m"}
FACTOR, SAMPLES = 2.0, 3
#: Exponents that differ by less are the same.
SAME = 1e-6


def unit_of(form: Form, name: str) -> str:
    """Unit of a field, of data or of a parameter in text; '-' for a parameter that declares none."""
    if name in form.fields:
        return form.fields[name].unit
    if name in form.data:
        return form.data_unit(name)
    return str(form.parameters[name].get("unit", "-"))


def unreadable(form: Form) -> list[str]:
    """Units of a form that cannot be read, each with its name."""
    bad = []
    for name in (*form.fields, *form.data, *form.parameters):
        try:
            dimension(unit_of(form, name))
        except ValueError:
            bad.append(f"'{name}' [{unit_of(form, name)}]")
    return bad


def contradictions(
    form: Form, options: Mapping[str, str], histories: Collection[str] = ()
) -> Iterator[tuple[str, frozenset[str]]]:
    """A sentence for each line of a residual whose terms have other units than its equation, and the
    names of the constants in it.

    Args:
        form: The form; its units can be read.
        options: The value of each of its options.
        histories: History variables of the laws that its residual reads.
    """
    symbols = Symbols(form, options, histories=histories)
    parts = [
        (line_of(part), kind, expanded.integrand())
        for part in symbols.residual().integrals()
        for kind in [_kind(part)]
        for expanded in expand_derivatives(ufl.Form([part])).integrals()
    ]
    terms = _Terms(symbols)
    for name, field in form.fields.items():
        expected: tuple[Dimension, int | None] | None = None
        for line, kind, integrand in parts:
            found = terms.unit(integrand, name)
            if found is None:
                continue
            where = symbols.lines.text(line)
            constants = {*extract_constants(integrand)}
            read = frozenset(n for n, c in symbols.constants.items() if c in constants)
            if isinstance(found, str):
                yield f"{where}, equation of '{name}': {found}", read
                continue
            unit = _times(found, dimension(MEASURES[kind]))
            if expected is None:
                expected = unit, line
            elif any(abs(e) > SAME for e in _times(unit, expected[0], -1.0).values()):
                other = "in another term of this line" if line == expected[1] else (
                    f"in line {expected[1]}"
                )  # fmt: skip
                yield (
                    f"{where}, equation of '{name}': a term has the unit {text_of(unit)} (times that of "
                    f"{field.test}), but {text_of(expected[0])} {other}",
                    read,
                )


def _kind(part: Any) -> str:
    """Kind of an integral, as `MEASURES` has it."""
    border = part.metadata().get("place") == "border"
    return "border" if border else str(part.integral_type())


def _times(a: Dimension, b: Dimension, power: float = 1.0) -> dict[str, float]:
    return {n: a.get(n, 0.0) + power * b.get(n, 0.0) for n in {*a, *b}}


class _Terms:
    """Evaluates the terms of a residual with random values in chosen units."""

    def __init__(self, symbols: Symbols) -> None:
        self._symbols, self._form = symbols, symbols.form
        names = (*self._form.fields, *self._form.data, *self._form.parameters)
        self._units = {name: dimension(unit_of(self._form, name)) for name in names}
        self._units |= {name: dimension(unit) for name, unit in UNITS.items()}
        self._bases = sorted({base for unit in self._units.values() for base in unit})

    def unit(self, integrand: Any, tested: str) -> Dimension | str | None:
        """Unit of an integrand for the test function of a field; None where that does not appear."""
        exponents = dict[str, float]()
        for base in self._bases:
            found = set[float]()
            for sample in range(SAMPLES):
                values = [self._value(integrand, tested, sample, {base: f}) for f in (1.0, FACTOR)]
                if values[0] and values[1] and np.isfinite(values).all():
                    ratio = values[1] / values[0]
                    found.add(np.log2(ratio) if ratio > 0 else np.nan)
            if not found:
                return None
            powers = np.array(list(found))
            if not np.ptp(powers) < SAME:  # NaN is none
                return (
                    f"terms of different units are added, or the argument of a function has one ({base}"
                    " does not cancel)"
                )
            exponents[base] = float(powers[0])
        return exponents

    def _value(
        self, integrand: Any, tested: str, sample: int, scales: Mapping[str, float]
    ) -> float:
        mapping = {
            symbol: self._evaluated(symbol, tested, sample, scales)
            for symbol in extract_type(integrand, Terminal)
            if isinstance(symbol, ufl.Coefficient | ufl.Argument | ufl.Constant | FacetNormal)
        }
        x = tuple(0.7 * size({"m": 1}, scales) for _ in range(self._symbols.space.dim))
        with np.errstate(all="ignore"):
            return float(integrand(x, mapping))

    def _evaluated(self, symbol: Any, tested: str, sample: int, scales: Mapping[str, float]) -> Any:
        """The values of a symbol, or of its derivatives, as UFL asks for them."""
        units = self._components(symbol, tested)

        def value(_: Any, derivatives: tuple[int, ...] = ()) -> Any:
            values = []
            for component, unit in enumerate(units):
                key = f"{sample} {symbol!s} {component} {sorted(derivatives)}"
                random = 0.5 + zlib.crc32(key.encode()) / 2**32
                scale = 0.0 if unit is None else size(unit, scales)
                values.append(random * scale / size({"m": 1}, scales) ** len(derivatives))
            return values if symbol.ufl_shape else values[0]

        return value

    def _components(self, symbol: Any, tested: str) -> list[Dimension | None]:
        """Unit of each component of a symbol; None for the test functions of other fields."""
        symbols, form = self._symbols, self._form
        length = int(np.prod(symbol.ufl_shape, dtype=int))
        if isinstance(symbol, FacetNormal):
            return [{}] * length
        if isinstance(symbol, ufl.Constant):
            name = next(n for n, constant in symbols.constants.items() if constant == symbol)
            return [self._units[name]] * length
        data = symbols.data.of(symbol)
        if data is not None:
            return [self._of_quantity(data.quantity)] * length
        units = list[Dimension | None]()
        for name, field in form.fields.items():
            test: Dimension | None = {} if name == tested else None
            own = test if isinstance(symbol, ufl.Argument) else self._units[name]
            units += [own] * field.components
        return units

    def _of_quantity(self, quantity: Any) -> Dimension:
        """Unit of a quantity of the particles."""
        if isinstance(quantity, LawQuantity):
            unit = dimension(UNITS.get(quantity.name, "-"))
            return (
                unit if quantity.factor is None else _times(unit, self._of_scalar(quantity.factor))
            )
        return self._of_scalar(quantity)

    def _of_scalar(self, scalar: ParticleScalar) -> Dimension:
        """Unit of an expression of numbers of the particles."""
        if scalar.text in self._units:
            return self._units[scalar.text]
        if scalar.text.startswith("x["):
            return {"m": 1.0}
        exponents = {}
        for base in self._bases:
            values = []
            for scale in (1.0, FACTOR):
                known = {
                    n: np.array([1.5 * size(u, {base: scale})]) for n, u in self._units.items()
                }
                try:
                    values.append(float(np.asarray(scalar.evaluate(known))[0]))
                except (
                    KeyError
                ):  # another quantity of the step, as the old ratio of volumes: a number
                    return {}
            exponents[base] = float(np.log2(values[1] / values[0]))
        return exponents
