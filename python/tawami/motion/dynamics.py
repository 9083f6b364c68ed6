"""Dynamics: Newmark's method on the grid, and the transfers between particles and grid.

    a1 = (u - dt v - dt^2 (1/2 - beta) a) / (beta dt^2),   v1 = v + dt ((1 - gamma) a + gamma a1)

v and a are mapped from the particles (`tawami.motion.transfer`) and obey the supports, by an impulse of
these; at the end of the step what is prescribed replaces v1 and a1. At small strain particles do not
move and v and a stay on the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks, ranks
from tawami.base.errors import InputError
from tawami.base.identity import text
from tawami.base.process import Unique
from tawami.field.reduction import Reduction
from tawami.motion.energy import Energies, Growth
from tawami.motion.observer import Recorder, observed
from tawami.motion.pace import Pace, Step
from tawami.motion.stepping import march
from tawami.motion.transfer import TRANSFERS, TransferName, gradient_of, to_grid
from tawami.scene import description, sources
from tawami.scene.scene import Accepted, Problem, Scene
from tawami.scene.solution import Solution
from tawami.scene.sources import Source
from tawami.scene.supports import Support
from tawami.solve.inertia import Inertia

Array = npt.NDArray[np.float64]
#: Steps [s] whose squares, and what is divided by these, are numbers.
SHORTEST, LONGEST = 1e-100, 1e100
#: Steps of a run, beyond which it would never end.
MOST_STEPS = 1e12


class Dynamics(Unique):
    """Motion of the particles of a scene with a density.

    Args:
        scene: The scene with its supports and loads; a prescribed motion is given by its velocity.
        velocity: Velocities at the start [m/s]: one for all particles, particles x 2 in the order of the
            body, a function f(x, y) on arrays, `tawami.table(...)` or `tawami.earlier(...)`.
        transfer: 'affine_flip', 'flip', 'apic', 'tpic' or 'pic'; at finite strain.
        damping: Time in which velocities of FLIP relax towards those of PIC [s]: per step a share
            1 - exp(-dt/damping) of the difference goes; infinite for none.
        gamma: Newmark's; 1/2 is the trapezoidal rule, more damps. beta = (gamma + 1/2)^2 / 4.

    Attributes:
        energies: The balance of energy since the start.
        time: [s]
        steps: Number of steps accepted.

    Raises:
        InputError: A scene without density, or a parameter out of its range.

    Warns:
        EnergyWarning: Once, where energy has come of nothing.
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
        if not scene.has_density:
            raise InputError("Dynamics needs Scene(..., density=...) [kg/m3]")
        if not checks.one_of(transfer, TRANSFERS):
            raise InputError(
                f"transfer = {checks.shown(transfer)}: expected one of {', '.join(TRANSFERS)}"
            )
        if scene.basis == "biquadratic":
            raise InputError(
                "Dynamics with the basis 'biquadratic': its lumped masses are not all positive; use "
                "'quadratic_spline'"
            )
        if not scene.least_density > 0:
            raise InputError(
                "Dynamics: a density of 0: expected more than 0 kg/m3 for every material"
            )
        expected = "a time in s, more than 0"
        damping = checks.real("damping", damping, expected)
        if not damping > 0:
            raise InputError(f"damping = {damping!r}: expected {expected}")
        self.gamma = checks.number("gamma", gamma, low=0.5, high=1.0)
        self.beta = (self.gamma + 0.5) ** 2 / 4
        self.scene, self.damping = scene, damping
        self.transfer, self._moves = TRANSFERS[transfer], scene.form.strain.finite
        if damping != np.inf and not (self.transfer.flip and self._moves):
            raise InputError(
                f"damping = {damping:g} s relaxes the velocities of FLIP: expected transfer "
                "'affine_flip' or 'flip' and a form of finite strain; gamma > 0.5 damps too"
            )
        with ranks.raise_together(scene.grid.comm):
            given = sources.values(scene, "velocity", velocity, "x y", "m/s")
        for name, width in (
            ("velocity", 2), ("acceleration", 2),
            ("velocity_gradient", 4), ("acceleration_gradient", 4),
        ):  # fmt: skip
            scene.particles.carry(name, width)
            scene.particles.carried(name)[:] = 0.0
        self.velocity[:] = given
        self.time, self.steps = 0.0, 0
        #: v and a of the grid where it stays (functions x 2), and the velocities that it gave particles.
        self._kept: tuple[Array, Array, Array] | None = None
        self._borne: tuple[object, ...] = ()
        self.energies = Energies(kinetic=self.kinetic_energy, elastic=self.elastic_energy)
        self._growth = Growth(self.energies.kinetic + self.energies.elastic)
        self._particles_have = self.energies.kinetic

    # -- what the particles carry --------------------------------------------

    @property
    def velocity(self) -> Array:
        """v_p [m/s], a view: particles x 2."""
        return self.scene.particles.carried("velocity")

    @property
    def acceleration(self) -> Array:
        """a_p [m/s2], a view: particles x 2."""
        return self.scene.particles.carried("acceleration")

    @property
    def velocity_gradient(self) -> Array:
        """C_p [1/s], a view: particles x 2 x 2."""
        return self.scene.particles.carried("velocity_gradient").reshape(-1, 2, 2)

    @property
    def _acceleration_gradient(self) -> Array:
        return self.scene.particles.carried("acceleration_gradient").reshape(-1, 2, 2)

    @property
    def mass(self) -> Array:
        """m_p [kg per metre depth]."""
        return self.scene.mass

    @property
    def motion(self) -> Dynamics:
        """Itself: observers find the motion in the same way in a scene and in its `Dynamics`."""
        return self

    def header(self) -> str:
        """As `Scene.header`, with the motion."""
        return description.header(self.scene, self)

    # -- one step ------------------------------------------------------------

    def step(self, dt: float) -> Solution:
        """One step of `dt` seconds; if it fails nothing has changed.

        Raises:
            ConvergenceError, SingularError: As `Scene.solve`.
            InputError: dt, or what is not finite, or a particle that would leave the grid.
        """
        dt = checks.number("dt", dt, low=SHORTEST, high=LONGEST)
        scene, attached = self.scene, self.scene.attached
        with ranks.raise_together(scene.grid.comm):
            scene.particles.check()
        supports = scene.supports
        for support in supports.all:
            if support.velocity is None and not support.still and support.applied < 1.0:
                raise InputError(
                    f"{support} prescribes a displacement that the body does not have yet: expected "
                    "fix(..., velocity=...) for a motion, or ramp(scene) before Dynamics"
                )
        has = self.kinetic_energy
        self._growth.given(has - self._particles_have)  # velocities that were written
        self._particles_have = has
        zero, end = np.zeros(attached.layout.size), self.time + dt
        borne = self._loads_and_supports
        sudden, left = borne != self._borne, len(scene.left)
        mass = attached.sums(self.mass, np.ones((len(self.mass), 1)))[:, 0]
        external, before = scene.external(), self._from_particles(mass)

        def prescribed(rate: Callable[[Support], float]) -> Array:
            if not any(support.velocity is not None for support in supports.all):
                return zero
            return supports.reduction(attached, rate, zero, scene.gap, moving=True).offset

        def way(support: Support) -> float:
            return 0.5 * dt * (support.velocity_at(self.time) + support.velocity_at(end))

        speed = prescribed(lambda support: support.velocity_at(self.time))
        speed1 = prescribed(lambda support: support.velocity_at(end))
        change = (speed1 - speed) / dt
        masses = np.repeat(mass, 2)
        state: _GridState

        def problem() -> Problem:
            nonlocal state
            ways = supports.stay_on_edges(way) if self._moves else {}
            reduction = supports.reduction(attached, way, zero, scene.gap, moving=True)
            v, a = before
            if sudden:  # the loads are others than those that gave a
                a = self._first_acceleration(external, mass, a)
            v = reduction.imposed(v.ravel(), masses, speed).reshape(-1, 2)
            a = reduction.imposed(a.ravel(), masses, change).reshape(-1, 2)
            slope = 1 / (self.beta * dt**2)
            back = (0.5 / self.beta - 1) * a.ravel()
            impulse = masses * (v - before[0]).ravel() / dt
            inertia = Inertia(masses, slope, dt * v.ravel(), back, impulse)
            state = _GridState(v, a, reduction, inertia)
            return Problem(reduction, external, inertia, self._guess(inertia.course), ways)

        def also(accepted: Accepted) -> Callable[[float], None]:
            assert accepted.acceleration is not None
            a1 = accepted.acceleration
            v1 = state.v + dt * ((1 - self.gamma) * state.a + self.gamma * a1)
            v1 = state.reduction.imposed(v1.ravel(), masses, speed1).reshape(-1, 2)
            a1 = state.reduction.imposed(a1.ravel(), masses, change).reshape(-1, 2)
            carried = self._to_particles(accepted.u, before[0], v1, a1, dt)
            losses = self._losses(mass, (before[0], state.v, v1), accepted, external)
            given = float(state.inertia.impulse @ state.v.ravel()) * dt
            losses.external += given
            losses.impact += given

            def store(dissipated: float) -> None:
                for name, values in carried.items():
                    array = scene.particles.carried(name)
                    array[:] = values.reshape(array.shape)
                if not self._moves:
                    self._kept = v1, a1, np.array(self.velocity)
                self._borne = borne
                self.time, self.steps = end, self.steps + 1
                self._balance(losses, dissipated)

            return store

        def done() -> None:
            scene.accept(1.0)
            if len(scene.left) > left:
                e, kinetic, elastic = self.energies, self.kinetic_energy, self.elastic_energy
                gone = e.kinetic + e.elastic - kinetic - elastic
                self.energies = replace(e, kinetic=kinetic, elastic=elastic, left=e.left + gone)

        return scene.advance(problem, also, end, done)

    @property
    def _loads_and_supports(self) -> tuple[object, ...]:
        """Another one once loads or supports are others."""
        scene = self.scene
        supports = scene.supports
        return (*scene.loads.signature, *map(id, supports.all), *map(id, supports.walls))

    def identity(self) -> dict[str, Any]:
        """As `Scene.identity`, with the motion."""
        own = [self.gamma, text(self.damping), str(self.transfer)]
        return self.scene.identity() | {"motion": own}

    def state(self) -> dict[str, Any]:
        """As `Scene.state`, with the motion."""
        kept = self.on_grid
        own = {
            "time": self.time,
            "steps": self.steps,
            "kept": None if kept is None else list(kept),
            "sudden": self._loads_and_supports != self._borne,
            "energies": asdict(self.energies),
            "growth": self._growth.state(),
            "particles_have": self._particles_have,
        }
        return self.scene.state() | {"motion": own}

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, as `Scene.restore`."""
        self.scene.restore(state)
        state = state["motion"]
        self.time, self.steps = state["time"], state["steps"]
        self._borne = () if state["sudden"] else self._loads_and_supports
        kept = state["kept"]
        self._kept = None if kept is None else (kept[0], kept[1], np.array(self.velocity))
        self.energies = Energies(**state["energies"])
        self._growth.restore(state["growth"])
        self._particles_have = state["particles_have"]

    @property
    def on_grid(self) -> tuple[Array, Array] | None:
        """v and a of a grid that stays, functions x 2; None once velocities were written."""
        if self._kept is None:
            return None
        v, a, given = self._kept
        written = np.array([not np.array_equal(given, self.velocity)])
        return None if ranks.any_of(self.scene.grid.comm, written)[0] else (v, a)

    def _from_particles(self, mass: Array) -> tuple[Array, Array]:
        """v and a of the grid, functions x 2."""
        kept = self.on_grid
        if kept is not None:
            return kept
        attached = self.scene.attached
        v, a = (
            _over(to_grid(attached, self.mass, values, gradient), mass[:, None])
            for values, gradient in (
                (self.velocity, self.velocity_gradient),
                (self.acceleration, self._acceleration_gradient),
            )
        )
        return v, a

    def _first_acceleration(self, external: Array, mass: Array, zero: Array) -> Array:
        """From the momentum equation: g in free fall, 0 in rest."""
        scene = self.scene
        internal = scene.attached.newton.internal(np.zeros(scene.num_coefficients))
        force = (external - internal)[: zero.size].reshape(-1, 2)
        return _over(force, mass[:, None])

    def _guess(self, u: Array) -> Array:
        """u = dt v, eps_v the lumped projection of its div u (ln det f)."""
        scene = self.scene
        guess = np.zeros(scene.num_coefficients)
        n = u.size
        guess[:n] = u.ravel()
        if scene.form.kinematics.has_eps_v:
            ln_j = scene.attached.stage.volume_strains(guess[:n], None)[:, 0]
            weight = scene.constants["K"] * scene.particles.volume
            # a guess that halves a particle or turns it inside out is not followed that far
            data = np.column_stack([np.fmax(ln_j, np.log(0.5)), np.ones(len(weight))])
            sums = scene.attached.sums(weight, data, "bilinear")
            guess[n:] = _over(sums[:, 0], sums[:, 1])
        return guess

    def _to_particles(
        self, u: Array, before: Array, v1: Array, a1: Array, dt: float
    ) -> dict[str, Array]:
        """What the particles carry at the end of the step, by name."""
        attached = self.scene.attached
        velocity = pic = attached.at_particles(v1)
        if self.transfer.flip and self._moves:
            moved = self.velocity + attached.at_particles(v1 - before)
            velocity = pic + np.exp(-dt / self.damping) * (moved - pic)
        f = np.eye(2) + attached.gradients(u)
        return {
            "velocity": velocity,
            "acceleration": attached.at_particles(a1),
            "velocity_gradient": gradient_of(self.transfer, attached, v1, f),
            "acceleration_gradient": gradient_of(self.transfer, attached, a1, f),
        }

    # -- many steps ----------------------------------------------------------

    def run(
        self,
        end: float,
        dt: float,
        *,
        smallest: float | None = None,
        each: Callable[[Solution], None] | None = None,
        results: Recorder | None = None,
    ) -> list[Step]:
        """Steps until `end` [s]; one that fails is halved, and the size grows again after three.

        Args:
            end: Time of the end [s].
            dt: Size of a step [s].
            smallest: Size below which the run ends [s]; dt/1024 by default.
            each: Called with the solution of each accepted step.
            results: Where the run writes its results and checkpoints.

        Returns:
            The accepted steps, with those of a run that is gone on with.

        Raises:
            ConvergenceError, SingularError: At the smallest step, with its history; what was accepted
                is in the particles.
            InputError: dt <= 0, or a step longer than the time that is left.
        """
        dt = checks.number("dt", dt, low=SHORTEST, high=LONGEST)
        left = checks.number("end", end) - self.time
        if dt > left * (1 + 1e-9):
            raise InputError(
                f"dt = {dt:g} s is longer than the {left:g} s until end = {end:g} s: expected a shorter "
                "step"
            )
        checks.number("dt", dt, low=max(left, 0.0) / MOST_STEPS)
        least = dt / 1024 if smallest is None else checks.number("smallest", smallest, low=0.0)
        each = checks.function("each", each, "of a solution")
        with observed(results, "motion", self, end, "s") as observer:
            return march(
                Pace(self.time, dt), end, least, lambda _, size: self.step(size), observer, each
            )

    # -- what is conserved ---------------------------------------------------

    def _sum(self, value: float) -> float:
        """Over the ranks."""
        return float(ranks.sum_of(self.scene.grid.comm, np.array([value]))[0])

    @property
    def linear_momentum(self) -> Array:
        """sum m v [kg m/s per metre depth]."""
        return ranks.sum_of(self.scene.grid.comm, np.asarray(self.mass @ self.velocity))

    def angular_momentum(self, about: Sequence[float] = (0.0, 0.0)) -> float:
        """sum m (x - about) x v [kg m2/s per metre depth], the part of the affine velocity fields, which
        is of the size of a particle, left out.
        """
        x, v = np.array(self.scene.particles.x) - checks.point("about", about), self.velocity
        return self._sum(self.mass @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]))

    @property
    def kinetic_energy(self) -> float:
        """1/2 sum m v^2 [J per metre depth]."""
        return self._sum(0.5 * self.mass @ (self.velocity**2).sum(axis=1))

    @property
    def elastic_energy(self) -> float:
        """What the laws store [J per metre depth]."""
        return self._sum(self.scene.attached.stage.elastic_energy())

    def _losses(
        self,
        mass: Array,
        velocities: tuple[Array, Array, Array],
        accepted: Accepted,
        external: Array,
    ) -> Energies:
        """What the step adds to the balance on the grid, with the kinetic energy that it ends with."""
        mapped, imposed, end = (0.5 * float(mass @ (v**2).sum(axis=1)) for v in velocities)
        friction = self.scene.supports.friction(accepted.forces)
        work = external[: accepted.u.size].reshape(-1, 2) + accepted.smooth
        return Energies(
            kinetic=end,
            external=float((work - friction).ravel() @ accepted.u.ravel()),
            friction=-float(friction.ravel() @ accepted.u.ravel()),
            transfer=self.energies.kinetic - mapped,
            impact=mapped - imposed,
        )

    def _balance(self, step: Energies, dissipated: float) -> None:
        """Add a step to the balance, the particles having what they have at its end."""
        self._particles_have = self.kinetic_energy
        before, kinetic = self.energies, self._particles_have if self._moves else step.kinetic
        step.dissipated = self._sum(dissipated)
        step.transfer += step.kinetic - kinetic
        elastic = self.elastic_energy
        gained = kinetic + elastic - before.kinetic - before.elastic
        lost = step.dissipated + step.friction + step.transfer + step.impact
        step.integration = step.external - gained - lost
        sums = {f.name: getattr(before, f.name) + getattr(step, f.name) for f in fields(Energies)}
        self.energies = Energies(**sums | {"kinetic": kinetic, "elastic": elastic})
        if self.scene.grid.comm.rank == 0:
            self._growth.look(self.energies, self.steps, self.time)


@dataclass(frozen=True)
class _GridState:
    """v and a that a step starts from, functions x 2, and what they were made with."""

    v: Array
    a: Array
    reduction: Reduction
    inertia: Inertia


def _over(sums: Array, weights: Array) -> Array:
    """Means from weighted sums; 0 for functions without particles."""
    return np.asarray(np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0))
