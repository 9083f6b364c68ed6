"""The rigid obstacles of a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.base.text import listed, position
from tawami.border.patches import Patches
from tawami.border.shapes import Function, Shape
from tawami.conditions import obstacle_inputs as inputs
from tawami.conditions.action import Owner, restored
from tawami.conditions.activity import Activity
from tawami.conditions.depth import warn_of_deep, warn_of_small
from tawami.conditions.factor import Factor, InTime
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.obstacle_contact import ObstacleContact
from tawami.conditions.obstacle_motion import Times
from tawami.conditions.share import Moment
from tawami.domain.border import Part, SceneBorder, label
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints

#: Depth in the body at which an obstacle may begin [cells].
OVERLAP = 0.1


class Obstacles(Owner[Obstacle]):
    """The obstacles of one scene.

    Args:
        border: The border of the body.
        activity: Time and activity of the scene.
    """

    def __init__(self, border: SceneBorder, activity: Activity) -> None:
        super().__init__(activity)
        self._border, self._deep = border, set[Obstacle]()

    def add(
        self,
        domain: Domain,
        total: Array,
        shape: Any,
        friction: float,
        where: Part | None,
        *,
        name: str | None,
        displacement: Any,
        amplitude: InTime | None,
        velocity: Any,
        free: Any,
        force: Any,
        mass: Any,
        inertia: Any,
        separates: bool = True,
    ) -> Obstacle:
        """Put an obstacle into the scene.

        Args:
            domain: The particles.
            total: Displacement coefficients since the start where particles do not move, else 0.
            shape, friction, where, name, displacement, amplitude, velocity, free, force, mass, inertia:
                As in `scene.obstacle`.
            separates: As in `scene.wall`.
        """
        space, h = domain.model.space, domain.model.grid.h
        name = self._name(name)
        what = f"obstacle '{name}'"
        self.activity.check_between_steps(what)
        mu = inputs.checked_friction(what, friction)
        made = inputs.shape_of(what, shape, space, h)
        given = "the border" if where is None else label(where)
        part = self._border.part(
            what, list(self._border.names) if where is None else where, joined=True
        )
        moves = inputs.free_of(what, free, space, force is not None or mass is not None)
        masses = inputs.masses_of(what, mass, inertia, space)
        by = inputs.components(f"{what}: displacement", displacement, space)
        forces = inputs.components(f"{what}: force", force, space)
        inputs.check_fit(what, np.array(by), np.array(forces), moves, inputs.motions_of(space))
        factor = Factor(what, amplitude, time=self.activity.time)
        speeds = inputs.speeds_of(what, velocity, space, self.activity.time)
        inputs.check_motions(what, space, speeds, moves, np.array(by), np.array(forces))
        _check_place(what, made, part, domain, total)
        warn_of_small(what, made, domain.model.grid)
        obstacle = Obstacle(
            self, part, given, name, made, mu, moves, masses, np.where(moves, forces, by), factor,
            speeds, separates,
        )  # fmt: skip
        self.all.append(obstacle)
        self._border.parts.append(part)
        self.changed()
        return obstacle

    def _name(self, name: Any) -> str:
        known = [one.name for one in self.all]
        if name is None:
            return f"obstacle {self._made + 1}"
        if not isinstance(name, str) or not name or name in known:
            raise InputError(
                f"obstacle: name = {checks.shown(name)}: expected a text that no other obstacle has"
            )
        return name

    def in_step(
        self,
        domain: Domain,
        before: Array,
        now: Moment,
        gravity: Array,
        times: Times | None = None,
        *,
        begins: bool = False,
    ) -> list[ObstacleContact]:
        """Contact with each obstacle in a step.

        Args:
            domain: The particles at its start.
            before: Displacement coefficients since the start where particles do not move, else 0.
            now: The end of the step.
            gravity: Acceleration of weights [m/s2].
            times: The step in dynamics.
            begins: Accelerations belong to other loads.
        """
        found = []
        for obstacle in self.all:
            motion = obstacle.motion(now, gravity, times)
            contact = ObstacleContact(domain, obstacle, motion, before)
            if begins and motion.free.any():
                forces, free = motion.force + contact.at_start[1], motion.free
                zero = np.zeros_like(forces)
                a = np.divide(forces, motion.mass, out=zero, where=free)
                motion.rates = motion.rates[0], a
            found.append(contact)
        return found

    def keep(self, kept: Mapping[MovingPoints, Indices]) -> None:
        """Keep the points of the border that remain, or their parts; see `SceneBorder`."""
        for obstacle in self.all:
            of, groups = kept[obstacle.place], obstacle.groups
            obstacle.pressure, obstacle.traction = obstacle.pressure[of], obstacle.traction[of]
            obstacle.offset = obstacle.offset[of]
            if groups is not None:
                whole = len(np.unique(of)) == len(groups.number)
                obstacle.groups = Patches(groups.number[of], groups.count) if whole else None

    def apply(self, now: Moment) -> None:
        """The body is in equilibrium with the obstacles at this moment."""
        for obstacle in self.all:
            obstacle.apply(now)

    def warn(self, domain: Domain, coefficients: Array) -> None:
        """Warn, once for each obstacle, of particles deep inside it after a step; a call for all ranks.

        Args:
            domain: The particles.
            coefficients: Of all fields since the start, where particles do not move.
        """
        model, n, border = domain.model, domain.layout.num_displacement, self._border.points
        if border is None:
            return
        u = None if model.moves else model.space.vectors(coefficients[:n])
        new = [obstacle for obstacle in self.all if obstacle not in self._deep]
        self._deep.update(one for one in new if warn_of_deep(one, domain, border, u))

    @property
    def kinetic(self) -> float:
        """Kinetic energy of free obstacles [J per metre depth]."""
        return sum(obstacle.kinetic_energy for obstacle in self.all)

    @property
    def line(self) -> str:
        """The obstacles in words, for the header of a run."""
        return listed([obstacle.line for obstacle in self.all])

    def identity(self) -> list[Any]:
        """Facts that decide the results of a run, in the types of JSON."""
        return [obstacle.identity() for obstacle in self.all]

    def state(self) -> list[dict[str, Any]]:
        """State of each obstacle, for a checkpoint."""
        return [obstacle.state() for obstacle in self.all]

    def restore(self, state: Sequence[Mapping[str, Any]]) -> None:
        """The reverse of :meth:`state`, for the same obstacles.

        Raises:
            CheckpointError: The script has made others.
        """
        self.all = restored("obstacle", self.all, state)
        self.changed()


def _check_place(
    what: str, shape: Shape, place: MovingPoints, domain: Domain, total: Array
) -> None:
    """Check that an obstacle does not overlap the body, and that its distance is one.

    Raises:
        InputError: It does, or a function that gives it is no distance at the border.
    """
    layout, h = domain.layout, domain.model.grid.h
    u = domain.model.space.vectors(total[: layout.num_displacement])
    x = place.x + place.cells(domain).at(layout.basis, u)
    if isinstance(shape, Function):
        shape.check(x)
    distance = shape.evaluate(x).distance
    worst = int(np.argmin(distance))
    if distance[worst] < -OVERLAP * h:
        raise InputError(
            f"{what}: the body is {-distance[worst]:.3g} m inside it at {position(x[worst])} m: "
            f"expected an obstacle that overlaps the body by at most h/10 = {OVERLAP * h:.3g} m"
        )
