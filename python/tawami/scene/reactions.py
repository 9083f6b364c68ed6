"""Forces of supports and walls on the body, from what is out of balance without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.grid import edges
from tawami.grid.grid import EDGES, Edge
from tawami.scene.model import Model
from tawami.scene.step import Accepted
from tawami.scene.supports import Supports

Array = npt.NDArray[np.float64]
#: A point is one of a `hold` if it is this near to it [cells].
SAME_POINT = 1e-8


def supported_edge(place: str, supported: set[str]) -> Edge:
    """The edge of that name, one of those with supports.

    Raises:
        InputError: No such edge, or none with supports.
    """
    if place not in EDGES:
        raise InputError(f"reaction({checks.shown(place)}): expected one of {', '.join(EDGES)}")
    if place not in supported:
        raise InputError(
            f"reaction('{place}'): nothing supports that edge: expected one of "
            f"{', '.join(sorted(supported)) or 'none'}, or fix('{place}', ...) or wall('{place}') before"
        )
    return place


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
        on_edges: Of edges and walls, functions x dim [N per metre depth].
        at_points: Of points.
        supported: Names of the edges with supports.
    """

    on_edges: Array
    at_points: Sequence[AtPoint] = field(default_factory=list)
    supported: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, accepted: Accepted, supports: Supports) -> Reactions:
        """Points by their multipliers, the rest to edges and walls.

        Args:
            accepted: The step.
            supports: The supports it was solved with.
        """
        reduction = accepted.problem.reduction
        forces = accepted.forces.ravel()
        n, points, rest, at_points = len(forces), reduction.points, forces.copy(), list[AtPoint]()
        if points:
            weights = np.zeros((n, len(points)))
            for k, point in enumerate(points):
                weights[point.indices, k] = point.weights
            loose = ~reduction.fixed[:n]
            multipliers = np.linalg.lstsq(weights[loose], rest[loose], rcond=None)[0]
            rest -= weights @ multipliers
            for point, support, force in zip(points, supports.at_points, multipliers, strict=True):
                assert not isinstance(support.given, str)
                assert not isinstance(support.place, str)
                places = (support.given, support.place, point.place)
                at_points.append(AtPoint(places, support.component, float(force)))
        held = np.where(reduction.fixed[:n], rest, 0.0).reshape(accepted.u.shape)
        return cls(held + accepted.friction, at_points, supports.supported_edges)

    def at(self, model: Model, place: str | Sequence[float]) -> Array:
        """Force (x, y) [N per metre depth] of an edge or a point; see `Solution.reaction`."""
        if isinstance(place, str):
            edge = supported_edge(place, self.supported)
            functions = edges.edge_functions(model.grid, model.basis, edge)
            return np.asarray(self.on_edges[functions].sum(axis=0))
        place = checks.point("reaction(...)", place)
        near = SAME_POINT * model.grid.h
        force, found = np.zeros(model.space.dim), False
        for one in self.at_points:
            if any(np.abs(np.subtract(place, known)).max() <= near for known in one.places):
                force[one.component] += one.force
                found = True
        if not found:
            raise InputError(f"reaction({tuple(place)}): no point is held there")
        return force
