"""Paths of equilibria beyond limit points: the load factor is an unknown (`tawami.solve.path`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from tawami.base import checks, ranks
from tawami.base.arrays import Array
from tawami.base.errors import ConvergenceError, InputError
from tawami.conditions.share import Moment
from tawami.domain.points import check_in_body
from tawami.field.constraints import held_point
from tawami.grid.edges import Component
from tawami.motion.observer import Recorder, observed
from tawami.motion.pace import Pace, Steps
from tawami.motion.stepping import Stop, end_early, march
from tawami.particles.following import OfParticles
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution
from tawami.solve import path as controls
from tawami.step.configuration import Configuration
from tawami.step.statics import StaticStep
from tawami.step.step import Accepted, Problem

#: 'arc length', or a point (x, y) [m] and its component.
Control = Literal["arc length"] | tuple[tuple[float, float], Component]
EXPECTED = "expected control='arc length', or control=((x, y), 'x') for a point of the body"


class Following:
    """A scene on a path of equilibria, as the subject of a run.

    Args:
        scene: The scene.
        point: The control point [m], which moves with the body; None for the arc length.
        component: Its component.
        sign: Direction in which the point moves, 1 or -1.

    Attributes:
        factor: Load factor: share of the new loads in equilibrium.
        direction: Displacement of each particle of the body in the last step [m]; its sign leads the
            path of an arc length.
        loads: Load factor after each step.
    """

    motion = None

    def __init__(
        self, scene: Scene, point: tuple[float, float] | None, component: int, sign: float
    ) -> None:
        self.scene, self.point, self.component, self.sign = scene, point, component, sign
        self.factor, self.loads = 0.0, list[float]()
        number, dim = scene.particles.number.astype(np.int64), scene.grid.space.dim
        zero = np.zeros((len(number), dim))
        self.direction = OfParticles(scene.grid.comm, number, zero, everywhere=False)

    def header(self) -> str:
        """As `Scene.header`."""
        return self.scene.header()

    def identity(self) -> dict[str, Any]:
        """As `Scene.identity`, with the control."""
        return self.scene.identity() | {"control": [self.component, self.sign, self.point is None]}

    def state(self) -> dict[str, Any]:
        """As `Scene.state`, with the place on the path."""
        own = {
            "factor": self.factor,
            "direction": self.direction.state(),
            "point": self.point,
            "loads": self.loads,
        }
        return self.scene.state() | {"path": own}

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`."""
        self.scene.restore(state)
        own = state["path"]
        self.factor = own["factor"]
        self.direction = OfParticles.of_state(self.scene.grid.comm, own["direction"])
        self.point = None if own["point"] is None else (own["point"][0], own["point"][1])
        self.loads[:] = own["loads"]

    def step(self, size: float) -> Solution:
        """Take one step of this length [m]."""
        now = self.scene.configuration
        solution = self.scene.advanced(PathStep(self, now, size))
        self.loads.append(self.factor)
        return solution


