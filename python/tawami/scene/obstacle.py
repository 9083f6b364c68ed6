"""Rigid obstacles of a scene: handles for a driver script, and their state between steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.arrays import Array, Mask
from tawami.base.errors import CheckpointError, InputError
from tawami.base.identity import text
from tawami.base.space import Space
from tawami.base.text import listed, quoted
from tawami.border.rigid import Pose, num_modes
from tawami.border.shapes import Function, Shape
from tawami.scene.action import Action, Owner, Value, restored
from tawami.scene.activity import Activity
from tawami.scene.border import MovingPoints, Part, SceneBorder, label
from tawami.scene.domain import Domain
from tawami.scene.factor import Factor, InTime
from tawami.scene.obstacle_contact import ObstacleContact
from tawami.scene.obstacle_motion import ObstacleMotion, Times
from tawami.scene.share import Moment
from tawami.scene.walls import checked_friction

#: Components of a motion or force: translations, or also the rotations.
Components = Sequence[float]
#: Depth in the body at which an obstacle may begin [cells].
OVERLAP = 0.1


class Obstacle(Action):
    """A rigid obstacle of a scene, as `scene.obstacle` returns it.

    :meth:`change` replaces its motion, force or friction, :meth:`release` takes it away. The values are
    displacements of its prescribed motions, and forces on its free ones.

    Attributes:
        name: Its name.
        shape: Its shape, where it was made.
        place: Points of the border that it may touch.
        friction: Coefficient of friction.
        free: Which of its motions are unknown: translations, then rotations.
        mass: Mass and moments of inertia of its motions [kg per metre depth], [kg m2 per metre depth].
        pose: Where it is.
        rates: Velocity and acceleration of its motions.
        pressure, traction: On the points of `place` at the end of the last step [Pa].
    """

    __slots__ = (
        "_changes", "_speeds", "free", "friction", "given", "mass", "name", "place", "pose",
        "pressure", "rates", "shape", "traction",
    )  # fmt: skip

    def __init__(
        self,
        owner: Obstacles,
        place: MovingPoints,
        given: str,
        name: str,
        shape: Shape,
        friction: float,
        free: Mask,
        mass: Array,
        value: Any,
        factor: Factor,
        speeds: Sequence[Factor],
    ) -> None:
        self.place, self.given, self.name, self.shape = place, given, name, shape
        self.friction, self.free, self.mass = friction, free, mass
        self._speeds, self._changes = list(speeds), 0
        self.pose = Pose.at(shape.centre)
        first = np.array([speed.rates(0.0, 0.0)[0] for speed in speeds])
        self.rates: tuple[Array, Array] = (np.where(free, first, 0.0), np.zeros(len(free)))
        dim = place.space.dim
        self.pressure, self.traction = np.zeros(len(place)), np.zeros((len(place), dim - 1))
        super().__init__(owner, value, factor)

    def __str__(self) -> str:
        return f"obstacle '{self.name}'"

    @property
    def motions(self) -> tuple[str, ...]:
        """Names of its motions."""
        return motions_of(self.place.space)

    @property
    def x(self) -> Array:
        """Present position of its centre [m]."""
        return self.pose.position

    @property
    def rotation(self) -> Array:
        """Angles by which it has turned [rad], one in the plane, counter-clockwise."""
        return self.pose.turn

    @property
    def velocity(self) -> Array:
        """Velocities of its translations [m/s], then of its rotations [rad/s]."""
        return self.rates[0]

    @property
    def kinetic_energy(self) -> float:
        """1/2 m v^2 and 1/2 I w^2 of its free motions [J per metre depth]."""
        return float(0.5 * self.mass[self.free] @ self.rates[0][self.free] ** 2)

    def _checked(self, value: Any) -> tuple[Value, ...]:
        return components(f"{self}: value", value, self.place.space)

    def change(
        self,
        value: Any = None,
        *,
        amplitude: InTime | None = None,
        velocity: Sequence[InTime] | None = None,
        friction: float | None = None,
    ) -> None:
        """Replace displacement and force, the amplitude, the velocity, or the friction.

        Args:
            value: A component for each translation, or also for the rotation: displacement since it
                was made [m], [rad] of a prescribed motion, force [N] or moment [N m] per metre depth of
                a free one.
            amplitude: Factor of the value, a number or a function of time [s].
            velocity: Velocities [m/s], or also the rate of rotation [rad/s]: numbers, or functions of
                time [s]; of a free motion its velocity from now on.
            friction: Coefficient of friction.

        Raises:
            InputError: It was released, nothing is given, or an argument is not valid; nothing has
                changed.
        """
        self._check_usable("change(...)")
        if value is None and amplitude is None and velocity is None and friction is None:
            raise InputError(
                f"{self}.change(): expected a value, an amplitude, a velocity or a friction"
            )
        mu = self.friction if friction is None else checked_friction(f"{self}", friction)
        speeds = None
        if velocity is not None:
            speeds = _speeds(f"{self}", velocity, self.place.space, self._owner.activity.time)
            check_motions(f"{self}", self.place.space, speeds, self.free)
        if value is not None or amplitude is not None:
            super().change(value, amplitude=amplitude)
        self.friction = mu
        if speeds is not None:
            now = self._owner.activity.time
            self._speeds, self._changes = list(speeds), self._changes + 1
            first = np.array([speed.rates(now, now)[0] for speed in speeds])
            self.rates = np.where(self.free, first, self.rates[0]), self.rates[1]
        self._owner.changed()

    @property
    def has_velocity(self) -> bool:
        """Whether a prescribed motion has a velocity."""
        pairs = zip(self._speeds, self.free, strict=True)
        return any(not free and not _rests(speed) for speed, free in pairs)

    @property
    def line(self) -> str:
        """The obstacle in words, for the header of a run."""
        free = [name for name, one in zip(self.motions, self.free, strict=True) if one]
        parts = [
            f"{self} ({type(self.shape).__name__.lower()}) on {self.given}",
            f"friction {self.friction:g}",
        ]
        if free:
            parts.append(f"free in {quoted(free)}")
        if self.has_velocity:
            parts.append("with a velocity")
        return ", ".join(parts)

    # -- steps ---------------------------------------------------------------

    def motion(self, now: Moment, gravity: Array, times: Times | None) -> ObstacleMotion:
        """Its motion in a step.

        Args:
            now: The end of the step.
            gravity: Acceleration of weights [m/s2].
            times: The step in dynamics.
        """
        change, force = np.zeros(len(self.free)), np.zeros(len(self.free))
        for term in self.terms:
            values = np.array(term.values, dtype=float)
            force += values * term.at(now)
            amount = term.at(now) - term.share.applied
            change += values * (amount if times is None else term.changed(now))
        if times is not None:
            change += [speed.changed(now.start, now.time) for speed in self._speeds]
        dim = len(gravity)
        force[:dim] += self.mass[:dim] * gravity
        return ObstacleMotion(
            self.pose, np.where(self.free, 0.0, change), self.free, force, self.mass, self.rates,
            times,
        )  # fmt: skip

    def is_ahead(self, now: Moment) -> bool:
        """Whether it has a displacement to come, which statics would take it to."""
        fixed = ~self.free
        missing = [
            np.array(t.values, dtype=float)[fixed] * (t.at(now) - t.share.applied)
            for t in self.terms
        ]
        return bool(np.abs(sum(missing, np.zeros(fixed.sum()))).max(initial=0.0) > 1e-12)

    # -- identity, checkpoints -----------------------------------------------

    def identity(self) -> list[Any]:
        """Facts that decide the results of a run, in the types of JSON."""
        return [
            self.name, self.given, _facts(self.shape), self.friction, self.free.tolist(),
            self.mass.tolist(), [speed.identity() for speed in self._speeds], *super().identity(),
        ]  # fmt: skip

    def state(self) -> dict[str, Any]:
        """Pose, velocity, pressures, and the share of its values that it has."""
        return super().state() | {
            "pose": self.pose.coordinates, "rates": list(self.rates), "pressure": self.pressure,
            "traction": self.traction, "friction": self.friction, "changes": self._changes,
            "speeds": [[speed.rates(0.0, 0.0)[0]] if _rests(speed) or not speed.is_function else []
                       for speed in self._speeds],
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: It got a velocity that is a function during the run.
        """
        super().restore(state)
        if state["changes"] != self._changes:
            if not all(state["speeds"]):
                raise CheckpointError(
                    f"{self} got another velocity during the run (each=): expected functions of time to "
                    "be given between two phases"
                )
            self._speeds = [Factor(f"{self}", None, one) for (one,) in state["speeds"]]
            self._changes = state["changes"]
        self.pose = Pose.at(self.shape.centre).moved(np.asarray(state["pose"]))
        self.rates = np.asarray(state["rates"][0]), np.asarray(state["rates"][1])
        self.pressure, self.traction = state["pressure"], state["traction"]
        self.friction = state["friction"]


