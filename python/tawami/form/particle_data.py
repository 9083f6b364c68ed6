"""Placeholders of particle data: the coefficients of UFL that stand for them in a residual."""

from __future__ import annotations

from typing import Any

import ufl

from tawami.fem import dolfinx
from tawami.fem.rules import DEGREE, Rule
from tawami.form.operators import Operators
from tawami.form.quantities import (
    NOMINAL,
    STRESSES,
    Density,
    LawQuantity,
    Part,
    ParticleScalar,
    Quantity,
    density,
)

#: First number of placeholders. FFCx 0.5 writes C code that does not compile if the number of a
#: coefficient has two digits, so the coefficients that reach FFCx are numbered from 0.
PLACEHOLDERS = 1000


class ParticleData:
    """The particle data of a form.

    Args:
        operators: Geometry and mesh.
        plastic_volume: Whether plastic flow may change the volume; otherwise eps_p is zero.

    Attributes:
        space: Dimension and geometry.
        placeholders: The coefficient, a vector, of each of the data that were asked for.
    """

    def __init__(self, operators: Operators, *, plastic_volume: bool) -> None:
        self.operators, self.space = operators, operators.space
        self.placeholders: dict[Density, Any] = {}
        self._of: dict[Any, Density] = {}
        self._plastic_volume = plastic_volume

    def function_space(self, rule: Rule, size: int) -> Any:
        """Space of vectors with `size` components at the points of a rule."""
        if rule == "mean":
            element = dolfinx.per_cell(size)
        elif rule == "vertex":
            element = dolfinx.at_vertices(size)
        else:
            element = dolfinx.at_points(DEGREE[rule], size)
        return ufl.FunctionSpace(self.operators.domain, element)

    def vector(self, density: Density) -> Any:
        """The placeholder of data, with all their components."""
        if density not in self.placeholders:
            count = PLACEHOLDERS + len(self.placeholders)
            symbol = ufl.Coefficient(self.function_space(density.rule, density.size), count=count)
            self.placeholders[density], self._of[symbol] = symbol, density
        return self.placeholders[density]

    def part(self, rule: Rule, quantity: Quantity, part: Part) -> Any:
        """The placeholder of a quantity of the law or of its derivative."""
        return self.vector(density(rule, quantity, self.space, part))

    def of(self, symbol: Any) -> Density | None:
        """The data of a placeholder; None for any other symbol."""
        return self._of.get(symbol)

    def scalar(self, scalar: ParticleScalar) -> Any:
        """A number of each particle."""
        return self.vector(density("particle", scalar, self.space))[0]

    def law(self, name: str) -> Any:
        """A quantity of the law as a number or a tensor."""
        if name == "eps_p" and not self._plastic_volume:
            return ufl.as_ufl(0.0)
        return self.shaped("particle", LawQuantity(name))

    def shaped(self, rule: Rule, quantity: Quantity) -> Any:
        """The value of a quantity at the points of a rule: a number, or a tensor."""
        of = density(rule, quantity, self.space)
        c = self.vector(of)
        if isinstance(quantity, LawQuantity) and quantity.name in (*STRESSES, *NOMINAL):
            return self.operators.tensor([c[i] for i in range(of.size)])
        return c[0]
