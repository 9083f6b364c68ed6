"""Values that supports prescribe in a step, as constraints on the coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tawami.base.arrays import Array
from tawami.field.constraints import Held, PointHeld, held_edge, held_point
from tawami.grid import edges
from tawami.scene.action import Term
from tawami.scene.domain import Domain
from tawami.scene.support import Support


@dataclass(frozen=True)
class Fields:
    """Fields without a role in a step.

    Attributes:
        old: Their coefficients at its start.
        amount: Factor of each prescribed value.
        share: Share of the way from the old to the prescribed value at its end.
    """

    old: Array
    amount: Callable[[Term], float]
    share: float


def of_field(domain: Domain, support: Support, start: Array, fields: Fields | None) -> Held:
    """Prescribed values of a field, counted as the coefficients at the start."""
    held = on_edge(domain, support, fields.amount if fields else lambda _: 0.0)
    at_start = start[held.indices]
    if fields is None:
        return Held(held.indices, at_start, held.where)
    increments = fields.share * (held.values - fields.old[held.indices])
    return Held(held.indices, at_start + increments, held.where)


def is_left(domain: Domain, support: Support) -> bool:
    """Whether no cell along the support's edge holds particles."""
    assert isinstance(support.place, str)
    part = edges.cells_between(domain.model.grid, support.place, support.between)
    return not part[domain.tractions.cells(support.place)].any()


def on_edge(domain: Domain, support: Support, amount: Callable[[Term], float]) -> Held:
    """Values along an edge of the grid."""
    assert isinstance(support.place, str)
    indices, values = np.empty(0, dtype=np.int64), np.zeros(1)
    places = domain.layout.fields
    place, component = next(iter(places.values())), support.component
    if isinstance(component, str):
        place, component = places[component], 0
    for term in support.terms:
        edge = held_edge(
            domain.model.grid, place, domain.active, support.place, component, term.values[0],
            support.between,
        )  # fmt: skip
        indices, values = edge.indices, values + amount(term) * edge.values
    return Held(indices, values, support.line)


def at_point(domain: Domain, support: Support, amount: Callable[[Term], float]) -> PointHeld:
    """The displacement of a point."""
    assert not isinstance(support.place, str)
    assert not isinstance(support.component, str)
    return held_point(
        domain.model.grid, domain.model.basis, domain.active, support.place, support.component,
        total(support, amount), domain.layout.active,
    )  # fmt: skip


def total(support: Support, amount: Callable[[Term], float]) -> float:
    """A prescribed displacement [m], with 1 for each function of position."""
    values = ((1.0 if callable(v) else v, amount(t)) for t in support.terms for v in t.values)
    return sum(value * factor for value, factor in values)
