"""The derived tangent of a residual.

The tangent is `derivative(R, fields)` plus, for each quantity of the material law, the residual with
that quantity replaced by its own consistent tangent.
"""

from __future__ import annotations

from typing import Any

import ufl

from tawami.form.quantities import Density, LawQuantity
from tawami.form.symbols import Symbols


class Linearisation:
    """Derivatives of the terms of a residual over cells.

    Args:
        symbols: Symbols that the residual uses; the derivatives add densities to them.
        residual: The terms, a UFL form.
    """

    def __init__(self, symbols: Symbols, residual: Any) -> None:
        self._symbols, self._form, self._residual = symbols, symbols.form, residual

    def tangent(self) -> Any:
        """The derivative with respect to the fields, without :meth:`couplings`."""
        tangent = change_with_fields(self._symbols, self._residual)
        for density, symbol in self._law_densities():
            tangent += _with(self._residual, symbol, self._direction(density))
        return tangent

    def couplings(self) -> list[tuple[Any, Any]]:
        """The other part of the tangent of B-bar, as pairs of linear forms (left, right) of a cell.

        The deviator at the particles changes with the volume at the centre, and the mean stress there
        with the strain at the particles. Because the centre is one point of the cell, each contribution
        is the product of the two vectors of a pair.
        """
        if not self._form.kinematics.volume_at_centre:
            return []
        symbols = self._symbols
        du = next(iter(symbols.tests.values()))
        place = symbols.assembly == "points"
        at_centre, at_particles = (
            symbols.measure(rule, place=place) for rule in ("centre", "particle")
        )
        # a cell has one centre: points have weight 1 there, integrals over the cell its area
        area = 1.0 if place else symbols.constants["h"] ** 2
        products = []
        for density, symbol in self._law_densities():
            if density.rule == "particle":
                change = symbols.data.part("particle", density.quantity, "volume")
                of_volume = self._volume_change(du) / area * at_centre
                products.append((_with(self._residual, symbol, change), of_volume))
            else:
                (of_strain,) = self._strain_change(density.quantity, du)
                one = ufl.as_vector([1 / area])
                products.append((_with(self._residual, symbol, one), of_strain * at_particles))
        return products

    def _law_densities(self) -> list[tuple[Density, Any]]:
        """The law quantities of the residual with their placeholders."""
        used = {s: self._symbols.data.of(s) for s in self._residual.coefficients()}
        return [
            (data, symbol)
            for symbol, data in used.items()
            if data is not None and isinstance(data.quantity, LawQuantity)
        ]

    def _direction(self, density: Density) -> Any:
        """Change of a law quantity with the fields: C : strain(du) (or grad(du)) + c d_eps_v (d_p)."""
        kinematics, quantity = self._form.kinematics, density.quantity
        assert isinstance(quantity, LawQuantity)
        du = next(iter(self._symbols.trials.values()))
        change = [ufl.as_ufl(0.0)] * density.size
        if density.rule == "particle":
            change = self._strain_change(quantity, du)
        volume = None
        if kinematics.has_mean_stress and quantity.name != "ln_J":
            volume = self._symbols.trials[str(self._form.volume_field)]
        elif kinematics.volume_at_centre and density.rule == "centre":
            volume = self._volume_change(du)
        if volume is not None:
            c = self._symbols.data.part(density.rule, quantity, "volume")
            change = [change[i] + c[i] * volume for i in range(density.size)]
        return ufl.as_vector(change)

    def _strain_change(self, quantity: Any, du: Any) -> list[Any]:
        """Change of a law quantity with the strain (or grad u) at the particle."""
        operators, part = self._symbols.operators, self._form.strain.gradient_part
        direction = operators.strain(du) if part == "strain" else operators.gradient(du)
        c = self._symbols.data.part("particle", quantity, part)
        m = len(direction)
        return [sum(c[m * i + j] * direction[j] for j in range(m)) for i in range(len(c) // m)]

    def _volume_change(self, du: Any) -> Any:
        """Change of div u (ln det f) with du."""
        u = next(iter(self._symbols.fields.values()))
        return self._symbols.operators.volume_change(u, du, finite=self._form.strain.finite)


def change_with_fields(symbols: Symbols, form: Any) -> Any:
    """The derivative of a form with respect to the fields, particle data unchanged."""
    derivative = ufl.derivative(form, symbols.increments, symbols.trial)
    return ufl.algorithms.expand_derivatives(derivative)


def _with(form: Any, symbol: Any, value: Any) -> Any:
    """Derivative of a form with respect to a placeholder, times a value."""
    argument = ufl.Argument(symbol.ufl_function_space(), 2)
    slope = ufl.algorithms.expand_derivatives(ufl.derivative(form, symbol, argument))
    return ufl.replace(slope, {argument: value})
