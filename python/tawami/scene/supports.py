"""Supports of a scene: displacements prescribed along edges and at points, and walls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.identity import text
from tawami.base.text import listed
from tawami.field.constraints import Held, PointHeld, held_edge, held_point
from tawami.field.reduction import Reduction
from tawami.grid import edges
from tawami.grid.basis import Basis
from tawami.grid.edges import Component, Interval, Profile
from tawami.grid.grid import Edge, Grid
from tawami.scene.contact import ActiveSet
from tawami.scene.domain import Domain
from tawami.scene.share import Share, check_same_number
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
        share: What of the value the body carries.
        crossing: How far it has moved the body across its edge [m], where particles move.
    """

    place: Edge | tuple[float, float]
    component: int
    value: Profile
    velocity: Velocity | None = None
    between: Interval | None = None
    share: Share = field(default_factory=Share)
    crossing: float = 0.0
    given: Edge | tuple[float, float] = field(init=False)

    def __post_init__(self) -> None:
        self.given = self.place

    def __str__(self) -> str:
        where = f"edge='{self.place}'" if isinstance(self.place, str) else f"point={self.place}"
        return f"{'fix' if isinstance(self.place, str) else 'hold'}({where})"

    @property
    def motion(self) -> str:
        """What it prescribes, in words; nothing for zero."""
        if self.velocity is not None:
            return " with a velocity"
        if self.is_zero:
            return ""
        return " by a function" if callable(self.value) else f" = {self.value:g} m"

    @property
    def is_zero(self) -> bool:
        """Whether it prescribes a displacement of zero."""
        return self.velocity is None and not callable(self.value) and self.value == 0

    def velocity_at(self, time: float) -> float:
        """Its velocity at a time [m/s].

        Raises:
            InputError: The function fails, or its value is not a finite number.
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
        self._add(Support(edge, self.grid.space.axis(component), value, velocity, between))

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
        self._add(Support(place, self.grid.space.axis(component), held, velocity))

    def _add(self, support: Support) -> None:
        if support.velocity is not None:
            if not support.is_zero and (callable(support.value) or support.value != 0):
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
        axis = None if component is None else self.grid.space.axis(component)
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

    # -- what they prescribe in a step ---------------------------------------

    def constraints(
        self,
        domain: Domain,
        amount: Callable[[Support], float],
        start: Array,
        before: Array,
        *,
        moving: bool,
    ) -> tuple[Reduction, ActiveSet]:
        """What the supports leave free, and the walls in their present states.

        Args:
            domain: The particles where they are.
            amount: Factor of each support's value.
            start: Coefficients at the start of the step, which the amounts include.
            before: Displacement coefficients since the start of the scene where particles do not move,
                0 where they do: what walls measure distances from.
            moving: Inertia or stress holds the body: rigid motions may be free, and edges that are
                held at rest and that the body has left are skipped.

        Raises:
            SupportError: The body has left an edge with a prescribed motion, or a point.
        """
        layout, held, points = (
            domain.layout,
            list[Held](),
            list[PointHeld](),
        )
        for support in self.all:
            if isinstance(support.place, str):
                if not (moving and support.velocity is None and self._is_left(domain, support)):
                    held.append(self._on_edge(domain, support, amount(support)))
            else:
                points.append(self._at_point(domain, support, amount(support)))
        fixed = np.zeros(layout.size, dtype=bool)
        for edge in held:
            fixed[edge.indices] = True
        prescribed = []
        for wall in self.walls:
            by_others = fixed.copy()
            for other in self.walls:
                by_others[other.stopped if other is not wall else []] = True
            prescribed.append(wall.prescribed(by_others))
            held += wall.held(layout.active, prescribed[-1], start, before)
        contact = ActiveSet(self.walls, prescribed)
        return Reduction(layout, held, points, start, moving=moving), contact

    def _is_left(self, domain: Domain, support: Support) -> bool:
        """Whether no cell along the support's edge holds particles."""
        assert isinstance(support.place, str)
        part = edges.cells_between(self.grid, support.place, support.between)
        return not part[domain.tractions.cells(support.place)].any()

    def _on_edge(self, domain: Domain, support: Support, amount: float) -> Held:
        assert isinstance(support.place, str)
        edge = held_edge(
            self.grid, self.basis, domain.active, support.place, support.component,
            support.value, support.between,
        )  # fmt: skip
        return Held(edge.indices, amount * edge.values)

    def _at_point(self, domain: Domain, support: Support, amount: float) -> PointHeld:
        assert not isinstance(support.place, str)
        assert not callable(support.value)
        return held_point(
            self.grid, self.basis, domain.active, support.place, support.component,
            amount * support.value, domain.layout.active,
        )  # fmt: skip

    def num_free(self, domain: Domain) -> int:
        """Number of unknowns that the supports leave."""
        zero = np.zeros(domain.layout.size)
        return self.constraints(domain, lambda _: 0.0, zero, zero, moving=True)[0].size

    # -- where particles move ------------------------------------------------

    def crossings(self, amount: Callable[[Support], float]) -> dict[int, float]:
        """How far each support will have moved the body across its edge [m], by its number.

        The functions of the edge stay where they are and would soon hold nothing.

        Raises:
            InputError: More than a quarter of a cell.
        """
        crossings = {}
        for number, support in enumerate(self.all):
            if (
                isinstance(support.place, str)
                and self.grid.edge(support.place)[0] == support.component
            ):
                value = 1.0 if callable(support.value) else support.value
                crossings[number] = support.crossing + amount(support) * value
                if abs(crossings[number]) > 0.25 * self.grid.h and not callable(support.value):
                    raise InputError(
                        f"{support} would have moved the body {crossings[number]:.3g} m across its edge "
                        "of the grid, whose functions stay there: expected at most a quarter of a cell, "
                        f"{0.25 * self.grid.h:.3g} m. hold(point, ...) moves points of the body further"
                    )
        return crossings

    def follow(self, u: Array, points: Sequence[PointHeld], crossings: Mapping[int, float]) -> None:
        """Move the points with the body, and record how far it has crossed edges.

        Args:
            u: Increments of the displacement, functions x dim.
            points: The constraints of the step, in the order of the supports.
            crossings: As :meth:`crossings` gave them for this step.
        """
        for support, point in zip(self.at_points, points, strict=True):
            x, y = point.place + point.weights @ u[point.indices // self.grid.space.dim]
            support.place = (float(x), float(y))
        for number, crossing in crossings.items():
            self.all[number].crossing = crossing

    @property
    def at_points(self) -> list[Support]:
        """The supports that hold a point."""
        return [s for s in self.all if not isinstance(s.place, str)]

    @property
    def supported_edges(self) -> set[str]:
        """Names of the edges of the grid that supports or walls act on."""
        edges_held = {support.place for support in self.all if isinstance(support.place, str)}
        return edges_held | {wall.edge for wall in self.walls}

    # -- header, identity, checkpoints ---------------------------------------

    @property
    def line(self) -> str:
        """The supports in words, for the header of a run."""
        texts = [
            f"{support} {self.grid.space.axes[support.component]}{support.motion}"
            for support in self.all
        ]
        texts += [f"wall(edge='{wall.edge}') friction {wall.friction:g}" for wall in self.walls]
        return listed(texts)

    def identity(self) -> list[list[Any]]:
        """What decides the results of a run, as JSON holds it."""
        given = [
            [str(s.given), s.component, *map(text, (s.value, s.velocity, s.between))]
            for s in self.all
        ]
        return given + [["wall", w.edge, w.friction, w.separates] for w in self.walls]

    def state(self) -> dict[str, Any]:
        """Where points are, what of each support the body carries, and what touches the walls."""
        return {
            "supports": [
                {"place": s.place, "share": s.share.state(), "crossing": s.crossing}
                for s in self.all
            ],
            "walls": [{"touching": w.state.touching, "slip": w.state.slip} for w in self.walls],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, for the same supports.

        Raises:
            CheckpointError: The script has made another number of supports.
        """
        check_same_number("support", len(state["supports"]), len(self.all))
        check_same_number("wall", len(state["walls"]), len(self.walls))
        for support, values in zip(self.all, state["supports"], strict=True):
            if not isinstance(support.place, str):
                x, y = values["place"]
                support.place = (x, y)
            support.share.restore(values["share"])
            support.crossing = values["crossing"]
        for wall, values in zip(self.walls, state["walls"], strict=True):
            wall.state = Contact(values["touching"], values["slip"])
