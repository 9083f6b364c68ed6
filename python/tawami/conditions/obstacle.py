"""A rigid obstacle of a scene: its handle in a driver script, and its state between steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tawami.base import stored
from tawami.base.arrays import Array, Mask
from tawami.base.errors import CheckpointError, InputError
from tawami.base.text import quoted
from tawami.border.patches import Patches
from tawami.border.rigid import Pose
from tawami.border.shapes import Shape
from tawami.conditions.action import Action, Owner, Value
from tawami.conditions.factor import Factor, InTime
from tawami.conditions.obstacle_inputs import (
    check_motions,
    checked_friction,
    components,
    facts_of,
    motions_of,
    rests,
    speeds_of,
)
from tawami.conditions.obstacle_motion import ObstacleMotion, Times
from tawami.conditions.share import Moment
from tawami.domain.moving_points import MovingPoints


class Obstacle(Action):
    """A rigid obstacle of a scene, as `scene.obstacle` returns it.

    :meth:`change` replaces its motion, force or friction, :meth:`release` takes it away. The values are
    displacements of its prescribed motions, and forces on its free ones.

    Attributes:
        name: Its name.
        shape: Its shape, where it was made.
        place: Points of the border that it may touch.
        friction: Coefficient of friction.
        separates: Whether the body may leave it.
        free: Which of its motions are unknown: translations, then rotations.
        mass: Mass and moments of inertia of its motions [kg per metre depth], [kg m2 per metre depth].
        pose: Where it is.
        rates: Velocity and acceleration of its motions.
        groups: Patches of these points in the last step.
        pressure, traction: On the points of `place` at the end of the last step [Pa].
    """

    __slots__ = (
        "_changes",
        "_speeds",
        "free",
        "friction",
        "given",
        "groups",
        "mass",
        "name",
        "offset",
        "place",
        "pose",
        "pressure",
        "rates",
        "separates",
        "shape",
        "traction",
    )  # fmt: skip

    def __init__(
        self,
        owner: Owner[Any],
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
        separates: bool = True,
    ) -> None:
        self.place, self.given, self.name, self.shape = place, given, name, shape
        self.friction, self.free, self.mass = friction, free, mass
        self.separates = separates
        self._speeds, self._changes = list(speeds), 0
        self.pose = Pose.at(shape.centre)
        self.groups: Patches | None = None
        first = np.array([speed.rates(0.0, 0.0)[0] for speed in speeds])
        self.rates: tuple[Array, Array] = (np.where(free, first, 0.0), np.zeros(len(free)))
        dim = place.space.dim
        self.pressure, self.traction = np.zeros(len(place)), np.zeros((len(place), dim - 1))
        self.offset = np.zeros(len(place))
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
            speeds = speeds_of(f"{self}", velocity, self.place.space, self._owner.activity.time)
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
        return any(not free and not rests(speed) for speed, free in pairs)

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
            self.name, self.given, facts_of(self.shape), self.friction, self.free.tolist(),
            self.mass.tolist(), [speed.identity() for speed in self._speeds], *super().identity(),
        ]  # fmt: skip

    def state(self) -> dict[str, Any]:
        """Pose, velocity, pressures, and the share of its values that it has."""
        return super().state() | {
            "pose": np.array(self.pose.coordinates), "rates": [*map(np.array, self.rates)],
            "pressure": np.array(self.pressure), "traction": np.array(self.traction),
            "offset": np.array(self.offset),
            "groups": np.zeros(0, dtype=np.int64) if self.groups is None
            else np.array(self.groups.number),
            "friction": self.friction, "changes": self._changes,
            "speeds": [[speed.rates(0.0, 0.0)[0]] if rests(speed) or not speed.is_function else []
                       for speed in self._speeds],
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: It got a velocity that is a function during the run, or has other arrays.
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
        n, dim, motions = len(self.place), self.place.space.dim, (len(self.free),)
        pose = stored.values(f"{self}: pose", state["pose"], motions)
        first, last = (stored.values(f"{self}: rates", one, motions) for one in state["rates"])
        pressure = stored.values(f"{self}: pressure", state["pressure"], (n,))
        traction = stored.values(f"{self}: traction", state["traction"], (n, dim - 1))
        offset = stored.values(f"{self}: offset", state["offset"], (n,))
        groups = None
        if np.size(state["groups"]):
            number = stored.numbers(f"{self}: patches", state["groups"], n, n)
            groups = Patches(number, int(number.max()) + 1)
            if not np.bincount(number).all():
                raise CheckpointError(
                    f"{self}: patches in the checkpoint have no points: expected one at least in each"
                )
        self.pose, self.rates = Pose.at(self.shape.centre).moved(pose), (first, last)
        self.pressure, self.traction, self.groups = pressure, traction, groups
        self.offset = offset
        self.friction = checked_friction(f"{self}", state["friction"])
