"""Loads of a scene: weight, tractions and pressures on the border, forces on particles.

Loads that are new since the last full solve grow with a part from 0 to 1; the others stay.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import SupportError
from tawami.base.shared_file import picked
from tawami.base.text import listed
from tawami.conditions.action import Owner, Term, restored
from tawami.conditions.activity import Activity
from tawami.conditions.factor import Factor
from tawami.conditions.load import Flux, Forces, Load, OnBorder, Pressure, Traction, Weight
from tawami.conditions.share import Moment
from tawami.domain import selection
from tawami.domain.domain import Domain
from tawami.domain.excavation import Excavation
from tawami.domain.moving_points import MovingPoints
from tawami.domain.selection import Where
from tawami.field.follower import FollowerPressure
from tawami.field.layout import Layout
from tawami.grid.grid import Grid


class Loads(Owner[Load]):
    """The loads of one scene.

    Args:
        grid: The grid.
        activity: Time and activity of the scene.

    Attributes:
        all: The loads, also those that were released and have not faded.
        unbalanced: Forces on all coefficients that keep the body in equilibrium after its particles or
            laws have changed, and that fade as a released load does [N per metre depth]; None for none.
        version: A number that changes with every change of a load.
    """

    def __init__(self, grid: Grid, activity: Activity) -> None:
        super().__init__(activity)
        self.grid = grid
        self.unbalanced: Array | None = None

    def remove(self, action: Load) -> None:
        """A released load stays until it has faded."""
        self._drop_faded()
        self.changed()

    def _drop_faded(self) -> None:
        self.all = [
            load
            for load in self.all
            if not load.released or any(not t.share.is_gone for t in load.terms)
        ]

    def _factor(self, where: str, amplitude: Any) -> Factor:
        self.activity.check_between_steps(where)
        return Factor(where, amplitude, time=self.activity.time)

    def add_gravity(self, acceleration: Any, amplitude: Any) -> Load:
        """Load the body by its weight."""
        weight = Weight(self, self.grid, acceleration, self._factor("gravity(...)", amplitude))
        self.all.append(weight)
        return weight

    def add_on_border(
        self,
        kind: type[Traction | Pressure],
        points: MovingPoints,
        where: str,
        value: Any,
        amplitude: Any,
    ) -> Load:
        """Load a part of the border with a traction or a pressure [Pa]."""
        load = kind(self, points, where, value, self._factor(f"{kind.call}({where})", amplitude))
        self.all.append(load)
        return load

    def add_flux(
        self, points: MovingPoints, where: str, field: str, value: Any, amplitude: Any
    ) -> Load:
        """Load a part of the border with a flux of a field."""
        flux = Flux(self, points, where, field, value, self._factor(f"flux({where})", amplitude))
        self.all.append(flux)
        return flux

    def add_forces(self, domain: Domain, particles: Where, force: Any, amplitude: Any) -> Load:
        """Load particles of the body; a call for all ranks."""
        chosen = selection.in_order(domain, "load(...): particles", particles)
        factor = self._factor("load(...)", amplitude)
        forces = Forces(self, domain, *chosen, force, factor)
        self.all.append(forces)
        return forces

    @property
    def gravity(self) -> Array:
        """The acceleration in the driver script, without amplitudes [m/s2]."""
        weights = [load.acceleration for load in self.all if isinstance(load, Weight)]
        return sum(weights, np.zeros(self.grid.space.dim))

    def acceleration(self, now: Moment) -> Array:
        """Acceleration of all weights at a moment [m/s2]."""
        total = np.zeros(self.grid.space.dim)
        for load, term, factor in self._acting(now):
            if isinstance(load, Weight):
                total += factor * np.array(term.values, dtype=float)
        return total

    @property
    def vary(self) -> bool:
        """Whether any load follows an amplitude in time."""
        return any(term.factor.moves for load in self.all for term in load.terms)

    # -- forces --------------------------------------------------------------

    def external(self, domain: Domain, now: Moment) -> Array:
        """External forces on all coefficients.

        Args:
            domain: The particles where they are.
            now: Part of the loads that are new, and time.
        """
        particles, external = domain.particles, np.zeros(domain.layout.size)
        on_particles, any_on_particles = np.zeros((len(particles), self.grid.space.dim)), False
        n = domain.layout.num_displacement
        for load, term, factor in self._acting(now):
            if isinstance(load, Flux):
                place, integrals = load.on(domain, term)
                external[place] += factor * integrals
            elif isinstance(load, Traction | Pressure):
                if not self._follows(load, domain):
                    external[:n] += factor * load.on(domain, term).ravel()
            elif isinstance(load, Forces):
                on_particles += factor * load.on(term, particles.number)
                any_on_particles = True
            else:
                acceleration = factor * np.array(term.values, dtype=float)
                on_particles += domain.mass[:, None] * acceleration
                any_on_particles = True
        if any_on_particles:
            sums = domain.sums(np.ones(len(particles)), on_particles)
            external[: sums.size] += sums.ravel()
        if self.unbalanced is not None:
            external += (1 - now.part) * self.unbalanced
        return external

    def following(
        self, domain: Domain, now: Moment, ends: Sequence[Moment] = ()
    ) -> list[FollowerPressure]:
        """Pressures that follow the border within a step.

        Args:
            domain: The particles where they are.
            now: Part of the loads that are new, and time.
            ends: Moments with load factors 0 and 1 of a path, if the step is on one.
        """
        found = []
        for load in self.all:
            if not isinstance(load, Pressure) or not self._follows(load, domain):
                continue
            for term in load.terms:
                factor, rate = term.at(now), term.at(ends[1]) - term.at(ends[0]) if ends else 0.0
                if term.is_zero or not (factor or rate):
                    continue
                points, pressure = load.points, load.at_points(term)[:, 0]
                place = domain.layout, points.cells(domain), points.x, points.area
                found.append(FollowerPressure(*place, factor * pressure, rate * pressure))
        return found

    @staticmethod
    def _follows(load: Load, domain: Domain) -> bool:
        """Whether a load depends on the displacement in a step."""
        return isinstance(load, Pressure) and domain.model.moves

    @property
    def tractions(self) -> list[tuple[MovingPoints, Array]]:
        """Points of each load on the border, and its present tractions there [Pa], points x dim."""
        found = []
        for load in self.all:
            if isinstance(load, Traction | Pressure):
                parts = [term.share.carried * load.tractions(term) for term in load.terms]
                found.append((load.points, np.asarray(sum(parts))))
        return found

    def check_reach(self, excavation: Excavation) -> None:
        """Check that loads on the border still load something once particles were removed; a call for
        all ranks.

        Raises:
            SupportError: One would not.
        """
        for load in self.all:
            if load.released or not isinstance(load, OnBorder):
                continue
            if not load.points.remaining(excavation)[0].any():
                raise SupportError(
                    f"{load} would load no particles after remove(...): expected loads on particles "
                    "that remain; release() it before. Nothing was changed"
                )

    def at_start(self, domain: Domain, now: Moment) -> Array:
        """All external forces, with those of pressures that follow the border."""
        total = self.external(domain, now)
        parts = [term.forces(0 * total) for term in self.following(domain, now)]
        return total + domain.layout.sum(sum(parts, 0 * total))

    def keep_balance(self, forces: Array) -> None:
        """Add forces on all coefficients that fade from now on [N per metre depth]."""
        self.unbalanced = forces if self.unbalanced is None else self.unbalanced + forces
        self.changed()

    def follow(self, before: Layout, after: Layout) -> None:
        """Keep forces that fade where cells have changed their rank; a call for all ranks."""
        if self.unbalanced is not None and after.window is not before.window:
            mine = before.own
            of = self.grid.comm, before.in_grid[mine], self.unbalanced[mine], after.in_grid
            self.unbalanced = ranks.looked_up(*of)

    def _acting(self, now: Moment) -> Iterator[tuple[Load, Term, float]]:
        """The terms with their factors, but for those that are zero."""
        for load in self.all:
            for term in load.terms:
                factor = term.at(now)
                if not term.is_zero and factor:
                    yield load, term, factor

    def accept(self, now: Moment) -> None:
        """Let later parts grow from this moment; drop loads that have faded."""
        super().accept(now)
        self._drop_faded()
        if self.unbalanced is not None:
            self.unbalanced = (1 - now.part) * self.unbalanced if now.part != 1.0 else None

    # -- header, identity, checkpoints ---------------------------------------

    @property
    def line(self) -> str:
        """The loads in words, for the header of a run."""
        lines = [load.line for load in self.all if load.released or not load.terms[-1].is_zero]
        if self.unbalanced is not None:
            lines.append("forces of removed particles or replaced laws until they fade")
        return listed(lines)

    def identity(self) -> list[Any]:
        """Facts that decide the results of a run, in the types of JSON."""
        return [[type(load).__name__, *load.place(), *load.identity()] for load in self.all]

    def state(self, layout: Layout) -> dict[str, Any]:
        """Share of each load that the body carries, and the forces that fade; a call for all ranks."""
        unbalanced = np.zeros(0) if self.unbalanced is None else layout.owned(self.unbalanced).rows
        return {"all": [load.state() for load in self.all], "unbalanced": unbalanced}

    def restore(self, state: Mapping[str, Any], layout: Layout) -> None:
        """The reverse of :meth:`state`, for the same loads.

        Raises:
            CheckpointError: The script has made others.
        """
        self.all = restored("load", self.all, state["all"])
        unbalanced, self.unbalanced = state["unbalanced"], None
        if np.shape(unbalanced) != (0,):
            self.unbalanced = picked(self.grid.comm, unbalanced, layout.in_grid)
        self.changed()
