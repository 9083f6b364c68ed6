"""Dynamics: the motion of a scene in time by Newmark's method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base import checks, html, ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.identity import text
from tawami.base.process import Unique
from tawami.base.sealed import Sealed
from tawami.domain import sources
from tawami.domain.sources import Source
from tawami.motion.animation import animate
from tawami.motion.carried import Carried
from tawami.motion.energy import Balance, Energies
from tawami.motion.newmark import Clock, NewmarkStep, signature
from tawami.motion.observer import Recorder, observed
from tawami.motion.pace import Pace, Step
from tawami.motion.requirements import check_displacements, check_scene, checked_damping
from tawami.motion.rotation import Rotation
from tawami.motion.stepping import march
from tawami.motion.transfer import TRANSFERS, TransferName
from tawami.quantities.quantities import Given
from tawami.scene import description
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation

#: Steps [s] whose squares, and quotients by these, are finite numbers.
SHORTEST, LONGEST = 1e-100, 1e100
#: Steps of a run, beyond which it would never end.
MOST_STEPS = 1e12


class Dynamics(Sealed, Unique):
    """Motion of the particles of a scene with a density.

    Args:
        scene: The scene with its supports and loads; a prescribed motion is given by its velocity.
        velocity: Initial velocities [m/s]: one for all particles, particles x 2 in the order of the
            body, a function f(x, y) on arrays, `tawami.table(...)` or `tawami.earlier(...)`.
        transfer: 'affine_flip', 'flip', 'apic', 'tpic' or 'pic'; at finite strain.
        damping: Time in which velocities of FLIP relax towards those of PIC [s]: in each step a share
            1 - exp(-dt/damping) of the difference is removed; infinite for no damping.
        gamma: Newmark's; 1/2 is the trapezoidal rule, larger values damp.
            beta = (gamma + 1/2)^2 / 4.

    Attributes:
        scene, transfer, damping, gamma, beta: As given.

    Raises:
        InputError: A scene without density, or a parameter out of its range.

    Warns:
        EnergyWarning: Once, where spurious energy appears.
        RotationWarning: Once, where a nearly incompressible body turns too far in a step.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        velocity: Source = (0.0, 0.0),
        transfer: TransferName = "affine_flip",
        damping: float = np.inf,
        gamma: float = 0.5,
    ) -> None:
        checks.instance("Dynamics: scene", scene, Scene, "a tawami.Scene")
        scene.configuration.activity.check_idle("Dynamics(...)")
        check_scene(scene)
        if not checks.one_of(transfer, TRANSFERS):
            raise InputError(
                f"transfer = {checks.shown(transfer)}: expected one of {', '.join(TRANSFERS)}"
            )
        self.scene, self.transfer = scene, TRANSFERS[transfer]
        self.damping = checked_damping(damping, self.transfer, moves=scene.form.strain.finite)
        self.gamma = checks.number("gamma", gamma, low=0.5, high=1.0)
        self.beta = (self.gamma + 0.5) ** 2 / 4
        self._now = scene.configuration
        given = sources.values(
            self._now.domain, "velocity", velocity, " ".join(scene.grid.space.axes), "m/s"
        )
        self._carried = Carried(self._now, self.transfer, self.damping)
        self.velocity[:] = given
        self._clock = Clock()
        self._balance = Balance(self._now, self._carried)
        self._rotation = Rotation(self._now)
        self._seal()

    def _how_to_set(self, name: str) -> str:
        """Advice for an attribute that cannot be set."""
        if name in ("velocity", "acceleration", "velocity_gradient"):
            return f"write into the array, as motion.{name}[:] = ..."
        return "a motion is given by Dynamics(scene, ...) and changed by step(...) and run(...)"

    def __repr__(self) -> str:
        return (
            f"Dynamics({self.scene!r}, {self.transfer}, gamma {self.gamma:g}, at {self.time:g} s after "
            f"{self.steps} steps)"
        )

    def _repr_html_(self) -> str:
        title = f"Dynamics at {self.time:g} s after {self.steps} steps"
        return html.table(title, description.lines(self._now, self._line))

    # -- arrays of the particles ---------------------------------------------

    @property
    def velocity(self) -> Array:
        """v_p [m/s], a view: particles x 2."""
        return self._carried.velocity

    @property
    def acceleration(self) -> Array:
        """a_p [m/s2], a view: particles x 2."""
        return self._carried.acceleration

    @property
    def velocity_gradient(self) -> Array:
        """C_p [1/s], a view: particles x 2 x 2."""
        return self._carried.velocity_gradient

    @property
    def mass(self) -> Array:
        """m_p [kg per metre depth]."""
        return self.scene.mass

    @property
    def on_grid(self) -> tuple[Array, Array] | None:
        """v and a of a grid that stays, functions x 2; None once velocities were written."""
        return self._carried.on_grid

    # -- steps ---------------------------------------------------------------

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self._now.activity.time

    @property
    def steps(self) -> int:
        """Number of accepted steps."""
        return self._clock.steps

    def step(self, dt: float) -> Solution:
        """Take one step of `dt` seconds. If it fails, nothing has changed.

        Raises:
            ConvergenceError, SingularError: As `Scene.solve`.
            InputError: dt, a number that is not finite, or a particle that would leave the grid.
        """
        dt = checks.number("dt", dt, low=SHORTEST, high=LONGEST)
        now = self._now
        with now.activity.step("step(...)"):
            with ranks.raise_together(now.model.grid.comm):
                now.domain.particles.check()
            check_displacements(now)
            self._balance.begin()
            kind = NewmarkStep(
                now,
                self._carried,
                self._balance,
                self._rotation,
                self._clock,
                self.gamma,
                self.beta,
                dt,
            )
            return Solution(self.scene, now.advance(kind))

    def run(
        self,
        end: float,
        dt: float,
        *,
        smallest: float | None = None,
        each: Callable[[Solution], None] | None = None,
        results: Recorder | None = None,
    ) -> list[Step]:
        """Take steps until `end` [s]. A step that fails is halved; the size grows after three steps.

        Args:
            end: Time of the end [s].
            dt: Size of a step [s].
            smallest: Size below which the run ends [s]; dt/1024 by default.
            each: Called with the solution of each accepted step.
            results: `tawami.Results` of the run, with outputs and checkpoints.

        Returns:
            The accepted steps, with those of a run that was resumed.

        Raises:
            ConvergenceError, SingularError: At the smallest step, with its history; accepted steps are
                in the particles.
            InputError: dt <= 0, or a step longer than the remaining time.
        """
        self._now.activity.check_idle("run(...)")
        dt = checks.number("dt", dt, low=SHORTEST, high=LONGEST)
        remaining = checks.number("end", end) - self.time
        if dt > remaining * (1 + 1e-9):
            raise InputError(
                f"dt = {dt:g} s is longer than the {remaining:g} s until end = {end:g} s: expected a "
                "shorter step"
            )
        checks.number("dt", dt, low=max(remaining, 0.0) / MOST_STEPS)
        least = dt / 1024 if smallest is None else checks.number("smallest", smallest, low=0.0)
        each = checks.function("each", each, "of a solution")
        with observed(results, "motion", self, end, "s") as observer:
            return march(
                Pace(self.time, dt), end, least, lambda _, size: self.step(size), observer,
                self._now.activity, each,
            )  # fmt: skip

    def animate(
        self,
        end: float,
        dt: float,
        quantity: Given = "mean stress",
        *,
        every: float | None = None,
        deformed: float = 1.0,
        limits: tuple[float, float] | None = None,
        each: Callable[[Solution], None] | None = None,
        results: Recorder | None = None,
    ) -> FuncAnimation:
        """Take steps until `end`, as :meth:`run`, and return an animation of the particles. A notebook
        plays it; `animation.save("pile.gif")` or `.save("pile.mp4")` writes it. A call for all ranks.

        Args:
            end, dt, each, results: As in :meth:`run`.
            quantity, deformed, limits: As in `Solution.plot`; one range of colours for all frames.
            every: Time between two frames [s]; by default there are about 48.

        Raises:
            ConvergenceError, SingularError, InputError: As :meth:`run`, and as `Solution.plot`.
            MissingDependencyError: matplotlib is not installed.
        """
        given = checks.function("each", each, "of a solution")

        def run(take: Callable[[Solution], None]) -> None:
            def both(solution: Solution) -> None:
                take(solution)
                if given is not None:
                    given(solution)

            self.run(end, dt, each=both, results=results)

        times = (self.time, checks.number("end", end))
        shown = None if results is None else False
        return animate(run, self, times, quantity, every, deformed, limits, shown=shown)

    # -- as the subject of a run ---------------------------------------------

    @property
    def motion(self) -> Dynamics:
        """Itself: observers find the motion in the same way in a scene and in its `Dynamics`."""
        return self

    def header(self) -> str:
        """As `Scene.header`, with the motion."""
        return description.header(self._now, self._line)

    @property
    def _line(self) -> str:
        """The line of the header about the motion."""
        line = f"Newmark gamma {self.gamma:g}, beta {self.beta:g}, from {self.time:g} s"
        if self._now.model.moves:
            damping = f"{self.damping:g} s" if np.isfinite(self.damping) else "none"
            line += f", transfer {self.transfer}, damping {damping}"
        else:
            line += ", velocities stay on the grid"
        return line

    def identity(self) -> dict[str, Any]:
        """As `Scene.identity`, with the motion."""
        own = [self.gamma, text(self.damping), str(self.transfer)]
        return self.scene.identity() | {"motion": own}

    def state(self) -> dict[str, Any]:
        """As `Scene.state`, with the motion."""
        own = {
            "steps": self.steps,
            "loads_changed": signature(self._now) != self._clock.loads,
            "carried": self._carried.state(),
            "balance": self._balance.state(),
            "rotation_warned": self._rotation.warned,
        }
        return self.scene.state() | {"motion": own}

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, as `Scene.restore`."""
        self.scene.restore(state)
        own = state["motion"]
        loads: tuple[int, ...] = () if own["loads_changed"] else signature(self._now)
        vars(self._clock).update(steps=own["steps"], loads=loads)
        self._carried.restore(own["carried"])
        self._balance.restore(own["balance"])
        self._rotation.warned = own["rotation_warned"]

    # -- conserved quantities ------------------------------------------------

    @property
    def energies(self) -> Energies:
        """The balance of energy since the start [J per metre depth]."""
        return self._balance.energies

    @property
    def linear_momentum(self) -> Array:
        """sum m v [kg m/s per metre depth]; in axisymmetry along the axis, 0 across it."""
        momentum = ranks.sum_of(self.scene.grid.comm, np.asarray(self.mass @ self.velocity))
        return self.scene.grid.space.resultant(momentum)

    def angular_momentum(self, about: Sequence[float] = (0.0, 0.0)) -> float:
        """sum m (x - about) x v [kg m2/s per metre depth].

        The part of the affine velocity fields, of the order of the size of a particle, is left out. In
        axisymmetry it is 0: a body does not turn.
        """
        if self.scene.grid.space.hoop:
            return 0.0
        x, v = np.array(self.scene.particles.x) - checks.point("about", about), self.velocity
        return self._balance.sum(self.mass @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]))

    @property
    def kinetic_energy(self) -> float:
        """1/2 sum m v^2 [J per metre depth]."""
        return self._balance.kinetic

    @property
    def elastic_energy(self) -> float:
        """Energy that the laws store [J per metre depth]."""
        return self._balance.elastic
