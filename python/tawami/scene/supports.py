"""Supports of a scene: displacements prescribed along edges and at points, and walls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import CheckpointError, InputError, SupportError
from tawami.base.identity import text
from tawami.base.text import listed, quoted
from tawami.field.constraints import Held, PointHeld
from tawami.field.reduction import Reduction
from tawami.form.fields import Field
from tawami.grid import edges
from tawami.grid.basis import Basis
from tawami.grid.edges import Interval, Profile
from tawami.grid.grid import Edge, Grid
from tawami.scene import step_values
from tawami.scene.action import Owner, Term, restored
from tawami.scene.activity import Activity
from tawami.scene.contact import ActiveSet
from tawami.scene.domain import Domain
from tawami.scene.factor import Factor, InTime
from tawami.scene.points import is_in_body
from tawami.scene.share import Moment
from tawami.scene.support import Place, Support
from tawami.scene.walls import Wall, checked_friction

Array = npt.NDArray[np.float64]


class Supports(Owner[Support]):
    """The supports of one scene.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        fields: The fields without a role.
        activity: Time and activity of the scene.

    Attributes:
        all: The supports along edges and at points.
        walls: The walls.
        axis: In axisymmetry, u_x = 0 along the axis if it is an edge of the grid; else none.
        version: A number that changes with every change of a support or wall by the driver script.
    """

    def __init__(
        self, grid: Grid, basis: Basis, fields: Mapping[str, Field], activity: Activity
    ) -> None:
        super().__init__(activity)
        self.grid, self.basis, self._fields = grid, basis, fields
        self.walls: list[Wall] = []
        self.axis: list[Support] = []
        if grid.on_axis:
            zero = Factor("the axis")
            self.axis.append(Support(self, "left", 0, "x", 0.0, zero))

    def remove(self, action: Support | Wall) -> None:
        """Remove a support or a wall."""
        self.walls = [wall for wall in self.walls if wall is not action]
        super().remove(action)

    def fix(
        self,
        edge: Edge,
        component: str,
        value: Profile,
        amplitude: InTime | None,
        velocity: InTime | None,
        between: Interval | None,
    ) -> Support:
        """Prescribe a component along an edge."""
        edges.cells_between(self.grid, edge, between)
        return self._add(
            edge, f"fix(edge='{edge}')", component, value, amplitude, velocity, between
        )

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
        return self._add(place, what, component, value, amplitude, velocity, None)

    def _add(
        self,
        place: Place,
        where: str,
        component: str,
        value: Profile,
        amplitude: InTime | None,
        velocity: InTime | None,
        between: Interval | None,
    ) -> Support:
        self.activity.check_between_steps(where)
        axis = self._component(component)
        if isinstance(axis, str) and (velocity is not None or not isinstance(place, str)):
            what = "a velocity" if velocity is not None else "a point"
            raise InputError(
                f"{where}: the field '{axis}' with {what}: expected fix(edge, '{axis}', value), where "
                "amplitude=... changes the value in time"
            )
        if velocity is not None:
            if callable(value) or value != 0:
                raise InputError(f"{where}: expected a value or a velocity, not both")
            value = 1.0
        factor = Factor(where, amplitude, velocity, time=self.activity.time)
        unit = self._fields[axis].unit if isinstance(axis, str) else "m"
        support = Support(self, place, axis, unit, value, factor, between)
        self.all.append(support)
        return support

    def _component(self, component: str) -> int | str:
        """Number of a component of the displacement, or name of a field."""
        if self._fields and checks.one_of(component, self._fields):
            return component
        if self._fields and not checks.one_of(component, self.grid.space.axes):
            known = quoted([*self.grid.space.axes, *self._fields])
            raise InputError(f"component {checks.shown(component)}: expected one of {known}")
        return self.grid.space.axis(component)

    def wall(self, edge: Edge, friction: float, separates: bool) -> Wall:
        """A wall along an edge."""
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
        self.walls.append(wall)
        self.changed()
        return wall

    def release(self, place: Edge | Sequence[float], component: str | None) -> None:
        """Take supports away."""
        at = place if isinstance(place, str) else checks.point("release(...)", place)
        axis = None if component is None else self._component(component)
        gone = [s for s in self.all if at in (s.place, s.given) and axis in (None, s.component)]
        walls = [w for w in self.walls if w.edge == at and axis is None]
        if not gone and not walls:
            places = sorted({f"{s.place}" for s in self.all} | {w.edge for w in self.walls})
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

    def constraints(
        self,
        domain: Domain,
        amount: Callable[[Term], float],
        start: Array,
        before: Array,
        *,
        moving: bool,
        fields: step_values.Fields | None = None,
    ) -> tuple[Reduction, ActiveSet]:
        """Unknowns that the supports leave free, and the walls in their present states.

        Args:
            domain: The particles where they are.
            amount: Factor of each value of a support.
            start: Coefficients at the start of the step, which the amounts include.
            before: Displacement coefficients since the start of the scene where particles do not move,
                0 where they do. Walls measure distances from it.
            moving: Inertia or stress holds the body: rigid motions may be free, and edges that are
                held at rest and that the body has left are skipped.

            fields: Fields without a role and what is prescribed for them; they stay by default.

        Raises:
            SupportError: The body has left an edge with a prescribed motion, or a point.
        """
        layout, held, points = domain.layout, list[Held](), list[PointHeld]()
        for support in [*self.all, *self.axis]:
            if isinstance(support.component, str):
                if moving and step_values.is_left(domain, support):
                    continue
                held.append(step_values.of_field(domain, support, start, fields))
            elif isinstance(support.place, str):
                may_be_left = support in self.axis or (moving and not support.moves)
                if not (may_be_left and step_values.is_left(domain, support)):
                    held.append(step_values.on_edge(domain, support, amount))
            else:
                points.append(step_values.at_point(domain, support, amount))
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
        held_by_form = moving or domain.model.compiled.may_hold
        return Reduction(layout, held, points, start, moving=held_by_form), contact

    def check_reach(self, before: Domain, after: Domain) -> None:
        """Check that supports still hold something once particles were removed; a call for all ranks.

        Args:
            before, after: The particles before and after.

        Raises:
            SupportError: One would hold no particles.
        """
        for support in self.all:
            if isinstance(support.place, str):
                lost = step_values.is_left(after, support) and not step_values.is_left(
                    before, support
                )
            else:
                lost = not is_in_body(after, support.place)
            if lost:
                raise SupportError(
                    f"{support} {support.axis} would hold no particles after remove(...): expected "
                    "supports on particles that remain; release() it before. Nothing was changed"
                )

    def num_free(self, domain: Domain) -> int:
        """Number of unknowns that the supports leave."""
        zero = np.zeros(domain.layout.size)
        return self.constraints(domain, lambda _: 0.0, zero, zero, moving=True)[0].size

    # -- where particles move ------------------------------------------------

    def crossings(self, amount: Callable[[Term], float]) -> dict[int, float]:
        """Distance by which each support will have moved the body across its edge [m], by its number.

        The functions of the edge do not move and would soon hold no particles.

        Raises:
            InputError: More than a quarter of a cell.
        """
        crossings = {}
        for number, support in enumerate(self.all):
            if (
                isinstance(support.place, str)
                and self.grid.edge(support.place)[0] == support.component
            ):
                crossings[number] = support.crossing + step_values.total(support, amount)
                profiled = any(callable(term.values[0]) for term in support.terms)
                if abs(crossings[number]) > 0.25 * self.grid.h and not profiled:
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
        given = [support.line for support in self.all]
        axis = [f"axis of symmetry ({support.axis} = 0)" for support in self.axis]
        return listed([*given, *axis, *map(str, self.walls)])

    def identity(self) -> list[list[Any]]:
        """Facts that decide the results of a run, in the types of JSON."""
        given = [[str(s.given), s.component, text(s.between), *s.identity()] for s in self.all]
        return given + [["wall", w.edge, w.friction, w.separates] for w in self.walls]

    def state(self) -> dict[str, Any]:
        """Positions of points, the share of each support that the body carries, and contact states."""
        return {
            "supports": [
                support.state() | {"place": support.place, "crossing": support.crossing}
                for support in self.all
            ],
            "walls": [wall.stored() for wall in self.walls],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, for the same supports.

        Raises:
            CheckpointError: The script has made others.
        """
        if len(state["walls"]) != len(self.walls):
            raise CheckpointError(
                f"the run had {len(state['walls'])} walls when it was stored, and the script made "
                f"{len(self.walls)}: expected walls to be added and released between two phases"
            )
        self.all = restored("support", self.all, state["supports"])
        for support, values in zip(self.all, state["supports"], strict=True):
            if not isinstance(support.place, str):
                x, y = values["place"]
                support.place = (x, y)
            support.crossing = values["crossing"]
        for wall, values in zip(self.walls, state["walls"], strict=True):
            wall.restore(values)
        self.changed()