class Obstacles(Owner[Obstacle]):
    """The obstacles of one scene.

    Args:
        border: The border of the body.
        activity: Time and activity of the scene.
    """

    def __init__(self, border: SceneBorder, activity: Activity) -> None:
        super().__init__(activity)
        self._border = border

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
    ) -> Obstacle:
        """Put an obstacle into the scene.

        Args:
            domain: The particles.
            total: Displacement coefficients since the start where particles do not move, else 0.
            shape, friction, where, name, displacement, amplitude, velocity, free, force, mass, inertia:
                As in `scene.obstacle`.
        """
        space, h = domain.model.space, domain.model.grid.h
        name = self._name(name)
        what = f"obstacle '{name}'"
        self.activity.check_between_steps(what)
        mu = checked_friction(what, friction)
        made = _shape(what, shape, space, h)
        given = "the border" if where is None else label(where)
        part = self._border.part(what, list(self._border.names) if where is None else where)
        moves = _free(what, free, space, force is not None or mass is not None)
        masses = _masses(what, mass, inertia, space)
        by = components(f"{what}: displacement", displacement, space)
        forces = components(f"{what}: force", force, space)
        _check_fit(what, np.array(by), np.array(forces), moves, motions_of(space))
        factor = Factor(what, amplitude, time=self.activity.time)
        speeds = _speeds(what, velocity, space, self.activity.time)
        check_motions(what, space, speeds, moves, np.array(by), np.array(forces))
        obstacle = Obstacle(
            self, part, given, name, made, mu, moves, masses, np.where(moves, forces, by), factor,
            speeds,
        )  # fmt: skip
        try:
            _check_overlap(obstacle, domain, total)
        except InputError:
            self._border.parts.remove(part)
            raise
        self.all.append(obstacle)
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

    def apply(self, now: Moment) -> None:
        """The body is in equilibrium with the obstacles at this moment."""
        for obstacle in self.all:
            obstacle.apply(now)

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


