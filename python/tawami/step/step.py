"""One accepted step of a scene: the problem, its solution, and the changes that are stored."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tawami.base.arrays import Array
from tawami.conditions.held_border import HeldBorder
from tawami.conditions.obstacle_contact import ObstacleContact
from tawami.conditions.share import Moment
from tawami.conditions.wall_states import ActiveSet
from tawami.field.reduction import Reduction
from tawami.solve.inertia import Inertia
from tawami.solve.newton import Converged
from tawami.solve.path import Path
from tawami.solve.terms import Terms


@dataclass(frozen=True)
class Problem:
    """One step to solve; see `Newton.solve`.

    Attributes:
        reduction: Unknowns that the supports leave free.
        contact: The walls in their present states.
        external: External forces on all coefficients [N per metre depth].
        inertia: Of a dynamic step.
        guess: Increments of all fields to start from.
        supports: Supports on patches of the border.
        obstacles: Contact with each obstacle.
        terms: Forces on the border that depend on the solution.
        held_edges: Names of the edges of the grid that supports or walls hold.
        path: Path on which the load factor is an unknown; `external` is at its start.
        load: Share of the new loads; NaN in dynamics.
    """

    reduction: Reduction
    contact: ActiveSet
    external: Array
    inertia: Inertia | None = None
    guess: Array | None = None
    supports: Sequence[HeldBorder] = ()
    obstacles: Sequence[ObstacleContact] = ()
    terms: Terms | None = None
    held_edges: Collection[str] = ()
    path: Path | None = None
    load: float = np.nan


@dataclass(frozen=True)
class Accepted:
    """A step that was solved, with the particles still where they were.

    Attributes:
        problem: The problem.
        step: Result of Newton's method.
        u: Increments of the displacement, functions x dim [m].
        acceleration: At the end of a dynamic step, functions x dim [m/s2].
    """

    problem: Problem
    step: Converged
    u: Array
    acceleration: Array | None

    @property
    def load(self) -> float:
        """Share of the new loads at its end; NaN in dynamics."""
        return self.problem.load if self.problem.path is None else self.step.factor

    @property
    def forces(self) -> Array:
        """Forces of supports and walls on the body, functions x dim [N per metre depth]."""
        return self.step.forces[: self.u.size].reshape(self.u.shape)

    @property
    def forces_at_end(self) -> Array:
        """The same without the impulse of the supports at the beginning of the step."""
        inertia = self.problem.inertia
        if inertia is None:
            return self.forces
        return self.forces - inertia.impulse.reshape(self.u.shape)

    @property
    def friction(self) -> Array:
        """Friction of the walls on the body, functions x dim [N per metre depth]."""
        return self.problem.contact.friction(self.forces)


class Update(Protocol):
    """Changes that a kind of step stores once its solution is accepted; storing must not fail."""

    def store(self, dissipated: float) -> None:
        """After the particles have their stress and before they move.

        Args:
            dissipated: Energy that the laws dissipated on this rank [J per metre depth].
        """

    def finish(self) -> None:
        """After the particles have moved."""


class StepKind(Protocol):
    """A static or a dynamic step."""

    @property
    def moment(self) -> Moment:
        """Its position in a phase."""

    @property
    def end(self) -> float:
        """Time at its end [s]; NaN in statics."""

    def problem(self) -> Problem:
        """The problem in the present states of the walls; asked again whenever these change."""

    def accept(self, accepted: Accepted) -> Update:
        """Prepare the changes to be stored. This may fail, and then nothing has changed."""
