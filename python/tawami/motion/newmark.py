"""One step of Newmark's method on the grid.

    a1 = (u - dt v - dt^2 (1/2 - beta) a) / (beta dt^2),   v1 = v + dt ((1 - gamma) a + gamma a1)

v and a are mapped from the particles (`tawami.motion.transfer`) and obey the supports, by an impulse of
these; at the end of the step prescribed values replace v1 and a1.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tawami.base.arrays import Array
from tawami.conditions.action import Term
from tawami.conditions.constraints import constraints
from tawami.conditions.held_border import HeldBorder
from tawami.conditions.impulses import Impulses
from tawami.conditions.obstacle_contact import ObstacleContact
from tawami.conditions.obstacle_motion import Times
from tawami.conditions.share import Moment
from tawami.conditions.step_values import Fields
from tawami.conditions.wall_states import ActiveSet
from tawami.field.impulse import imposed
from tawami.field.reduction import Reduction
from tawami.motion.carried import Carried, divided
from tawami.motion.energy import Balance, Energies
from tawami.motion.rotation import Rotation
from tawami.solve.inertia import Inertia
from tawami.step import reactions
from tawami.step.configuration import Configuration
from tawami.step.step import Accepted, Problem


@dataclass
class Clock:
    """Number of steps of a motion, and the loads that its accelerations belong to.

    Attributes:
        steps: Number of accepted steps.
        loads: Signature of loads and supports when the last step was stored.
    """

    steps: int = 0
    loads: tuple[int, ...] = ()


@dataclass(frozen=True)
class Prescribed:
    """Prescribed velocities [m/s], or accelerations [m/s2].

    Attributes:
        edges: On all coefficients, of supports on edges and at points.
        patches: Means over the patches of each support on patches; empty if none moves.
    """

    edges: Array
    patches: list[Array]


@dataclass(frozen=True)
class Start:
    """v and a that a step starts from, functions x dim, with the supports imposed.

    Attributes:
        v, a: [m/s], [m/s2]
        reduction, impulses: The supports, and the impulses of those on patches.
        inertia: The inertia made of them.
    """

    v: Array
    a: Array
    reduction: Reduction
    impulses: Impulses
    inertia: Inertia


class NewmarkStep:
    """A dynamic step of length dt.

    Args:
        configuration: The body.
        carried: Velocities and accelerations of its particles.
        balance: Its energy balance.
        rotation: Warns of rotations that are too large for a step.
        clock: Its steps.
        gamma, beta: Newmark's parameters.
        dt: [s]
    """

    def __init__(
        self,
        configuration: Configuration,
        carried: Carried,
        balance: Balance,
        rotation: Rotation,
        clock: Clock,
        gamma: float,
        beta: float,
        dt: float,
    ) -> None:
        self._now, self._carried, self._balance, self._rotation, self._clock = (
            configuration, carried, balance, rotation, clock
        )  # fmt: skip
        self._gamma, self._beta, self._dt = gamma, beta, dt
        start = configuration.activity.time
        self.end = start + dt
        self._begin, self._finish = Moment(1.0, start, start), Moment(1.0, start, self.end)
        domain = configuration.domain
        self._loads = signature(configuration)
        self._mass = domain.lumped_mass
        self._masses = np.repeat(self._mass, configuration.model.space.dim)
        self._first = self._external = configuration.external(self._finish)
        if configuration.loads.vary:
            self._first = configuration.external(self._begin)
        self._mapped = carried.mapped(self._mass)
        first = self._prescribed(lambda term: term.rates(self._finish)[0])
        last = self._prescribed(lambda term: term.rates(self._finish)[1])
        change = Prescribed(
            (last.edges - first.edges) / dt,
            [(b - a) / dt for a, b in zip(first.patches, last.patches, strict=True)],
        )
        self._speed, self._speed1, self._speed_rate = first, last, change

    @property
    def moment(self) -> Moment:
        """See `StepKind`."""
        return self._finish

    def _constraints(
        self, amount: Callable[[Term], float], fields: Fields | None = None
    ) -> tuple[Reduction, ActiveSet, list[HeldBorder]]:
        now, zero = self._now, np.zeros(self._now.domain.layout.size)
        return constraints(
            now.supports, now.domain, amount, zero, now.before, moving=True, fields=fields
        )

    def _prescribed(self, rate: Callable[[Term], float]) -> Prescribed:
        """Prescribed velocities [m/s]."""
        if not any(support.moves for support in self._now.supports.all):
            return Prescribed(np.zeros(self._now.domain.layout.size), [])
        reduction, _, supports = self._constraints(rate)
        return Prescribed(reduction.offset, [one.prescribed_means for one in supports])

    def _imposed(
        self, values: Array, reduction: Reduction, impulses: Impulses, rate: Prescribed
    ) -> Array:
        """Velocities or accelerations, functions x dim, that obey the supports."""
        flat = imposed(reduction, values.ravel(), self._masses, rate.edges)
        return impulses.imposed(rate.patches, flat).reshape(values.shape)

    def _displacement(self, term: Term) -> float:
        """Change of the factor of a prescribed displacement in the step."""
        return term.changed(self._finish)

    def problem(self) -> Problem:
        """The problem in the present states of the walls."""
        now, dt = self._now, self._dt
        fields = now.fields_at(self._finish)
        reduction, contact, supports = self._constraints(self._displacement, fields)
        begins = self._loads != self._clock.loads  # a belongs to other loads
        times = Times(self._gamma, self._beta, dt)
        obstacles = now.obstacles_in_step(self._finish, times, begins=begins)
        v, a = self._mapped
        if begins:
            a = self._first_acceleration(a, obstacles)
        layout = reduction.layout
        impulses = Impulses(layout, supports, self._masses, reduction.fixed[: self._masses.size])
        v = self._imposed(v, reduction, impulses, self._speed)
        a = self._imposed(a, reduction, impulses, self._speed_rate)
        slope = 1 / (self._beta * dt**2)
        back = (0.5 / self._beta - 1) * a.ravel()
        impulse = self._masses * (v - self._mapped[0]).ravel() / dt
        inertia = Inertia(self._masses, slope, dt * v.ravel(), back, impulse, layout)
        self._start = Start(v, a, reduction, impulses, inertia)
        return Problem(
            reduction, contact, self._external, inertia, self._guess(dt * v.ravel()), supports,
            obstacles, now.terms(self._finish, supports, obstacles), now.supports.supported_edges,
        )  # fmt: skip

    @functools.cached_property
    def _internal(self) -> Array:
        """Internal forces at the start of the step, on all coefficients [N per metre depth]."""
        domain = self._now.domain
        return domain.newton.internal(np.zeros(domain.layout.size))

    @functools.cached_property
    def _followers(self) -> Array:
        """Forces at the start of the step of pressures that follow the border."""
        terms = self._now.terms(self._begin, ())
        zero = np.zeros(self._now.domain.layout.size)
        return zero if terms is None else terms.forces(zero)

    @functools.cached_property
    def _on_border(self) -> Array:
        """Forces on the border at the start of the step that depend on the displacement, without those
        of obstacles [N per metre depth].
        """
        supports = self._constraints(lambda _: 0.0)[2]
        terms = self._now.terms(self._begin, supports)
        zero = np.zeros(self._now.domain.layout.size)
        return zero if terms is None else terms.forces(zero)

    def _first_acceleration(self, like: Array, obstacles: Sequence[ObstacleContact]) -> Array:
        """Acceleration by the momentum equation: g in free fall, 0 at rest."""
        force = self._first - self._internal + self._on_border
        of_contact = sum((contact.at_start[0] for contact in obstacles), np.zeros_like(force))
        force = force + self._now.domain.layout.sum(of_contact)
        return divided(force[: like.size].reshape(like.shape), self._mass[:, None])

    def _guess(self, u: Array) -> Array:
        """First iterate: u = dt v, eps_v the lumped projection of its div u (ln det f)."""
        domain = self._now.domain
        guess = np.zeros(domain.layout.size)
        guess[: u.size] = u
        if domain.model.form.kinematics.has_eps_v:
            ln_j = domain.stage.volume_strains(guess[: u.size], None)[:, 0]
            weight = domain.constants["K"] * domain.particles.volume
            # a guess that halves a particle or inverts it is limited
            data = np.column_stack([np.fmax(ln_j, np.log(0.5)), np.ones(len(weight))])
            sums = domain.sums(weight, data, "bilinear")
            assert domain.layout.volumetric is not None
            guess[domain.layout.volumetric.slice] = divided(sums[:, 0], sums[:, 1])
        return guess

    def accept(self, accepted: Accepted) -> NewmarkUpdate:
        """Velocities, accelerations and energies at the end of the step."""
        assert accepted.acceleration is not None
        start, dt, a1 = self._start, self._dt, accepted.acceleration
        self._rotation.check(accepted.u, dt)
        layout = start.reduction.layout
        v1 = start.v + dt * ((1 - self._gamma) * start.a + self._gamma * a1)
        for contact in accepted.problem.obstacles:
            jump = layout.sum(contact.jump)[: a1.size].reshape(a1.shape)
            jump = divided(jump, self._mass[:, None])
            more_a, more_v = Times(self._gamma, self._beta, dt).corrected(jump)
            a1, v1 = a1 + more_a, v1 + more_v
        v1 = self._imposed(v1, start.reduction, start.impulses, self._speed1)
        a1 = self._imposed(a1, start.reduction, start.impulses, self._speed_rate)
        before = self._mapped[0]
        arrays = self._carried.at_end(accepted.u, before, v1, a1, dt)
        energies = self._balance.of_step(self._mass, (before, start.v, v1), accepted)
        given = layout.dot(start.inertia.impulse, start.v.ravel()) * dt
        energies.external += given
        energies.impact += given
        energies.external += self._work_of_mean(accepted) + self._work_on_border(accepted)
        clock = Clock(self._clock.steps + 1, self._loads)
        return NewmarkUpdate(
            self._now, self._carried, self._balance, self._clock, clock, self._finish, arrays,
            (v1, a1), energies, len(self._now.left),
        )  # fmt: skip

    def _work_on_border(self, accepted: Accepted) -> float:
        """Work of the mean of the forces on the border at both ends of the step, without those of
        obstacles [J per metre depth].
        """
        problem, u = accepted.problem, accepted.u.ravel()
        layout = problem.reduction.layout
        if problem.terms is None or not layout.largest(problem.terms.loads):
            return 0.0
        n, start = u.size, self._start
        last = problem.terms.loads[:n]
        parts = [one.on_body for one in problem.supports]
        of_supports = layout.sum(sum(parts, np.zeros(layout.size)))[:n]
        followers = 0.5 * layout.dot(self._followers[:n] + last - of_supports, u)
        if not any(one.prescribed for one in problem.supports):
            return followers
        # those of supports at the start of the step balance the others, as a was made to obey them
        first = self._internal + np.pad(self._masses * start.a.ravel(), (0, len(self._first) - n))
        first = (first - self._first - self._followers)[:n]
        work = followers + 0.5 * layout.dot(of_supports, u)
        return work + start.impulses.work(0.5 * first, u)

    def _work_of_mean(self, accepted: Accepted) -> float:
        """Work of the mean of the forces at both ends of the step, of loads that follow an amplitude and
        of supports that move, less that of their forces at its end [J per metre depth].
        """
        start, u, reduction = self._start, accepted.u.ravel(), accepted.problem.reduction
        first = self._first[: u.size]
        layout = reduction.layout
        work = 0.5 * layout.dot(first - self._external[: u.size], u)
        if not layout.largest(reduction.offset[: u.size]):
            return work
        forces = self._internal[: u.size] + self._masses * start.a.ravel() - first
        return work + reactions.work(reduction, 0.5 * (forces - accepted.forces_at_end.ravel()), u)


@dataclass(frozen=True)
class NewmarkUpdate:
    """Changes that a dynamic step stores; storing them cannot fail.

    Attributes:
        configuration, carried, balance, clock: Objects that it changes.
        after: The clock at the end of the step.
        moment: The end of the step.
        arrays: Of the particles.
        on_grid: v1 and a1, functions x dim.
        energies: Terms of the balance.
        left: Number of particles that had left the grid before.
    """

    configuration: Configuration
    carried: Carried
    balance: Balance
    clock: Clock
    after: Clock
    moment: Moment
    arrays: dict[str, Array]
    on_grid: tuple[Array, Array]
    energies: Energies
    left: int

    def store(self, dissipated: float) -> None:
        """After the particles have their stress and before they move."""
        self.carried.store(self.arrays, *self.on_grid)
        vars(self.clock).update(vars(self.after))
        self.balance.store(self.energies, dissipated, self.clock.steps, self.moment.time)

    def finish(self) -> None:
        """After the particles have moved."""
        self.configuration.apply(self.moment)
        self.configuration.accept(self.moment)
        self.balance.project(self.configuration.projected)
        if len(self.configuration.left) > self.left:
            self.balance.remove_left()


def signature(configuration: Configuration) -> tuple[int, ...]:
    """A value that changes with loads and supports."""
    return tuple(
        owner.version
        for owner in (configuration.loads, configuration.supports, configuration.obstacles)
    )
