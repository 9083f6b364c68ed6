"""Forces of supports and walls on the body, from the forces that are out of balance without them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.arrays import Array, of_components
from tawami.base.errors import InputError
from tawami.base.text import quoted
from tawami.conditions.contact_result import ContactResult
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.supports import Supports
from tawami.conditions.walls import Wall, name_of
from tawami.domain.model import Model
from tawami.field.owned import Owned
from tawami.field.reduction import Reduction
from tawami.grid import edges
from tawami.grid.grid import EDGES, Edge
from tawami.step.step import Accepted

#: A point is one of a `hold` if it is this near to it [cells].
SAME_POINT = 1e-8


def check_supported(place: str, supports: Supports) -> None:
    """Check that a part of the border, or an edge of the grid, has a support.

    Raises:
        InputError: It has none.
    """
    _check_known(place, supports.supported_edges, supports.names)


def _check_known(place: str, edges_held: Collection[str], names: Collection[str]) -> None:
    known = sorted({*edges_held, *names})
    if place not in known:
        raise InputError(
            f"reaction('{place}'): nothing supports that part of the border: expected one of "
            f"{quoted(known) or 'none'}, or fix('{place}', ...) or wall('{place}') before"
        )


def divided(reduction: Reduction, forces: Array) -> tuple[Array, Array]:
    """Forces of supports: those of edges and walls on all displacement coefficients, and the multipliers
    of points, which carry as much as possible; a call for all ranks.

    Args:
        reduction: The supports.
        forces: Of all supports on the displacement coefficients [N per metre depth].
    """
    layout, points = reduction.layout, reduction.points
    fixed, rest, multipliers = reduction.fixed[: len(forces)], forces, np.zeros(len(points))
    if points:
        some = np.unique(np.concatenate([point.indices for point in points]))
        weights = np.zeros((len(some), len(points)))
        for k, point in enumerate(points):
            weights[np.searchsorted(some, point.indices), k] = point.weights
        loose = layout.at(fixed.astype(float), some) == 0
        carried = layout.at(forces, some)[loose]
        multipliers = np.linalg.lstsq(weights[loose], carried, rcond=None)[0]
        place, rest = layout.places(some), forces.copy()
        rest[place[place >= 0]] -= (weights @ multipliers)[place >= 0]
    return np.where(fixed, rest, 0.0), multipliers


def work(reduction: Reduction, forces: Array, u: Array) -> float:
    """Work of forces of supports on increments of the displacement [J per metre depth].

    A call for all ranks.

    Args:
        reduction: The supports.
        forces, u: On all displacement coefficients [N per metre depth], [m].
    """
    held, multipliers = divided(reduction, forces)
    layout = reduction.layout
    moved = [point.weights @ layout.at(u, point.indices) for point in reduction.points]
    return layout.dot(held, u) + float(multipliers @ np.array(moved))


@dataclass(frozen=True)
class AtPoint:
    """Force of one `hold`.

    Attributes:
        places: The point as the script gave it, where it is now, and where the step began [m].
        component: 0 or 1.
        force: [N per metre depth]
    """

    places: tuple[tuple[float, float], ...]
    component: int
    force: float


@dataclass(frozen=True)
class Reactions:
    """Forces on the body at the end of a step; in dynamics with the impulse at its beginning over
    its length.

    Attributes:
        on_edges: Of edges, and of walls that hold functions, on the displacement coefficients
            [N per metre depth].
        on_walls: Of other walls.
        at_points: Of points.
        on_border: Of patches of the border [N per metre depth], by the names of its parts.
        on_obstacles: Contact with obstacles.
        supported: Names of the edges with supports.
        names: Parts of the border with supports, each with the edges of the grid that it is held on.
    """

    on_edges: Owned
    on_walls: Owned
    at_points: Sequence[AtPoint] = field(default_factory=list)
    on_border: Sequence[tuple[str, Array]] = ()
    on_obstacles: Sequence[ContactResult] = ()
    supported: Collection[str] = ()
    names: Mapping[str, Collection[Edge]] = field(default_factory=dict)

    @classmethod
    def of(cls, accepted: Accepted, supports: Supports) -> Reactions:
        """Points by their multipliers, the rest to edges and walls; a call for all ranks.

        Args:
            accepted: The step.
            supports: The supports it was solved with.
        """
        reduction, at_points = accepted.problem.reduction, list[AtPoint]()
        held, multipliers = divided(reduction, accepted.forces.ravel())
        points = zip(reduction.points, supports.at_points, multipliers, strict=True)
        for point, support, force in points:
            assert isinstance(support.given, tuple)
            assert isinstance(support.place, tuple)
            assert not isinstance(support.component, str)
            places = (support.given, support.place, point.place)
            at_points.append(AtPoint(places, support.component, float(force)))
        layout, friction = reduction.layout, accepted.friction
        on_edges = layout.owned(held + friction.ravel())
        on_border = [
            part
            for held in accepted.problem.supports
            if not held.support.is_field
            for part in held.resultants.items()
        ]
        held_edges = accepted.problem.held_edges
        contacts = [contact.result() for contact in accepted.problem.obstacles]
        walls = {wall.obstacle for wall in supports.walls}
        of_walls = [c.at_end for c in accepted.problem.obstacles if c.obstacle in walls]
        on_walls = layout.sum(sum(of_walls, np.zeros(layout.size)))[: layout.num_displacement]
        return cls(
            on_edges, layout.owned(on_walls), at_points, on_border, contacts, held_edges,
            supports.names,
        )  # fmt: skip

    def contact(self, obstacle: Any) -> ContactResult:
        """Contact with an obstacle, given by its handle or name."""
        name = getattr(obstacle, "name", obstacle)
        for one in self.on_obstacles:
            if one.name == name:
                return one
        known = quoted([one.name for one in self.on_obstacles])
        raise InputError(
            f"contact({checks.shown(name)}): the step had no such obstacle: expected one of "
            f"{known or 'none'}"
        )

    def at(self, model: Model, place: str | Sequence[float] | Obstacle | Wall) -> Array:
        """Force (x, y) [N per metre depth] of a support, a call for all ranks; see `Solution`."""
        force, found = np.zeros(model.space.dim), False
        place = place.edge if isinstance(place, Wall) else place
        if isinstance(place, Obstacle) or any(place == one.name for one in self.on_obstacles):
            return -self.contact(place).force
        if isinstance(place, str):
            _check_known(place, self.supported, self.names)
            on_edges = {*self.names.get(place, ())}
            if checks.one_of(place, EDGES) and place in self.supported:
                on_edges.add(checks.choice("reaction(...)", place, EDGES))
            for edge in sorted(on_edges):
                functions = edges.edge_functions(model.grid, model.basis, edge)
                places = of_components(functions, model.space.dim)
                force = force + self.on_edges.at(places).sum(axis=0)
                force -= sum(c.force for c in self.on_obstacles if c.name == name_of(edge))
            parts = [part for name, part in self.on_border if name == place]
            return np.asarray(sum(parts, force))
        place = checks.point("reaction(...)", place)
        near = SAME_POINT * model.grid.h
        for one in self.at_points:
            if any(np.abs(np.subtract(place, known)).max() <= near for known in one.places):
                force[one.component] += one.force
                found = True
        if not found:
            raise InputError(f"reaction({tuple(place)}): no point is held there")
        return force