def motions_of(space: Space) -> tuple[str, ...]:
    """Names of the rigid motions: translations, then rotations."""
    rotations = num_modes(space.dim) - space.dim
    names = ["rotation"] if rotations == 1 else [f"rotation {k + 1}" for k in range(rotations)]
    return (*space.axes, *names)


def components(what: str, value: Any, space: Space) -> tuple[float, ...]:
    """One number for each motion, from those of the translations or of all.

    Raises:
        InputError: Not as many finite numbers.
    """
    num, names = num_modes(space.dim), motions_of(space)
    if value is None:
        return (0.0,) * num
    given = list(value) if isinstance(value, Sequence | np.ndarray) else []
    if isinstance(value, str) or len(given) not in (space.dim, num):
        raise InputError(
            f"{what} = {checks.shown(value)}: expected {space.dim} or {num} numbers, for "
            f"{', '.join(names)}"
        )
    given += [0.0] * (num - len(given))
    return tuple(checks.number(f"{what}: {n}", v) for n, v in zip(names, given, strict=True))


def _speeds(what: str, velocity: Any, space: Space, time: float) -> list[Factor]:
    """Factors of the velocities of all motions."""
    num, names = num_modes(space.dim), motions_of(space)
    given = [0.0] * num if velocity is None else velocity
    if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray):
        given = []
    if len(given) not in (space.dim, num):
        raise InputError(
            f"{what}: velocity = {checks.shown(velocity)}: expected {space.dim} or {num} numbers or "
            f"functions of time, for {', '.join(names)}"
        )
    given = [*given, *[0.0] * (num - len(given))]
    return [
        Factor(f"{what}: velocity of '{n}'", None, v, name="", time=time)
        for n, v in zip(names, given, strict=True)
    ]