@dataclass(frozen=True)
class PathStep:
    """A static step of a given length (`tawami.step.step.StepKind`).

    Attributes:
        following: The path.
        configuration: Configuration at its start.
        size: Length [m].
    """

    following: Following
    configuration: Configuration
    size: float

    @property
    def moment(self) -> Moment:
        """See `StepKind`."""
        return self.configuration.moment(self.following.factor)

    @property
    def end(self) -> float:
        """Statics has no time."""
        return np.nan

    def problem(self) -> Problem:
        """The problem in the present states of the walls."""
        now, factor = self.configuration, self.following.factor
        stressed = now.model.moves and bool(self.following.loads)
        static = StaticStep(now, now.moment(factor), stressed).problem()
        ends = now.moment(0.0), now.moment(1.0)
        rate = now.external(ends[1]) - now.external(ends[0])
        terms = now.terms(now.moment(factor), static.supports, static.obstacles, ends)
        follows = terms is not None and terms.loads_grow
        if not (now.domain.layout.largest(rate) or follows):
            raise InputError(
                "follow(...): there is no new load: expected a traction, a pressure, a force or gravity "
                "that the scene has not been solved for"
            )
        path = controls.Path(factor, rate, self._control())
        return replace(static, path=path, terms=terms, load=np.nan)

    def _control(self) -> controls.Control:
        domain, following = self.configuration.domain, self.following
        if following.point is not None:
            held = held_point(domain.layout, following.point, following.component, 0.0)
            size = following.sign * self.size
            return controls.PointControl(domain.layout, held.indices, held.weights, size)
        particles, comm, space = domain.particles, domain.model.grid.comm, domain.model.space
        total = ranks.total(comm, float(particles.volume.sum()))
        last = following.direction.at(particles.number)

        def product(a: Array, b: Array) -> float:
            """Mean over the volume of a . b, particles x dim; the same bits on all ranks."""
            return ranks.total(comm, float(particles.volume @ np.sum(a * b, axis=1))) / total

        def at_particles(u: Array) -> Array:
            return domain.at_particles(space.vectors(u))

        def inner(a: Array, b: Array) -> float:
            return product(at_particles(a), at_particles(b))

        def ahead(u: Array) -> float:
            """The first step continues with the load; later ones do not turn back."""
            return product(at_particles(u), last) if following.loads else 1.0

        return controls.ArcLength(inner, ahead, self.size)

    def accept(self, accepted: Accepted) -> PathUpdate:
        """The place on the path after the step."""
        following, now = self.following, self.configuration
        domain, point, dim = now.domain, following.point, now.model.space.dim
        number, u = domain.particles.number.astype(np.int64), domain.at_particles(accepted.u)
        direction = OfParticles(now.model.grid.comm, number, u, everywhere=False)
        control = accepted.problem.path.control if accepted.problem.path else None
        if now.model.moves and isinstance(control, controls.PointControl) and point is not None:
            moved = domain.layout.vectors_at(accepted.u, control.indices // dim)
            x, y = point + control.weights @ moved
            point = (float(x), float(y))
        return PathUpdate(following, now, accepted.step.factor, direction, point)


@dataclass(frozen=True)
class PathUpdate:
    """Changes that a step along a path stores.

    Attributes:
        following, configuration: Objects that it changes.
        factor, direction, point: After the step.
    """

    following: Following
    configuration: Configuration
    factor: float
    direction: OfParticles
    point: tuple[float, float] | None

    def store(self, dissipated: float) -> None:
        """Store nothing before the particles move."""

    def finish(self) -> None:
        """Record the place on the path."""
        following = self.following
        following.factor, following.direction = self.factor, self.direction
        following.point = self.point
        self.configuration.activity.statics += 1
        self.configuration.apply(self.configuration.moment(self.factor))


def follow(
    scene: Scene,
    control: Control | None = None,
    *,
    size: float,
    to: float,
    smallest: float | None = None,
    each: Callable[[Solution], None] | None = None,
    results: Recorder | None = None,
    stop: Stop = "return",
) -> Steps:
    """Follow the path of equilibria under a multiple of the new loads, also beyond limit points.

    The load factor is an unknown of each step: 0 for the loads that are in equilibrium already, 1 for
    all new loads; it may fall and become negative. Each step has a given length, of the displacement of
    a point, or of the body. The displacement of the point must not reverse along the path. An arc length
    suits a body that snaps through. It may turn back and unload at a sharp snap-back of a body that
    softens in one place: control a point next to that place.

    Args:
        scene: The scene, with new loads; displacements that supports prescribe are held.
        control: 'arc length', the root mean square of the displacement over the volume of the body; or
            a point (x, y) [m] of the body and its component 'x' or 'y', which no support may hold.
        size: Largest length of a step [m].
        to: Length at which the path ends [m]; the displacement of a point has a sign.
        smallest: Length below which a step is not halved any more [m]; size/1024 by default.
        each: Called with the solution of each accepted step; `solution.load` is the load factor.
        results: `tawami.Results` of the run, with outputs and checkpoints.
        stop: Action if the smallest step does not converge: 'return' the steps with a warning, or
            'raise' the error.

    Returns:
        The accepted steps as a list, with the length `end` along the path; `loads` are the load
        factors.

    Raises:
        ConvergenceError: The smallest step did not converge, with stop='raise'.
        SingularError: The tangent is singular, and not because the load is too large.
        InputError: No control, no new load, or a displacement that the body does not have yet.

    Warns:
        IncompleteWarning: The path ended before `to`, with stop='return'.
    """
    checks.instance("follow: scene", scene, Scene, "a tawami.Scene")
    scene.configuration.activity.check_idle("follow(...)")
    point, component = _checked(scene, control)
    to = checks.number("to", to)
    if to == 0 or (point is None and to < 0):
        raise InputError(
            f"to = {to:g} m: expected a length that is not 0, above 0 for an arc length"
        )
    size = checks.number("size", size, low=1e-9 * abs(to), high=abs(to))
    least = size / 1024 if smallest is None else checks.number("smallest", smallest, low=0.0)
    each = checks.function("each", each, "of a solution")
    checks.choice("stop", stop, get_args(Stop))
    now = scene.configuration
    for support in now.supports.all:
        if support.is_ahead(now.moment()):
            raise InputError(
                f"{support} prescribes a displacement that the body does not have yet, and follow(...) "
                "changes loads only: expected scene.solve() or ramp(scene) before the loads are added"
            )
    following, steps = Following(scene, point, component, float(np.sign(to))), Steps()
    steps.loads, pace = following.loads, Pace(0.0, size)
    try:
        with observed(results, "path", following, abs(to), "m") as observer:
            march(
                pace, abs(to), least, lambda _, h: following.step(h), observer, now.activity, each,
                steps,
            )  # fmt: skip
    except ConvergenceError as error:
        end_early(steps, error, stop, f"follow, with {following.factor:g} of the load,", scene)
    finally:
        now.accept(now.moment(following.factor))
    return steps


def _checked(scene: Scene, control: Any) -> tuple[tuple[float, float] | None, int]:
    """The control point and its component; no point for an arc length.

    Raises:
        InputError: Neither of them, or a point outside the grid or the body.
    """
    if isinstance(control, str) and control == "arc length":
        return None, 0
    if isinstance(control, str) or not isinstance(control, list | tuple) or len(control) != 2:
        raise InputError(f"follow(...): control = {checks.shown(control)}: {EXPECTED}")
    place = checks.point("follow(...): control", control[0])
    check_in_body(scene.configuration.domain, place, f"follow(...): control = {place}")
    return place, scene.grid.space.axis(control[1])
