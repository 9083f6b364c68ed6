"""Supports and loads of a scene, as a driver script makes them; each call returns a handle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.text import quoted
from tawami.border.shapes import Shape
from tawami.conditions.factor import InTime
from tawami.conditions.load import Load, Pressure, Traction
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.support import Support
from tawami.conditions.walls import Wall
from tawami.domain.border import Part, label
from tawami.domain.points import check_in_body
from tawami.domain.selection import Where
from tawami.grid.edges import Profile
from tawami.grid.grid import Edge
from tawami.step import wall_gap
from tawami.step.configuration import Configuration


class Conditions:
    """Supports and loads of a scene.

    Loads add up, also those of several calls of one method. Supports must agree where they meet; if not,
    the next step raises an error that names both. The methods return handles, which can be changed and
    released: `load = scene.traction(...)`, then `load.change(...)`, `load.release()`.

    `amplitude` is a factor of the value, a number or a function of time [s]. In `Dynamics` time is that
    of the motion. In statics it is that of the scene, which is 0 at first and passes in
    `ramp(..., until=...)` and `solve(until=...)`.
    """

    configuration: Configuration

    def fix(
        self,
        where: Part,
        component: str,
        value: Profile = 0.0,
        *,
        amplitude: InTime | None = None,
        velocity: InTime | None = None,
    ) -> Support:
        """Prescribe a displacement component, or another field of the form, on a part of the border.

        Where the border lies on an edge of the grid as far as the body touches it, the coefficients of
        the grid there are prescribed, which is exact. Elsewhere means over patches of the border, about
        as long as a cell, are held by tractions, so that the border may lie anywhere in the cells and
        move. A call for all ranks.

        Args:
            where: The part: a name or names of the border (`scene.border.names`; 'left', 'right',
                'bottom' and 'top' are also parts on the edges of the grid), a function f(x, y) on arrays
                that returns a mask, or a mask of the points `scene.border.x`. The part moves with the
                body.
            component: 'x' or 'y', 'normal' (outward) or 'tangent' (counter-clockwise), or the name of a
                field without a role, as 'p_w'. The value is then that of the field, in its unit.
            value: Displacement [m] from now on (at small strain from the start of the scene): a
                number, or a function f(x, y) on arrays.
            amplitude: Factor of the value, a number or a function of time [s].
            velocity: For `Dynamics`, in place of a value: a number [m/s], or a function of time [s].

        Raises:
            InputError: A body without a border, a part that it does not have, an unknown component, or
                an amplitude or velocity that is not a finite number at the present time.
            SupportError: The particles of a body without a border do not reach the edge of the grid.
        """
        now = self.configuration
        return now.supports.fix(now.domain, where, component, value, amplitude, velocity)

    def hold(
        self,
        point: Sequence[float],
        component: str,
        value: float = 0.0,
        *,
        amplitude: InTime | None = None,
        velocity: InTime | None = None,
    ) -> Support:
        """Prescribe a displacement component at a point of the body: a constraint on the interpolated
        value. Where particles move the point moves with them. A call for all ranks.

        Args:
            point: Position (x, y) [m].
            component: 'x' or 'y'.
            value: Displacement [m], as in `fix`.
            amplitude, velocity: As in `fix`.

        Raises:
            InputError: A point outside the grid or the body, an unknown component, or as `fix`.
        """
        check_in_body(self.configuration.domain, point, f"hold(point={checks.shown(point)})")
        return self.configuration.supports.hold(point, component, value, amplitude, velocity)

    def wall(self, edge: Edge, friction: float = 0.0, *, separates: bool = True) -> Wall:
        """Put a wall with Coulomb friction along an edge of the grid: the half-plane behind the edge.

        Contact is that of an obstacle (:meth:`obstacle`): it starts where the border comes to the edge.
        For bodies without a border the wall holds functions of the grid, which reach up to a cell far.
        A call for all ranks.

        Args:
            edge: 'left', 'right', 'bottom' or 'top'.
            friction: Coefficient of friction; 0 is smooth, infinity does not slide.
            separates: Whether the body may leave the wall.

        Raises:
            InputError: An unknown edge, a negative friction, or an edge that has a wall already.

        Warns:
            SupportWarning: A body without a border is away from the edge, now or in a step in which the
                wall pushes it.
        """
        now = self.configuration

        def make(wall: Wall) -> Obstacle | None:
            if now.border.points is None:
                wall_gap.warn_of_new(wall, now.domain)
                return None
            return now.obstacles.add(
                now.domain, now.before, wall.half_plane, wall.friction, None, name=wall.name,
                displacement=None, amplitude=None, velocity=None, free=None, force=None, mass=None,
                inertia=None, separates=wall.separates,
            )  # fmt: skip

        return now.supports.wall(edge, friction, separates, make)

    def obstacle(
        self,
        shape: Shape | Callable[..., Any],
        friction: float = 0.0,
        where: Part | None = None,
        *,
        name: str | None = None,
        displacement: Sequence[float] | None = None,
        amplitude: InTime | None = None,
        velocity: Sequence[InTime] | None = None,
        free: str | Sequence[str] | None = None,
        force: Sequence[float] | None = None,
        mass: float | None = None,
        inertia: float | None = None,
    ) -> Obstacle:
        """Put a rigid obstacle with Coulomb friction before the border of the body.

        Contact starts where the border comes to it and ends where it leaves. Pressure and friction act
        on means over patches of the border about as long as a cell. The obstacle rests, moves as
        prescribed, or moves freely under forces and contact. A call for all ranks.

        Args:
            shape: `tawami.half_plane(...)`, `rigid_disc(...)`, `rigid_polygon(...)`, or a function
                f(x, y) on arrays: the distance [m] from it, negative inside.
            friction: Coefficient of friction; 0 is smooth, infinity does not slide.
            where: The part of the border that may touch it, as in `fix`; all of it by default.
            name: Its name for `solution.contact(...)`.
            displacement: Displacement (x, y) [m], or (x, y, rotation) [m, rad], of its prescribed
                motions from now on; in statics the obstacle moves as supports do.
            amplitude: Factor of displacement and force, a number or a function of time [s].
            velocity: For `Dynamics`: (x, y) [m/s] or (x, y, rotation) [m/s, rad/s], numbers or functions
                of time [s]; of a free motion its velocity at first, a number.
            free: Names of the motions that are free: 'x', 'y', 'rotation'. All by default if a force or
                a mass is given, else none.
            force: (x, y) [N per metre depth] or (x, y, moment) on its free motions. In axisymmetry
                [N], along the axis.
            mass: [kg per metre depth], on which gravity acts; `Dynamics` needs it for free motions.
            inertia: Moment of inertia about its centre [kg m2 per metre depth].

        Raises:
            InputError: No shape, an obstacle that overlaps the body by more than h/10, a negative
                friction, a body without a border, a part that it does not have, or an argument that does
                not fit its motions.
        """
        now = self.configuration
        return now.obstacles.add(
            now.domain, now.before, shape, friction, where, name=name, displacement=displacement,
            amplitude=amplitude, velocity=velocity, free=free, force=force, mass=mass,
            inertia=inertia,
        )  # fmt: skip

    def flux(
        self, where: Part, field: str, value: Profile, *, amplitude: InTime | None = None
    ) -> Load:
        """Let a field flow into the body through a part of its border.

        The residual of the field's equation gets - int value r dA, r its test function. Write the
        equation per second, with storage and outflow positive: the flux is then an inflow. If the form
        multiplies the equation by a factor, the flux is wrong by this factor.

        Args:
            where: The part, as in `fix`.
            field: Name of a field of the form without a role, as 'p_w'.
            value: Flux in the unit in which the form writes the equation of the field (with a source s
                in it as - s r, the unit of s times m): a number, or a function f(x, y) on arrays.
            amplitude: Factor of the value, a number or a function of time [s].

        Raises:
            InputError: A body without a border, a part that it does not have, or an unknown field.
        """
        now, given = self.configuration, label(where)
        known = now.model.form.own_fields
        if not checks.one_of(field, known):
            raise InputError(
                f"flux({given}, {checks.shown(field)}, ...): expected a field of the form without "
                f"a role: {quoted(known) or 'it has none'}"
            )
        points = now.border.part(f"flux({given})", where)
        flux = now.loads.add_flux(points, given, field, value, amplitude)
        now.border.parts.append(points)
        return flux

    def release(self, place: Edge | Sequence[float], component: str | None = None) -> None:
        """Remove supports that `fix`, `hold` or `wall` made, as their `release()` does.

        Args:
            place: Name of the part of the border or of the edge, or point (x, y) [m].
            component: 'x' or 'y'; both, and a wall, by default.

        Raises:
            InputError: There is no such support.
        """
        self.configuration.supports.release(place, component)

    def traction(
        self, where: Part, value: tuple[Profile, Profile], *, amplitude: InTime | None = None
    ) -> Load:
        """Load a part of the border with a dead traction: its direction and resultant stay.

        Args:
            where: The part, as in `fix`. It moves with the body.
            value: Traction (t_x, t_y) [Pa] per area of the border when the load is made: numbers, or
                functions f(x, y) on arrays of present positions.
            amplitude: Factor of the value, a number or a function of time [s].

        Raises:
            InputError: A body without a border, a part that it does not have, or an amplitude that is
                not a finite number at the present time.
        """
        return self._on_border(Traction, where, value, amplitude)

    def pressure(self, where: Part, value: Profile, *, amplitude: InTime | None = None) -> Load:
        """Load a part of the border with a pressure against its outward normal.

        At finite strain it follows the border, within a step too: the force is -p n dA on the present
        border.

        Args:
            where: The part, as in `fix`. It moves with the body.
            value: Pressure [Pa]: a number, or a function f(x, y) on arrays of present positions.
            amplitude: Factor of the value, a number or a function of time [s].

        Raises:
            InputError: As `traction`.
        """
        return self._on_border(Pressure, where, value, amplitude)

    def _on_border(
        self,
        kind: type[Traction | Pressure],
        where: Part,
        value: Any,
        amplitude: InTime | None,
    ) -> Load:
        now, given = self.configuration, label(where)
        points = now.border.part(f"{kind.call}({given})", where)
        load = now.loads.add_on_border(kind, points, given, value, amplitude)
        now.border.parts.append(points)
        return load

    def load(
        self,
        particles: Where,
        force: npt.ArrayLike,
        *,
        amplitude: InTime | None = None,
    ) -> Load:
        """Load particles of the body, wherever they move. The direction of the force is fixed. A call
        for all ranks.

        Args:
            particles: A mask of the particles of the body, or their numbers; a function f(x, y) on
                arrays that returns a mask; or the name of a group of the body.
            force: (f_x, f_y) [N per metre depth], shared by the particles by their volumes; or an array
                n x 2 with the force on each of the n particles, in the order of their numbers or as
                these were given.
            amplitude: Factor of the force, a number or a function of time [s].

        Raises:
            InputError: No particle, others than those of the body, another shape of the force, or an
                amplitude that is not a finite number at the present time.
        """
        now = self.configuration
        return now.loads.add_forces(now.domain, particles, force, amplitude)

    def gravity(self, acceleration: Sequence[float], *, amplitude: InTime | None = None) -> Load:
        """Load the body by its weight. As all loads, a second call adds to the first.

        Args:
            acceleration: (b_x, b_y) [m/s2].
            amplitude: Factor of the acceleration, a number or a function of time [s].

        Raises:
            InputError: No density, not two finite numbers, or an amplitude that is not a finite number
                at the present time.
        """
        if self.configuration.model.density is None:
            raise InputError("gravity(...) needs Scene(..., density=...) [kg/m3]")
        return self.configuration.loads.add_gravity(acceleration, amplitude)
