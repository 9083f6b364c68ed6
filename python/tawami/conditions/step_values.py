"""Values that supports prescribe in a step, as constraints on the coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.conditions.action import Term
from tawami.conditions.support import Support
from tawami.domain.border import SceneBorder
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints
from tawami.field.constraints import Held, PointHeld, held_edge, held_point
from tawami.grid.edges import evaluate
from tawami.grid.grid import Edge

#: Distance of a moving border from an edge of the grid below which it has come to it [cells].
NEAR = 1e-3


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


def of_field(
    domain: Domain,
    support: Support,
    edge: Edge,
    cells: Indices,
    start: Array,
    fields: Fields | None,
) -> Held:
    """Prescribed values of a field on an edge of the grid, counted as the coefficients at the start."""
    held = on_edge(domain, support, edge, cells, fields.amount if fields else lambda _: 0.0)
    at_start = domain.layout.at(start, held.indices)
    if fields is None:
        return Held(held.indices, at_start, held.where)
    old = domain.layout.at(fields.old, held.indices)
    increments = fields.share * (held.values - old)
    return Held(held.indices, at_start + increments, held.where)


def touched(domain: Domain, border: SceneBorder, support: Support, edge: Edge) -> Indices:
    """Numbers along an edge of the grid of the cells in which the body touches it; a call for all ranks.

    Where particles move, other points of the border than the support's own may have come to the edge.
    A body without a border touches it with each of its cells there.
    """
    grid = domain.model.grid
    axis, end = grid.edge(edge)
    along = 1 - axis
    cells = np.zeros((grid.cells[along], grid.space.dim), dtype=np.int64)
    cells[:, axis], cells[:, along] = grid.cells[axis] - 1 if end else 0, np.arange(len(cells))
    active = domain.layout.has_particles(cells)
    if not isinstance(support.place, MovingPoints) or border.points is None:
        return np.flatnonzero(active)
    own = support.place
    near = [own.x[own.edge(edge)]]
    if domain.model.moves:
        near.append(border.points.x[border.points.edge(edge, NEAR)])
    scaled = (np.concatenate(near)[:, along] - grid.origin[along]) / grid.h
    near_edge = np.unique(np.clip(scaled, 0, grid.cells[along] - 1).astype(np.int64))
    return np.asarray(near_edge[active[near_edge]])


def on_edge(
    domain: Domain, support: Support, edge: Edge, cells: Indices, amount: Callable[[Term], float]
) -> Held:
    """Values along an edge of the grid, where the body touches it in some cells along it."""
    indices, values = np.empty(0, dtype=np.int64), np.zeros(1)
    places, grid = domain.layout.of_grid, domain.model.grid
    place, component, sign = next(iter(places.values())), 0, 1.0
    if support.is_field:
        place = places[str(support.component)]
    else:
        component, sign = support.along_edge(edge, grid)
    for term in support.terms:
        held = held_edge(grid, place, edge, cells, component, term.values[0], f"{support}")
        indices, values = held.indices, values + sign * amount(term) * held.values
    return Held(indices, values, support.line)


def at_points(support: Support, amount: Callable[[Term], float], x: Array | None = None) -> Array:
    """Values at the points of a part of the border, or at other positions."""
    if x is None:
        assert isinstance(support.place, MovingPoints)
        x = support.place.x
    parts = (amount(term) * evaluate(term.values[0], x, f"{support}") for term in support.terms)
    return sum(parts, np.zeros(len(x)))


def at_point(domain: Domain, support: Support, amount: Callable[[Term], float]) -> PointHeld:
    """The displacement of a point."""
    assert isinstance(support.place, tuple)
    assert not isinstance(support.component, str)
    value = total(support, amount)
    return held_point(domain.layout, support.place, support.component, value)


def total(support: Support, amount: Callable[[Term], float]) -> float:
    """A prescribed displacement [m], with 1 for each function of position."""
    values = ((1.0 if callable(v) else v, amount(t)) for t in support.terms for v in t.values)
    return sum(value * factor for value, factor in values)
