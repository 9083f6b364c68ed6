"""Quantities of a solution whose error can be estimated: linear functions of the fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.text import quoted
from tawami.domain.border import Part, SceneBorder, label
from tawami.domain.domain import Domain
from tawami.domain.points import check_in_body
from tawami.domain.selection import present
from tawami.field.border import PointsInCells
from tawami.grid import edges

#: Derivative of a quantity by all coefficients of a domain with a field for the volume.
Weights = Callable[[Domain, SceneBorder], Array]


@dataclass(frozen=True)
class Goal:
    """A quantity whose error :meth:`tawami.Solution.error` estimates.

    Attributes:
        name: In words.
        unit: Its unit.
        weights: Its derivative by all coefficients, given a domain and the border of the body.
    """

    name: str
    unit: str
    weights: Weights

    @classmethod
    def displacement(cls, point: Sequence[float], component: str) -> Goal:
        """A component of the displacement of a point [m].

        Args:
            point: Position (x, y) [m] in the body.
            component: 'x' or 'y'.
        """
        place = checks.point("point", point)
        name = f"displacement {component} of {place}"

        def weights(domain: Domain, border: SceneBorder) -> Array:
            check_in_body(domain, place, name)
            location = edges.locate_point(domain.model.grid, place, name)
            cells = PointsInCells(domain.model.grid, location)
            return _of_component(domain, component, cells.values(domain.layout.basis).T.toarray())

        return cls(name, "m", weights)

    @classmethod
    def mean_displacement(cls, part: Part, component: str) -> Goal:
        """The mean of a component of the displacement over a part of the border [m].

        Args:
            part: Name of a part of the border, or as for `Scene.fix`.
            component: 'x' or 'y'.
        """
        name = f"mean displacement {component} of {label(part)}"

        def weights(domain: Domain, border: SceneBorder) -> Array:
            points = border.part(name, part)
            share = points.weight[:, None] / points.weight.sum()
            return _of_component(
                domain,
                component,
                points.cells(domain).sums(domain.layout.functions, domain.layout.basis, share),
            )

        return cls(name, "m", weights)

    @classmethod
    def mean_stress(cls, where: Callable[[Array, Array], Any] | None = None) -> Goal:
        """The mean stress (xx + yy + zz)/3, averaged over a region [Pa].

        Args:
            where: A function f(x, y) on arrays of positions that returns a mask; by default the body.

        Raises:
            InputError: Not a function. Masks of other types raise it in `Solution.error`.
        """
        if where is not None and not callable(where):
            raise InputError(
                f"Goal.mean_stress(where = {checks.shown(where)}): expected a function f(x, y) that "
                "returns a mask, or none for the whole body"
            )
        name = "mean stress" + ("" if where is None else " where f(x, y)")

        def weights(domain: Domain, border: SceneBorder) -> Array:
            particles, place = domain.particles, domain.layout.volumetric
            assert place is not None
            inside = np.ones(len(particles)) if where is None else present(domain, name, where)
            share = inside * particles.volume / (inside @ particles.volume)
            if domain.model.form.kinematics.has_eps_v:
                share = share * domain.constants["K"]
            found = np.zeros(domain.layout.size)
            found[place.slice] = domain.sums(share, np.ones((len(share), 1)), place.basis)[:, 0]
            return found

        return cls(name, "Pa", weights)


def _of_component(domain: Domain, component: str, sums: Array) -> Array:
    """Weights of one component of the displacement, given those of the functions."""
    axes = domain.model.space.axes
    if not checks.one_of(component, axes):
        raise InputError(f"component {checks.shown(component)}: expected one of {quoted(axes)}")
    found = np.zeros((len(sums), len(axes)))
    found[:, axes.index(component)] = sums[:, 0]
    return np.pad(found.ravel(), (0, domain.layout.size - found.size))