def check_motions(
    what: str, space: Space, speeds: Sequence[Factor], free: Mask, *values: Array
) -> None:
    """Check that velocities fit free motions, and that motions fit axisymmetry.

    Raises:
        InputError: They do not.
    """
    for speed, name, one in zip(speeds, motions_of(space), free, strict=True):
        if one and speed.is_function:
            raise InputError(
                f"{what}: velocity of '{name}', which is free: expected a number, its velocity at first"
            )
    if not space.hoop:
        return
    along = np.array([name == space.axes[1] for name in motions_of(space)])
    moving = free | ~np.array([_rests(speed) for speed in speeds])
    for value in values:
        moving = moving | (value != 0)
    if (moving & ~along).any():
        raise InputError(
            f"{what}: in axisymmetry an obstacle moves along the axis only: expected motions and "
            f"forces in '{space.axes[1]}', as free='{space.axes[1]}'"
        )


def _rests(speed: Factor) -> bool:
    return not speed.is_function and speed.rates(0.0, 0.0)[0] == 0


def _free(what: str, free: Any, space: Space, wanted: bool) -> Mask:
    """Mask of the free motions."""
    names = motions_of(space)
    if free is None:
        default = np.full(len(names), wanted)
        along = np.array([not space.hoop or n == space.axes[1] for n in names])
        return np.asarray(default & along)
    given = [free] if isinstance(free, str) else list(free)
    known = checks.names(f"{what}: free", given, names)
    return np.array([name in known for name in names])


def _masses(what: str, mass: Any, inertia: Any, space: Space) -> Array:
    """Masses of all motions; 0 where none is given."""
    m = 0.0 if mass is None else checks.number(f"{what}: mass", mass, low=checks.LEAST)
    turning = 0.0
    if inertia is not None:
        turning = checks.number(f"{what}: inertia", inertia, low=checks.LEAST)
    dim = space.dim
    return np.array([m] * dim + [turning] * (num_modes(dim) - dim))


def _check_fit(what: str, by: Array, forces: Array, free: Mask, names: Sequence[str]) -> None:
    for k, name in enumerate(names):
        if free[k] and by[k]:
            raise InputError(
                f"{what}: displacement of '{name}', which is free: expected a force, or free=... "
                "without this motion"
            )
        if not free[k] and forces[k]:
            raise InputError(
                f"{what}: force on '{name}', which is prescribed: expected free=... with this motion"
            )


def _shape(what: str, shape: Any, space: Space, h: float) -> Shape:
    """A shape, or that of a distance function."""
    if hasattr(shape, "evaluate") and hasattr(shape, "centre"):
        made: Shape = shape
        if len(made.centre) != space.dim:
            raise InputError(
                f"{what}: a shape of {len(made.centre)} coordinates: expected {space.dim}"
            )
        return made
    if callable(shape):
        return Function(shape, 1e-4 * h, np.zeros(space.dim))
    raise InputError(
        f"{what}: shape = {checks.shown(shape)}: expected tawami.half_plane(...), "
        "tawami.rigid_disc(...), tawami.rigid_polygon(...), or a function f(x, y), the distance [m]"
    )


def _facts(shape: Shape) -> list[Any]:
    """A shape in the types of JSON."""
    facts: list[Any] = [type(shape).__name__]
    for value in vars(shape).values():
        facts.append(text(value) if callable(value) else np.asarray(value).tolist())
    return facts


def _check_overlap(obstacle: Obstacle, domain: Domain, total: Array) -> None:
    """Check that an obstacle does not overlap the body.

    Raises:
        InputError: It does.
    """
    place, layout, h = obstacle.place, domain.layout, domain.model.grid.h
    u = domain.model.space.vectors(total[: layout.num_displacement])
    x = place.x + place.cells(domain).values(layout.basis) @ u
    distance = obstacle.shape.evaluate(x).distance
    worst = int(np.argmin(distance))
    if distance[worst] < -OVERLAP * h:
        at = ", ".join(f"{c:g}" for c in x[worst])
        raise InputError(
            f"{obstacle}: the body is {-distance[worst]:.3g} m inside it at ({at}) m: expected an "
            f"obstacle that overlaps the body by at most h/10 = {OVERLAP * h:.3g} m"
        )
