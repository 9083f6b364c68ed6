"""A static step: equilibrium under a part of the loads and prescribed displacements that are new."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tawami.conditions.action import Term
from tawami.conditions.constraints import constraints
from tawami.conditions.share import Moment
from tawami.step.configuration import Configuration
from tawami.step.step import Accepted, Problem


@dataclass(frozen=True)
class StaticStep:
    """Equilibrium under a part of the new loads and displacements.

    Attributes:
        configuration: Configuration at its start.
        now: From part 0 to 1.
        stressed: Whether stress may prevent rigid motions, as in a truss that snaps through.
    """

    configuration: Configuration
    now: Moment
    stressed: bool = False

    @property
    def moment(self) -> Moment:
        """See `StepKind`."""
        return self.now

    @property
    def end(self) -> float:
        """Statics has no time."""
        return np.nan

    def problem(self) -> Problem:
        """The problem in the present states of the walls."""
        now, moves = self.configuration, self.configuration.model.moves

        def amount(term: Term) -> float:
            """Factor of a value: the whole where coefficients are totals, the rest elsewhere."""
            return term.at(self.now) - (term.share.applied if moves else 0.0)

        with now.stopwatch("set-up"):
            obstacles = now.obstacles_in_step(self.now)
            reduction, contact, supports = constraints(
                now.supports, now.domain, amount, now.before, now.before, moving=self.stressed,
                fields=now.fields_at(self.now), also=[row for o in obstacles for row in o.rows],
            )  # fmt: skip
            external = now.external(self.now)
            terms = now.terms(self.now, supports, obstacles)
        return Problem(
            reduction, contact, external, supports=supports, obstacles=obstacles, terms=terms,
            held_edges=now.supports.supported_edges, load=self.now.part,
        )  # fmt: skip

    def accept(self, accepted: Accepted) -> StaticStep:
        """Prepare nothing."""
        return self

    def store(self, dissipated: float) -> None:
        """Store nothing before the particles move."""

    def finish(self) -> None:
        """Record that the body is in equilibrium with this part."""
        self.configuration.activity.statics += 1
        self.configuration.apply(self.now)
        if self.now.part == 1.0:
            self.configuration.accept(self.now)
