"""Particle data that a form may name, and the densities through which they enter the field problem.

At the points q of a fixed rule, particle data D become volume-weighted densities (docs: theory):
D_q = (sum_p V_p D_p l_q(x_p)) / (w_q |J|).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from tawami.base.errors import FormError
from tawami.base.space import PLANE
from tawami.fem.rules import Rule

Part = Literal["value", "strain", "gradient", "volume"]

#: Components of a strain or a stress, (xx, yy, xy), and of a gradient, (xx, xy, yx, yy).
STRAIN, GRADIENT = PLANE.num_strains, len(PLANE.gradient)
#: Components of the quantities that the material law gives.
COMPONENTS: Mapping[str, int] = {
    "sigma": STRAIN, "s": STRAIN, "sigma_m": 1, "P": GRADIENT, "P_s": GRADIENT, "tau_m": 1, "ln_J": 1,
    "eps_p": 1,
}  # fmt: skip
#: Numbers per component of the parts of a law quantity: its value, and its derivatives with respect to
#: the strain (xx, yy, gamma_xy), grad u (xx, xy, yx, yy) and the volumetric field, eps_v or p.
WIDTH: Mapping[Part, int] = {"value": 1, "strain": STRAIN, "gradient": GRADIENT, "volume": 1}

OPERATIONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power
}  # fmt: skip


@dataclass(frozen=True)
class ParticleScalar:
    """An expression of constants of the particle, as K or K**2/mu.

    Attributes:
        text: The expression; two with the same text are the same density.
        evaluate: Gives its values from arrays by name, with one entry per particle.
    """

    text: str
    evaluate: Callable[[Mapping[str, Any]], Any] = field(compare=False)

    def _binary(self, other: Any, symbol: str, *, swap: bool = False) -> Any:
        if isinstance(other, LawQuantity) and symbol == "*":
            return other * self
        if not isinstance(other, ParticleScalar):
            if not isinstance(other, (int, float)):
                raise FormError(
                    f"'{self.text} {symbol} ...': a particle constant combines with numbers and other "
                    f"particle constants only, not with {type(other).__name__}: expected "
                    "sum_p(constant, expression)"
                )
            number = float(other)
            other = ParticleScalar(repr(other), lambda _: number)
        a, b = (other, self) if swap else (self, other)
        operation = OPERATIONS[symbol]
        return ParticleScalar(
            f"({a.text} {symbol} {b.text})", lambda v: operation(a.evaluate(v), b.evaluate(v))
        )

    def __add__(self, other: Any) -> Any:
        return self._binary(other, "+")

    def __radd__(self, other: Any) -> Any:
        return self._binary(other, "+", swap=True)

    def __sub__(self, other: Any) -> Any:
        return self._binary(other, "-")

    def __rsub__(self, other: Any) -> Any:
        return self._binary(other, "-", swap=True)

    def __mul__(self, other: Any) -> Any:
        return self._binary(other, "*")

    def __rmul__(self, other: Any) -> Any:
        return self._binary(other, "*", swap=True)

    def __truediv__(self, other: Any) -> Any:
        return self._binary(other, "/")

    def __rtruediv__(self, other: Any) -> Any:
        return self._binary(other, "/", swap=True)

    def __pow__(self, other: Any) -> Any:
        return self._binary(other, "**")


@dataclass(frozen=True)
class LawQuantity:
    """A quantity of the material law, with its consistent tangent.

    Attributes:
        name: Name of the quantity.
        factor: Constant of the particle that multiplies it.
    """

    name: str
    factor: ParticleScalar | None = None

    def __mul__(self, other: Any) -> LawQuantity:
        if not isinstance(other, (int, float, ParticleScalar)):
            raise FormError(
                f"'{self.name} * ...': a quantity of the law combines with particle constants only, not "
                f"with {type(other).__name__}: expected sum_p({self.name}, expression)"
            )
        return LawQuantity(self.name, (self.factor or ONE) * other)

    __rmul__ = __mul__


Quantity = ParticleScalar | LawQuantity
K = ParticleScalar("K", lambda values: values["K"])
MU = ParticleScalar("mu", lambda values: values["mu"])
ONE = ParticleScalar("1", lambda values: np.ones_like(values["mu"]))


@dataclass(frozen=True)
class Density:
    """Particle data at the points of a rule: `part` of `quantity`, with `size` components."""

    rule: Rule
    quantity: Quantity
    part: Part = "value"

    @property
    def size(self) -> int:
        """Number of components."""
        if isinstance(self.quantity, ParticleScalar):
            return 1
        return COMPONENTS[self.quantity.name] * WIDTH[self.part]
