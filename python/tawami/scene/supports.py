"""Supports of a scene: edges of the grid, points of the body, walls; held, or moved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.identity import text
from tawami.field.reduction import Reduction
from tawami.grid import edges
from tawami.grid.basis import Basis
from tawami.grid.edges import Component, Interval, Profile
from tawami.grid.grid import Edge, Grid
from tawami.scene.domain import Attached
from tawami.scene.loads import check_alike
from tawami.scene.walls import Contact, Wall

Array = npt.NDArray[np.float64]
#: A velocity [m/s], constant or a function of time [s].
Velocity = float | Callable[[float], float]


@dataclass
class Support:
    """One displacement component that is prescribed along an edge or at a point.

    Attributes:
        place: Name of the edge, or the point (x, y) [m], which moves with the body.
        given: The same as the driver script gave it.
        component: 0 or 1.
        value: Displacement [m]; 1 where a velocity is prescribed.
        velocity: [m/s]; None where a displacement is prescribed.
        between: Part of the edge [m]; None for all of it.
        carried: Share of the value that later ones grow from.
        applied: Share of the value that is there already.
        way: How far the body has been moved across an edge [m], where particles move.
    """

    place: Edge | tuple[float, float]
    component: int
    value: Profile
    velocity: Velocity | None = None
    between: Interval | None = None
    carried: float = 0.0
    applied: float = 0.0
    way: float = 0.0
    given: Edge | tuple[float, float] = field(init=False)

    def __post_init__(self) -> None:
        self.given = self.place

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
            return checks.number(f"{self}: velocity at {time:g} s", value)
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
        edges.cells_between(self.grid, edge, between)
        value = checks.profile(f"fix(edge='{edge}'): value", value)
        self._add(Support(edge, edges.component_index(component), value, velocity, between))

    def hold(
        self,
        point: Sequence[float],
        component: Component,
        value: float,
        velocity: Velocity | None,
    ) -> None:
        """Prescribe a component at a point."""
        what = f"hold(point={checks.shown(point)})"
        edges.locate_point(self.grid, point, what)
        place = checks.point(what, point)
        held = checks.number(f"{what}: value", value)
        self._add(Support(place, edges.component_index(component), held, velocity))

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
        what = f"wall(edge='{edge}')"
        mu = checks.real(f"{what}: friction", friction)
        if mu != np.inf:
            checks.number(f"{what}: friction", friction, low=0.0)
        separates = checks.switch(f"{what}: separates", separates)
        if any(wall.edge == edge for wall in self.walls):
            raise InputError(f"wall(edge='{edge}'): there is one already; release('{edge}') first")
        self.walls.append(Wall(self.grid, self.basis, edge, mu, separates))

    def release(self, place: Edge | Sequence[float], component: Component | None) -> None:
        """Take supports away."""
        at = place if isinstance(place, str) else checks.point("release(...)", place)
        axis = None if component is None else edges.component_index(component)
        gone = [s for s in self.all if at in (s.place, s.given) and axis in (None, s.component)]
        walls = [w for w in self.walls if w.edge == at and axis is None]
        if not gone and not walls:
            places = sorted({f"{s.place}" for s in self.all} | {w.edge for w in self.walls})
            raise InputError(
                f"release({checks.shown(place)}): no such support: expected one of "
                f"{', '.join(places) or 'none'}"
            )
        self.all = [s for s in self.all if s not in gone]
        self.walls = [w for w in self.walls if w not in walls]

    def reduction(
        self,
        attached: Attached,
        amount: Callable[[Support], float],
        start: Array,
        gap: Array,
        *,
        moving: bool,
    ) -> Reduction:
        """What the supports leave free.

        Args:
            attached: The particles where they are.
            amount: Factor of each support's value.
            start: Coefficients that are there already, which the amounts include.
            gap: Displacement coefficients since the start of the scene where particles do not move,
                0 where they do: what walls look at.
            moving: Inertia holds the body: rigid motions may be free, and edges held at rest that have
                lost it are passed over.

        Raises:
            SupportError: An edge or point with a prescribed motion, or a point at all, that the body
                has left.
        """
        field, layout, held, points = attached.field, attached.layout, [], []
        for support in self.all:
            share = amount(support)
            if isinstance(support.place, str):
                part = edges.cells_between(self.grid, support.place, support.between)
                if (
                    moving
                    and support.velocity is None
                    and not part[field.along(support.place)].any()
                ):
                    continue
                edge = edges.held_edge(
                    self.grid, self.basis, field.active, support.place, support.component,
                    support.value, support.between,
                )  # fmt: skip
                held.append(edges.Held(edge.indices, share * edge.values))
            else:
                assert not callable(support.value)
                points.append(
                    edges.held_point(
                        self.grid, self.basis, field.active, support.place, support.component,
                        share * support.value, layout.active,
                    )
                )  # fmt: skip
        fixed = np.zeros(layout.size, dtype=bool)
        for edge in held:
            fixed[edge.indices] = True
        for wall in self.walls:
            taken = fixed.copy()
            for other in self.walls:
                taken[other.stopped if other is not wall else []] = True
            held += wall.held(layout.active, taken, start, gap)
        return Reduction(layout, held, points, start, moving=moving)

    def stay_on_edges(self, amount: Callable[[Support], float]) -> dict[int, float]:
        """How far each support will have moved the body across its edge, where particles move; the
        edge's functions stay where they are and would soon hold nothing.

        Raises:
            InputError: More than a quarter of a cell.
        """
        ways = {}
        for number, support in enumerate(self.all):
            if (
                isinstance(support.place, str)
                and self.grid.edge(support.place)[0] == support.component
            ):
                value = 1.0 if callable(support.value) else support.value
                ways[number] = support.way + amount(support) * value
                if abs(ways[number]) > 0.25 * self.grid.h and not callable(support.value):
                    raise InputError(
                        f"{support} would have moved the body {ways[number]:.3g} m across its edge of "
                        "the grid, whose functions stay there: expected at most a quarter of a cell, "
                        f"{0.25 * self.grid.h:.3g} m. hold(point, ...) moves points of the body further"
                    )
        return ways

    def follow(self, u: Array, points: Sequence[edges.PointHeld]) -> None:
        """Points move with the body.

        Args:
            u: Increments of the displacement, functions x 2.
            points: The constraints of the step, in the order of the supports.
        """
        supports = [s for s in self.all if not isinstance(s.place, str)]
        for support, point in zip(supports, points, strict=True):
            x, y = point.place + point.weights @ u[point.indices // 2]
            support.place = (float(x), float(y))

    def state(self) -> dict[str, Any]:
        """Where points are, what of them the body has followed already, and what touches the walls."""
        return {
            "supports": [
                {"place": s.place, "carried": s.carried, "applied": s.applied, "way": s.way}
                for s in self.all
            ],
            "walls": [{"touching": w.state.touching, "slip": w.state.slip} for w in self.walls],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, of the same supports."""
        check_alike("support", len(state["supports"]), len(self.all))
        check_alike("wall", len(state["walls"]), len(self.walls))
        for support, values in zip(self.all, state["supports"], strict=True):
            if not isinstance(support.place, str):
                x, y = values["place"]
                support.place = (x, y)
            support.carried, support.applied = values["carried"], values["applied"]
            support.way = values["way"]
        for wall, values in zip(self.walls, state["walls"], strict=True):
            wall.state = Contact(values["touching"], values["slip"])

    def identity(self) -> list[Any]:
        """What tells them from other supports, for checkpoints."""
        held = [
            [str(s.given), s.component, text(s.value), text(s.velocity), text(s.between)]
            for s in self.all
        ]
        return held + [["wall", w.edge, w.friction, w.separates] for w in self.walls]

    def friction(self, forces: Array) -> Array:
        """Friction of the walls from what supports have to give, functions x 2."""
        return sum((wall.friction_of(forces) for wall in self.walls), np.zeros_like(forces))

    def adapt(self, forces: Array, u: Array, gap: Array, active: npt.NDArray[np.bool_]) -> bool:
        """Change states of the walls that contradict a solution; whether there were any."""
        changed = [wall.adapt(forces, u, gap, active) for wall in self.walls]
        return any(changed)
