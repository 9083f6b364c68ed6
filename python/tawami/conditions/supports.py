"""Supports of a scene: displacements prescribed on the border and at points, and walls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tawami.base import checks, stored
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError, SupportError
from tawami.base.text import listed, quoted
from tawami.conditions.action import Owner, restored
from tawami.conditions.activity import Activity
from tawami.conditions.factor import Factor, InTime
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.obstacle_inputs import checked_friction
from tawami.conditions.share import Moment
from tawami.conditions.support import LOCAL, Place, Support
from tawami.conditions.walls import Wall
from tawami.domain.border import Part, SceneBorder, label
from tawami.domain.domain import Domain
from tawami.domain.excavation import Excavation
from tawami.domain.moving_points import MovingPoints
from tawami.domain.points import is_in_body, reach
from tawami.field.constraints import PointHeld
from tawami.field.layout import Layout
from tawami.form.fields import Field
from tawami.grid import edges
from tawami.grid.basis import Basis
from tawami.grid.edges import Profile
from tawami.grid.grid import EDGES, Edge, Grid


class Supports(Owner[Support]):
    """The supports of one scene.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        fields: The fields without a role.
        border: The border of the body.
        activity: Time and activity of the scene.

    Attributes:
        border: The border of the body.
        all: The supports on the border and at points.
        walls: The walls.
        axis: In axisymmetry, u_x = 0 along the axis if it is an edge of the grid; else none.
        version: A number that changes with every change of a support or wall by the driver script.
    """

    def __init__(
        self,
        grid: Grid,
        basis: Basis,
        fields: Mapping[str, Field],
        border: SceneBorder,
        activity: Activity,
    ) -> None:
        super().__init__(activity)
        self.grid, self.basis, self._fields, self.border = grid, basis, fields, border
        self.walls: list[Wall] = []
        self.axis: list[Support] = []
        if grid.on_axis:
            zero = Factor("the axis")
            self.axis.append(Support(self, "left", "the axis", 0, "m", 0.0, zero))

    def remove(self, action: Support | Wall) -> None:
        """Remove a support or a wall."""
        self.walls = [wall for wall in self.walls if wall is not action]
        super().remove(action)

    def fix(
        self,
        domain: Domain,
        where: Part,
        component: str,
        value: Profile,
        amplitude: InTime | None,
        velocity: InTime | None,
    ) -> Support:
        """Prescribe a component on a part of the border."""
        given = label(where)
        what = f"fix({given})"
        axis = self._component(component, LOCAL)
        place: Place = self._place(domain, what, where)
        whole: dict[Edge, Mask] = {}
        if isinstance(place, MovingPoints):
            whole = self.border.whole_edges(place)
        return self._add(place, given, what, axis, value, amplitude, velocity, whole)

    def _place(self, domain: Domain, what: str, where: Part) -> MovingPoints | Edge:
        """Points of a part of the border; of a body without a border, an edge of the grid."""
        points = self.border.points
        on_axis = self.grid.on_axis and checks.one_of(where, ("left",))
        if on_axis and points is not None and not points.edge("left").any():
            return "left"  # the border has no points on the axis
        if points is not None or not checks.one_of(where, EDGES):
            return self.border.part(what, where)
        edge: Edge = checks.choice(what, where, EDGES)
        distance = reach(domain, edge)
        if distance > 0:
            raise SupportError(
                f"{what}: the particles of a body without a border end {distance:.3g} m away from that "
                "edge of the grid: expected particles that reach it, or a body with a border"
            )
        return edge

    def hold(
        self,
        point: Sequence[float],
        component: str,
        value: float,
        amplitude: InTime | None,
        velocity: InTime | None,
    ) -> Support:
        """Prescribe a component at a point."""
        what = f"hold(point={checks.shown(point)})"
        edges.locate_point(self.grid, point, what)
        place = checks.point(what, point)
        axis = self._component(component)
        if isinstance(axis, str):
            raise InputError(
                f"{what}: the field '{axis}' at a point: expected fix(where, '{axis}', value) on a "
                "part of the border"
            )
        return self._add(place, place, what, axis, value, amplitude, velocity, {})

    def _add(
        self,
        place: Place,
        given: str | tuple[float, float],
        what: str,
        axis: int | str,
        value: Profile,
        amplitude: InTime | None,
        velocity: InTime | None,
        whole: Mapping[Edge, Mask],
    ) -> Support:
        self.activity.check_between_steps(what)
        is_field = axis in self._fields
        if is_field and velocity is not None:
            raise InputError(
                f"{what}: the field '{axis}' with a velocity: expected fix(where, '{axis}', value), "
                "where amplitude=... changes the value in time"
            )
        if velocity is not None:
            if callable(value) or value != 0:
                raise InputError(f"{what}: expected a value or a velocity, not both")
            value = 1.0
        factor = Factor(what, amplitude, velocity, time=self.activity.time)
        unit = self._fields[str(axis)].unit if is_field else "m"
        support = Support(self, place, given, axis, unit, value, factor, whole)
        self.all.append(support)
        if isinstance(place, MovingPoints):
            self.border.parts.append(place)
        return support

    def _component(self, component: str, more: Sequence[str] = ()) -> int | str:
        """Number of a component of the displacement, or one of other names or fields."""
        known = [*self.grid.space.axes, *more, *self._fields]
        if checks.one_of(component, [*more, *self._fields]):
            return component
        if not checks.one_of(component, known):
            raise InputError(
                f"component {checks.shown(component)}: expected one of {quoted(known)}"
            )
        return self.grid.space.axis(component)

    def wall(
        self, edge: Edge, friction: float, separates: bool, make: Callable[[Wall], Obstacle | None]
    ) -> Wall:
        """A wall along an edge.

        Args:
            edge, friction, separates: As in `scene.wall`.
            make: Makes the obstacle that it is; None for a body without a border.
        """
        what = f"wall(edge='{edge}')"
        self.activity.check_between_steps(what)
        self.grid.edge(edge)
        separates = checks.switch(f"{what}: separates", separates)
        mu = checked_friction(what, friction)
        if any(wall.edge == edge for wall in self.walls):
            raise InputError(
                f"wall(edge='{edge}'): there is one already: change(...) or release() it, or "
                f"release('{edge}') first"
            )
        wall = Wall(self.grid, self.basis, edge, mu, separates, self)
        wall.obstacle = make(wall)
        self.walls.append(wall)
        self.changed()
        return wall

    def release(self, place: Edge | Sequence[float], component: str | None) -> None:
        """Take supports away."""
        at = label(place) if isinstance(place, str) else checks.point("release(...)", place)
        axis = None if component is None else self._component(component, LOCAL)
        gone = [
            s
            for s in self.all
            if (at == s.given or (isinstance(s.place, tuple) and at == s.place))
            and axis in (None, s.component)
        ]
        walls = [w for w in self.walls if label(w.edge) == at and axis is None]
        if not gone and not walls:
            places = sorted({f"{s.given}" for s in self.all} | {label(w.edge) for w in self.walls})
            raise InputError(
                f"release({checks.shown(place)}): no such support: expected one of "
                f"{', '.join(places) or 'none'}"
            )
        for support in gone:
            support.release()
        for wall in walls:
            wall.release()

    # -- steps ---------------------------------------------------------------

    def apply(self, now: Moment) -> None:
        """The body is in equilibrium with the supports at this moment."""
        for support in self.all:
            support.apply(now)

    # -- prescribed values in a step -----------------------------------------

    def check_reach(self, before: Domain, after: Domain, excavation: Excavation) -> None:
        """Check that supports still hold something once particles were removed; a call for all ranks.

        Args:
            before, after: The particles before and after.
            excavation: Those that are removed.

        Raises:
            SupportError: One would hold no particles.
        """
        for support in self.all:
            if isinstance(support.place, tuple):
                lost = not is_in_body(after, support.place)
            elif isinstance(support.place, str):
                lost = reach(after, support.place) > max(reach(before, support.place), 0.0)
            else:
                lost = not support.place.remaining(excavation)[0].any()
            if lost:
                raise SupportError(
                    f"{support} {support.axis} would hold no particles after remove(...): expected "
                    "supports on particles that remain; release() it before. Nothing was changed"
                )

    def keep(self, kept: Mapping[MovingPoints, Indices]) -> None:
        """Keep the points of the border that remain, or their parts; see `SceneBorder`."""
        for support in self.all:
            if isinstance(support.place, MovingPoints):
                support.keep(kept[support.place])

    # -- where particles move ------------------------------------------------

    def follow(self, layout: Layout, u: Array, points: Sequence[PointHeld]) -> None:
        """Move the points with the body; a call for all ranks.

        Args:
            layout: Places of the coefficients.
            u: Increments of the displacement, functions x dim.
            points: The constraints of the step, in the order of the supports.
        """
        for support, point in zip(self.at_points, points, strict=True):
            moved = layout.vectors_at(u, point.indices // self.grid.space.dim)
            x, y = point.place + point.weights @ moved
            support.place = (float(x), float(y))

    @property
    def edges_with_walls(self) -> set[Edge]:
        """The edges with walls."""
        return {wall.edge for wall in self.walls}

    @property
    def at_points(self) -> list[Support]:
        """The supports that hold a point."""
        return [s for s in self.all if isinstance(s.place, tuple)]

    @property
    def names(self) -> dict[str, set[Edge]]:
        """Parts of the border with supports, each with the edges of the grid that it is held on."""
        found = dict[str, set[Edge]]()
        for support in self.all:
            for name, edges_held in support.names.items():
                found.setdefault(name, set()).update(edges_held)
        return found

    @property
    def tractions(self) -> list[tuple[MovingPoints, Array]]:
        """Points of each support of the displacement on patches, and the tractions that held them [Pa],
        points x dim.
        """
        return [
            (s.place, -s.held[:, None] * s.directions(s.place.normal))
            for s in self.all
            if isinstance(s.place, MovingPoints) and not s.is_field
        ]

    @property
    def supported_edges(self) -> set[str]:
        """Names of the edges of the grid that supports or walls act on."""
        edges_held = {edge for support in self.all for edge in support.edges}
        return edges_held | self.edges_with_walls

    # -- header, identity, checkpoints ---------------------------------------

    @property
    def line(self) -> str:
        """The supports in words, for the header of a run."""
        given = [support.line for support in self.all]
        axis = [f"axis of symmetry ({support.axis} = 0)" for support in self.axis]
        return listed([*given, *axis, *map(str, self.walls)])

    def identity(self) -> list[list[Any]]:
        """Facts that decide the results of a run, in the types of JSON."""
        given = [[str(s.given), s.component, *s.identity()] for s in self.all]
        return given + [["wall", w.edge, w.friction, w.separates] for w in self.walls]

    def state(self) -> dict[str, Any]:
        """Positions of points, the share of each support that the body carries, and contact states."""
        return {
            "supports": [support.state() for support in self.all],
            "walls": [wall.stored() for wall in self.walls],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, for the same supports.

        Raises:
            CheckpointError: The script has made others.
        """
        stored.check_count(
            "walls", len(state["walls"]), len(self.walls),
            "walls to be added and released between two phases",
        )  # fmt: skip
        self.all = restored("support", self.all, state["supports"])
        for wall, values in zip(self.walls, state["walls"], strict=True):
            wall.restore(values)
        self.changed()
