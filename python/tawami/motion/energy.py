"""The energy balance of a motion from its start on [J per metre depth].

    kinetic + elastic + dissipated + friction + left = start + external - transfer - impact - integration

All terms are measured except the last, the remainder: the error of the time integration, the energy in
the stabilisation of the form (1/2 alpha h^2 sum V K^2/mu |grad eps_v|^2), and where particles move
1/2 sum (f0 - m a) u of each step: mapped accelerations do not balance the forces f0 on the new grid.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import EnergyWarning
from tawami.base.warn import warn
from tawami.field.layout import Layout
from tawami.motion.carried import Carried
from tawami.step.configuration import Configuration
from tawami.step.step import Accepted

#: Spurious energy is reported from this share of the most energy that the body had.
GROWN = 0.05


@dataclass
class Energies:
    """A balance of energy.

    Attributes:
        kinetic: 1/2 sum m v^2 of particles and free obstacles, without that of affine fields.
        elastic: Stored by the laws.
        dissipated: Work of the stress on plastic strains.
        friction: Lost to the friction of walls and obstacles.
        external: Work of loads, and of supports and obstacles that move; between two steps of a motion,
            the elastic energy that static steps and new laws add.
        transfer: Energy lost on the way from the particles to the grid and back: kinetic, and elastic
            where the mean stress of a mixed form is projected on the present grid.
        impact: Kinetic energy lost where supports stop the grid and where contact begins.
        left: Kinetic and elastic energy of the particles that left the grid or were removed.
        integration: Remainder of the balance.
    """

    unit: ClassVar[str] = "J/m"

    kinetic: float = 0.0
    elastic: float = 0.0
    dissipated: float = 0.0
    friction: float = 0.0
    external: float = 0.0
    transfer: float = 0.0
    impact: float = 0.0
    left: float = 0.0
    integration: float = 0.0

    def __str__(self) -> str:
        return (
            ", ".join(f"{f.name} {getattr(self, f.name):.4g}" for f in fields(self))
            + f" {self.unit}"
        )


class EnergiesOfBody(Energies):
    """The same of the whole body [J], in axisymmetry."""

    unit = "J"


class Growth:
    """Warns, once, of spurious energy: a body has more than loads and supports supplied.

    Args:
        energy: That it has at the start [J per metre depth].
    """

    def __init__(self, energy: float) -> None:
        self._given = self._most = energy
        self._warned = False

    def state(self) -> dict[str, Any]:
        """The supplied energy, the largest energy, and whether a warning was issued."""
        return dict(vars(self))

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`."""
        vars(self).update(state)

    def add(self, energy: float) -> None:
        """Count energy that the body is given from outside the balance."""
        self._given += energy

    def check(self, energies: Energies, steps: int, time: float) -> None:
        """Warn at the end of a step if the body has more energy than was supplied.

        Args:
            energies: The balance.
            steps: Steps so far.
            time: [s]
        """
        has = energies.kinetic + energies.elastic
        self._most = max(self._most, has)
        grown = has - self._given - energies.external
        if self._warned or not grown > GROWN * self._most:
            return
        self._warned = True
        warn(
            f"after {steps} steps, at {time:g} s, the body has {grown:.3g} {energies.unit} more energy "
            f"than loads and supports supplied, {100 * grown / self._most:.2g} % of its largest energy: "
            "its stress is not reliable. Use shorter steps or more particles; motion.energies is the "
            "balance",
            EnergyWarning,
        )


