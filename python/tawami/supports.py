"""Supports of a scene: edges of the grid, points of the body, walls; held, or moved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami import _rust, boundary, inputs
from tawami.attached import Attached
from tawami.basis import Basis
from tawami.boundary import Component, Interval, Profile
from tawami.errors import InputError
from tawami.grid import Edge, Grid
from tawami.reduction import Reduction
from tawami.wall import Wall

Array = npt.NDArray[np.float64]
#: A velocity [m/s], constant or a function of time [s].
Velocity = float | Callable[[float], float]


@dataclass
class Support:
    """One displacement component that is prescribed along an edge or at a point.

    Attributes:
        place: Name of the edge, or the point (x, y) [m], which moves with the body.
        component: 0 or 1.
        value: Displacement [m]; 1 where a velocity is prescribed.
        velocity: [m/s]; None where a displacement is prescribed.
        between: Part of the edge [m]; None for all of it.
        carried: Share of the value that later ones grow from.
        applied: Share of the value that is there already.
    """

    place: Edge | tuple[float, float]
    component: int
    value: Profile
    velocity: Velocity | None = None
    between: Interval | None = None
    carried: float = 0.0
    applied: float = 0.0

    def at(self, part: float) -> float:
        """Share of the value once `part` of what is new has come."""
        return self.carried + part * (1.0 - self.carried)

    def __str__(self) -> str:
        where = f"edge='{self.place}'" if isinstance(self.place, str) else f"point={self.place}"
        return f"{'fix' if isinstance(self.place, str) else 'hold'}({where})"

    @property
    def still(self) -> bool:
        """Whether it prescribes a displacement of zero."""
        return self.velocity is None and not callable(self.value) and self.value == 0

    def velocity_at(self, time: float) -> float:
        """[m/s]

        Raises:
            InputError: The function fails, or its value is no finite number.
        """
        given = self.velocity
        try:
            value = given(time) if callable(given) else given or 0.0
            return inputs.number(f"{self}: velocity at {time:g} s", value)
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"{self}: velocity({time:g}) gave {error!r}: expected m/s") from error


class Supports:
    """The supports of one scene.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
    """

    def __init__(self, grid: Grid, basis: Basis) -> None:
        self.grid, self.basis = grid, basis
        self.all: list[Support] = []
        self.walls: list[Wall] = []

    def fix(
        self,
        edge: Edge,
        component: Component,
        value: Profile,
        velocity: Velocity | None,
        between: Interval | None,
    ) -> None:
        """Prescribe a component along an edge."""
        boundary.cells_between(self.grid, edge, between)
        self._add(Support(edge, boundary.component_index(component), value, velocity, between))

    def hold(
        self,
        point: Sequence[float],
        component: Component,
        value: float,
        velocity: Velocity | None,
    ) -> None:
        """Prescribe a component at a point."""
        what = f"hold(point={point})"
        boundary.locate_point(self.grid, point, what)
        place = inputs.point(what, point)
        held = inputs.number(f"{what}: value", value)
        self._add(Support(place, boundary.component_index(component), held, velocity))

    def _add(self, support: Support) -> None:
        if support.velocity is not None:
            if not support.still and (callable(support.value) or support.value != 0):
                raise InputError(f"{support}: expected a value or a velocity, not both")
            support.value = 1.0
            support.velocity_at(0.0)
        self.all.append(support)

    def wall(self, edge: Edge, friction: float, separates: bool) -> None:
        """A wall along an edge."""
        self.grid.edge(edge)
        if friction != np.inf:
            friction = inputs.number(f"wall(edge='{edge}'): friction", friction, low=0.0)
        if any(wall.edge == edge for wall in self.walls):
            raise InputError(f"wall(edge='{edge}'): there is one already; release('{edge}') first")
        self.walls.append(Wall(self.grid, self.basis, edge, friction, bool(separates)))

    def release(self, place: Edge | Sequence[float], component: Component | None) -> None:
        """Take supports away."""
        at = place if isinstance(place, str) else inputs.point("release(...)", place)
        axis = None if component is None else boundary.component_index(component)
        gone = [s for s in self.all if s.place == at and axis in (None, s.component)]
        walls = [w for w in self.walls if w.edge == at and axis is None]
        if not gone and not walls:
            places = sorted({f"{s.place}" for s in self.all} | {w.edge for w in self.walls})
            raise InputError(
                f"release({place!r}): no such support: expected one of {', '.join(places) or 'none'}"
            )
        self.all = [s for s in self.all if s not in gone]
        self.walls = [w for w in self.walls if w not in walls]

    def reduction(
        self,
        attached: Attached,
        amount: Callable[[Support], float],
        start: Array,
        *,
        moving: bool,
    ) -> Reduction:
        """What the supports leave free.

        Args:
            attached: The particles where they are.
            amount: Factor of each support's value.
            start: Coefficients that are there already, which the amounts include.
            moving: Inertia holds the body: rigid motions may be free, and supports that have lost it
                are passed over.
        """
        field, held, points = attached.field, [], []
        for support in self.all:
            share = amount(support)
            if isinstance(support.place, str):
                if moving and not len(field.edge_nodes(support.place)):
                    continue
                edge = boundary.held_edge(
                    self.grid, self.basis, field.active, support.place, support.component,
                    support.value, support.between,
                )  # fmt: skip
                held.append(boundary.Held(edge.indices, share * edge.values))
            else:
                assert not callable(support.value)
                points.append(
                    boundary.held_point(
                        self.grid, self.basis, field.active, support.place, support.component,
                        share * support.value,
                    )
                )  # fmt: skip
        for wall in self.walls:
            for at_rest in wall.held(attached.layout.active):
                values = start[at_rest.indices]
                held.append(boundary.Held(at_rest.indices, values))
        return Reduction(attached.layout, held, points, start, moving=moving)

    def follow(self, u: Array) -> None:
        """Points move with the body: u are the increments of the displacement."""
        for support in self.all:
            if not isinstance(support.place, str):
                location = boundary.locate_point(self.grid, support.place, str(support))
                x, y = support.place + _rust.interpolate(location, self.basis, 2, u)[0]
                support.place = (float(x), float(y))

    def friction(self, forces: Array) -> Array:
        """Friction of the walls from what supports have to give, functions x 2."""
        return sum((wall.friction_of(forces) for wall in self.walls), np.zeros_like(forces))

    def adapt(
        self, forces: Array, u: Array, active: npt.NDArray[np.bool_], *, monotone: bool
    ) -> bool:
        """Change states of the walls that contradict a solution; whether there were any."""
        changed = [wall.adapt(forces, u, active, monotone=monotone) for wall in self.walls]
        return any(changed)
