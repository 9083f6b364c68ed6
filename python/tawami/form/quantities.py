"""Particle data that a form reads, and the columns through which they enter the field problem.

At the particles they are columns of the kernels. With assembly='dolfinx', and at the centre and the
vertices of a cell, particle data D become volume-weighted densities at the points q of a fixed rule
(docs: theory): D_q = (sum_p V_p D_p l_q(x_p)) / (w_q |J|).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from tawami.base.space import Space
from tawami.fem.rules import Rule

Part = Literal["value", "strain", "gradient", "volume"]

#: Quantities of the law that are stresses, and those that are stresses times a gradient.
STRESSES, NOMINAL = ("sigma", "s"), ("P", "P_s")
#: Name of a history variable of the law, as the particle stage knows it.
HISTORY = "history:"


@dataclass(frozen=True)
class ParticleScalar:
    """A number of each particle: K, rho, or an expression of such numbers.

    Attributes:
        text: Its name or the expression; two with the same text are the same.
        evaluate: Gives its values from arrays by name, with one entry per particle.
        varies: Whether it may change between the steps of particles that do not move.
        border: Whether points of the border have it, and particles do not: the normal.
    """

    text: str
    evaluate: Callable[[Mapping[str, Any]], Any] = field(compare=False)
    varies: bool = field(default=False, compare=False)
    border: bool = field(default=False, compare=False)


def named(name: str, *, varies: bool = False, border: bool = False) -> ParticleScalar:
    """The number of each particle, or of each point of the border, with this name."""
    return ParticleScalar(name, lambda values: values[name], varies, border)


@dataclass(frozen=True)
class LawQuantity:
    """A quantity of the material law, with its consistent tangent.

    Attributes:
        name: Name of the quantity.
        factor: Number of the particle that multiplies it.
    """

    name: str
    factor: ParticleScalar | None = None


Quantity = ParticleScalar | LawQuantity
ONE = ParticleScalar("1", lambda values: np.ones_like(values["mu"]))


@dataclass(frozen=True)
class Density:
    """Particle data at the points of a rule: `part` of `quantity`.

    Attributes:
        rule: The points; for 'particle' the particles themselves, where kernels are evaluated there.
        quantity: The quantity.
        part: Its value, or its derivative with respect to the strain (xx, yy, gamma_xy), grad u (xx, xy,
            yx, yy) or the volumetric field, eps_v or p.
        size: Number of components.
    """

    rule: Rule
    quantity: Quantity
    part: Part = "value"
    size: int = 1


def components(quantity: Quantity, space: Space) -> int:
    """Number of components of a quantity."""
    if isinstance(quantity, ParticleScalar):
        return 1
    if quantity.name in STRESSES:
        return space.num_strains
    return len(space.gradient) if quantity.name in NOMINAL else 1


def density(rule: Rule, quantity: Quantity, space: Space, part: Part = "value") -> Density:
    """Data of a quantity or one of its derivatives in a space."""
    width = {"strain": space.num_strains, "gradient": len(space.gradient)}.get(part, 1)
    return Density(rule, quantity, part, components(quantity, space) * width)