class Balance:
    """The energy balance of a motion.

    Args:
        configuration: The body.
        carried: Velocities of its particles.

    Attributes:
        energies: The balance since the start.
    """

    def __init__(self, configuration: Configuration, carried: Carried) -> None:
        self._now, self._carried = configuration, carried
        kind = EnergiesOfBody if configuration.model.space.hoop else Energies
        self.energies = kind(kinetic=self.kinetic, elastic=self.elastic)
        self._growth = Growth(self.energies.kinetic + self.energies.elastic)
        #: Kinetic energy of the particles when the last step was stored.
        self._stored_kinetic = self.energies.kinetic
        self._statics = configuration.activity.statics
        #: Energy of the particles that were removed, as far as the balance counts it.
        self._removed = configuration.removed

    def sum(self, value: float) -> float:
        """A sum over the ranks."""
        return ranks.total(self._now.model.grid.comm, value)

    @property
    def kinetic(self) -> float:
        """1/2 sum m v^2 of particles and free obstacles [J per metre depth]."""
        v = self._carried.velocity
        of_body = self.sum(0.5 * self._now.domain.mass @ (v**2).sum(axis=1))
        return of_body + self._now.obstacles.kinetic

    @property
    def elastic(self) -> float:
        """Energy that the laws store [J per metre depth]."""
        return self.sum(self._now.domain.elastic_energy)

    def begin(self) -> None:
        """Start a step: add the energy of velocities that the script wrote into the particles, of
        particles that were removed since the last step, and of static steps.
        """
        self._count_removed()
        kinetic = self.kinetic
        self._growth.add(kinetic - self._stored_kinetic)
        self._stored_kinetic = kinetic
        if self._now.activity.statics != self._statics:
            self._statics, elastic, e = self._now.activity.statics, self.elastic, self.energies
            external = e.external + elastic - e.elastic
            self.energies = replace(e, elastic=elastic, external=external)

    def _count_removed(self) -> None:
        """Move the energy of particles that the script has removed to the term of those that left."""
        (kinetic, elastic), e = self._now.removed - self._removed, self.energies
        if not (kinetic or elastic):
            return
        self._removed = self._now.removed
        self._stored_kinetic -= kinetic
        if not self._now.model.moves:  # the energy of the grid, with the mass that is left
            mass = self._now.domain.lumped_mass
            v, _ = self._carried.mapped(mass)
            kinetic = e.kinetic - 0.5 * _weighted(self._now.domain.layout, mass, v)
            kinetic -= self._now.obstacles.kinetic
        left = kinetic + elastic
        self.energies = replace(
            e, kinetic=e.kinetic - kinetic, elastic=e.elastic - elastic, left=e.left + left
        )
        self._growth.add(-left)

    def of_step(
        self, mass: Array, velocities: tuple[Array, Array, Array], accepted: Accepted
    ) -> Energies:
        """Terms that a step adds to the balance on the grid, and the kinetic energy at its end.

        Args:
            mass: Lumped mass of each function [kg per metre depth].
            velocities: As mapped from the particles, with the supports imposed, and at the end of the
                step, functions x dim [m/s].
            accepted: The step.
        """
        layout = accepted.problem.reduction.layout
        mapped, imposed, end = (0.5 * _weighted(layout, mass, v) for v in velocities)
        friction, u = accepted.friction, accepted.u
        parts = [contact.energies(u) for contact in accepted.problem.obstacles]
        pushed, rubbed, stopped = np.sum(parts, axis=0) if parts else np.zeros(3)
        moving = self._now.obstacles.kinetic
        work = accepted.problem.external[: u.size].reshape(u.shape) + accepted.forces_at_end
        on_border = self._now.domain.assembly.border_work(accepted.step.coefficients)
        return Energies(
            kinetic=end,
            external=layout.dot((work - friction).ravel(), u.ravel()) + float(pushed) + on_border,
            friction=-layout.dot(friction.ravel(), u.ravel()) + float(rubbed),
            transfer=self.energies.kinetic - mapped - moving,
            impact=mapped - imposed + float(stopped),
        )

    def store(self, step: Energies, dissipated: float, steps: int, time: float) -> None:
        """Add a step to the balance, once the particles have their stress and velocity of its end.

        Args:
            step: As :meth:`of_step` gave it.
            dissipated: Energy that the laws dissipated on this rank [J per metre depth].
            steps: Steps so far.
            time: At the end of the step [s].
        """
        self._stored_kinetic = self.kinetic
        before = self.energies
        step.kinetic += self._now.obstacles.kinetic
        kinetic = self._stored_kinetic if self._now.model.moves else step.kinetic
        step.dissipated = self.sum(dissipated)
        step.transfer += step.kinetic - kinetic
        elastic = self.elastic
        gained = kinetic + elastic - before.kinetic - before.elastic
        lost = step.dissipated + step.friction + step.transfer + step.impact
        step.integration = step.external - gained - lost
        sums = {f.name: getattr(before, f.name) + getattr(step, f.name) for f in fields(Energies)}
        self.energies = replace(before, **sums | {"kinetic": kinetic, "elastic": elastic})
        if self._now.model.grid.comm.rank == 0:
            self._growth.check(self.energies, steps, time)

    def project(self, taken: float) -> None:
        """Count the energy that the projection of the mean stress took from the particles of this rank.

        Args:
            taken: Elastic energy [J per metre depth].
        """
        lost, e = self.sum(taken), self.energies
        self.energies = replace(e, elastic=e.elastic - lost, transfer=e.transfer + lost)

    def remove_left(self) -> None:
        """Move the energy of particles that have left the grid to its own term."""
        e, kinetic, elastic = self.energies, self.kinetic, self.elastic
        gone = e.kinetic + e.elastic - kinetic - elastic
        self.energies = replace(e, kinetic=kinetic, elastic=elastic, left=e.left + gone)

    def state(self) -> dict[str, Any]:
        """The balance for a checkpoint."""
        return {
            "energies": asdict(self.energies),
            "growth": self._growth.state(),
            "stored_kinetic": self._stored_kinetic,
            "removed": [*self._removed],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`."""
        self.energies = replace(self.energies, **state["energies"])
        self._growth.restore(state["growth"])
        self._stored_kinetic = state["stored_kinetic"]
        self._removed = np.reshape(state["removed"], 2)
        self._statics = self._now.activity.statics


def _weighted(layout: Layout, mass: Array, v: Array) -> float:
    """sum_i m_i v_i . v_i over the functions of all ranks."""
    return layout.dot(np.repeat(mass, v.shape[1]), (v**2).ravel())
