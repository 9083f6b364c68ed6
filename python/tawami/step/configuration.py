"""The body in its present configuration, under its supports and loads: the start of a step.

A step either changes all of it or nothing.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import checks, ranks, signals
from tawami.base.arrays import Array
from tawami.base.errors import CheckpointError
from tawami.base.process import check_process
from tawami.base.program import leave_together
from tawami.base.shared_file import picked
from tawami.base.timing import Stopwatch
from tawami.conditions.activity import Activity
from tawami.conditions.held_border import HeldBorder
from tawami.conditions.left_edges import taken_over
from tawami.conditions.loads import Loads
from tawami.conditions.obstacle_contact import ObstacleContact
from tawami.conditions.obstacle_motion import Times
from tawami.conditions.obstacles import Obstacles
from tawami.conditions.share import Moment
from tawami.conditions.step_values import Fields
from tawami.conditions.supports import Supports
from tawami.domain import coverage, fitting, mean_stress, own_fields, strain_limit
from tawami.domain.border import SceneBorder
from tawami.domain.border_sums import BorderSums
from tawami.domain.domain import Domain
from tawami.domain.model import Model
from tawami.domain.strain_limits import StrainLimits
from tawami.particles import placement
from tawami.particles.following import fingerprints
from tawami.particles.placement import Placed
from tawami.particles.work import Work
from tawami.quantities.quantities import copies
from tawami.solve.numerics import Numerics
from tawami.solve.terms import Term, Terms
from tawami.step import wall_gap
from tawami.step.form_inputs import FormInputs
from tawami.step.outcome import Moved, Outcome
from tawami.step.reactions import Reactions
from tawami.step.solving import solved
from tawami.step.step import Accepted, StepKind

#: Arrays of particles of lengths, or lengths per time.
LENGTHS = ("x", "displacement", "velocity", "acceleration")


class Configuration:
    """Particles, supports and loads of one scene between two steps.

    Args:
        model: Grid, form and laws of the scene.
        particles: The particles of the body that the driver script has on this rank.
        numerics: Numerical settings of a step.

    Attributes:
        domain: The particles where they are; another object after a step that moves them.
        border: The border of the body.
        supports, loads, obstacles: As the driver script made them.
        inputs: Parameters and data of the form.
        activity: Time and activity of the scene.
        total: Coefficients of all fields since the start, where particles do not move.
        left: Number, position [m] and time [s] of the particles that left the grid or were removed.
        removed: Kinetic and elastic energy of removed particles [J per metre depth].
        begun: Whether a step was stored.
        projected: Elastic energy [J per metre depth] that the projection of the last step took.
        stopwatch: Time of each stage of a step.
    """

    def __init__(self, model: Model, particles: _rust.Particles, numerics: Numerics) -> None:
        self.numerics, self.stopwatch, self._work = numerics, Stopwatch(), Work()
        whole = model.part is None
        placed = placement.distributed(model.grid, particles, model.moves, whole=whole)
        self.model, mine = model.on(placed.grid), placed.particles
        if model.form.kinematics.has_eps_v:
            mine.add_eps_v()
        mine.add_strain(model.moves, model.grid.geometry)
        own_fields.carry(model.form, mine, model.space.dim)
        self.border = SceneBorder(model, mine)
        self.border_sums = BorderSums(model, self.border, lambda: self.total)
        self._attach(placed)
        self.activity = Activity()
        own = model.form.own_fields
        self.supports = Supports(model.grid, model.basis, own, self.border, self.activity)
        self.obstacles = Obstacles(self.border, self.activity)
        self.loads = Loads(model.grid, self.activity)
        self.border.users += [self.supports, self.obstacles, self.border_sums]
        self.total = np.zeros(self.domain.layout.size)
        self.inputs = FormInputs(model, self.activity.time, self.border_sums)
        self.inputs.begin(model, self.domain)
        self.left, self.removed = list[tuple[int, tuple[float, float], float]](), np.zeros(2)
        self.begun, self._coverage_checked, self.projected = False, False, 0.0
        self._travel, self._limits = mean_stress.Travel(), StrainLimits(small=not model.moves)

    def _attach(self, placed: Placed) -> None:
        self.model = self.model.on(placed.grid)
        of = self.model, placed.particles, placed.location, self.numerics, self.stopwatch
        self.domain = Domain.attach(*of, getattr(self, "domain", None))
        self.border_sums.attach(self.domain)
        with self.stopwatch("set-up"):
            fitting.fit(self.domain, self.border)

    @property
    def before(self) -> Array:
        """Coefficients since the start where particles do not move, 0 where they do."""
        return np.zeros_like(self.total) if self.model.moves else self.total

    @property
    def old(self) -> Array:
        """Fields without a role as coefficients, 0 for the others; a call for all ranks."""
        return own_fields.on_grid(self.domain) if self.model.moves else self.total

    def prepare(self, now: Moment, dt: float | None = None) -> None:
        """Hand the form what it reads in a step; see `FormInputs.prepare`."""
        self.inputs.prepare(self.domain, now, self.loads.acceleration(now), dt)
        self.domain.assembly.attachment.begin(None if self.model.moves else self.total)

    def fields_at(self, now: Moment) -> Fields | None:
        """Prescribed values of fields without a role, if the form has any; a call for all ranks."""
        if not self.model.form.own_fields:
            return None
        whole = replace(now, part=1.0)
        return Fields(self.old, lambda term: term.at(whole), self.inputs.share(now))

    def moment(self, part: float = 1.0, until: float | None = None) -> Moment:
        """A part of a static phase that ends at a time [s], that of the scene by default.

        Raises:
            InputError: An earlier time.
        """
        start = self.activity.time
        if until is None:
            return Moment(part, start, start)
        end = checks.number("until", until, low=start)
        return Moment(part, start, end if part == 1.0 else start + part * (end - start))

    def obstacles_in_step(
        self, now: Moment, times: Times | None = None, *, begins: bool = False
    ) -> list[ObstacleContact]:
        """Contact with each obstacle in a step that ends at a moment; see `Obstacles.in_step`."""
        of = self.domain, self.before, now, self.loads.acceleration(now), times
        return self.obstacles.in_step(*of, begins=begins)

    def terms(
        self,
        now: Moment,
        supports: Sequence[HeldBorder],
        obstacles: Sequence[ObstacleContact] = (),
        ends: Sequence[Moment] = (),
    ) -> Terms | None:
        """Forces on the border that depend on the solution of a step; None without any.

        Args:
            now: The end of the step.
            supports: Supports on patches of the border.
            obstacles: Contact with obstacles.
            ends: Load factors 0 and 1 of a path.
        """
        found: list[Term] = [*self.loads.following(self.domain, now, ends), *supports]
        if not found and not obstacles:
            return None
        return Terms(found, self.domain.layout, supports, obstacles)

    def external(self, now: Moment | None = None) -> Array:
        """External forces on all coefficients [N per metre depth], under all loads by default."""
        return self.loads.external(self.domain, now or self.moment())

    def apply(self, now: Moment) -> None:
        """The body is in equilibrium with supports and obstacles at this moment."""
        self.supports.apply(now)
        self.obstacles.apply(now)

    def accept(self, now: Moment) -> None:
        """Let later parts of loads and prescribed displacements grow from this moment."""
        self.supports.accept(now)
        self.obstacles.accept(now)
        self.loads.accept(now)
        self.activity.time = now.time

    @contextmanager
    def tolerance(self, tolerance: float) -> Iterator[None]:
        """Newton's tolerance within a block."""
        usual = self.numerics
        try:
            self.numerics = self.domain.newton.numerics = replace(usual, tolerance=tolerance)
            yield
        finally:
            self.numerics = self.domain.newton.numerics = usual

    def check_coverage(self) -> None:
        """Warn, once, of particles that do not integrate over the cells they fill."""
        if not self._coverage_checked:
            coverage.warn_of_faults(self.domain)
            self._coverage_checked = True

    # -- one step ------------------------------------------------------------

    def advance(self, kind: StepKind) -> Outcome:
        """Solve a step, store it in the particles, and move them where strains are finite.

        Ctrl-C ends it before anything is stored, or after everything is.

        Raises:
            ConvergenceError, SingularError, SupportError, InputError: Nothing has changed.
        """
        check_process()
        with ranks.raise_together(self.model.grid.comm):
            self.domain.particles.check()
        self.domain.warn_of_partial_cells()
        walls, committed = [copy.deepcopy(wall.state) for wall in self.supports.walls], False
        try:
            with leave_together():  # laws and other functions of the driver script are called here
                self.prepare(kind.moment)
                old = self.old if self.model.form.own_fields else None
                accepted = solved(self.domain, self.supports, kind, self.before, old)
            if not self.model.moves:
                strain_limit.check_digits(self.domain, accepted.step, self.numerics.tolerance)
            moved = self._moved(accepted, kind.end)
            self._limits.warn(self.domain, self.total, accepted.step.coefficients)
            update = kind.accept(accepted)
            with signals.deferred():
                with self.stopwatch("commit"), ranks.raise_together(self.model.grid.comm):
                    coefficients = accepted.step.coefficients
                    dissipated = self.domain.commit(coefficients)
                    own_fields.accept(self.domain, coefficients)
                committed = True
                if accepted.problem.terms is not None:
                    accepted.problem.terms.accept()
                update.store(dissipated)
                self.inputs.finish(kind.moment)
                outcome = self._store(accepted, moved, kind.end)
                update.finish()
                return outcome
        except BaseException:  # Ctrl-C too
            if not committed:
                for wall, state in zip(self.supports.walls, walls, strict=True):
                    wall.state = state
            raise

    def _moved(self, accepted: Accepted, time: float) -> Moved | None:
        """Positions at the end of the step; None where particles do not move."""
        if not self.model.moves:
            return None
        particles, walls = self.domain.particles, self.supports.edges_with_walls
        moved = np.asarray(particles.x + self.domain.at_particles(accepted.u))
        stop = self.model.leaving == "stop"
        gone = placement.leaving(self.model.grid, particles, moved, time, stop=stop, walls=walls)
        return Moved(moved, gone, self.border.moved(self.domain, accepted.u))

    def _store(self, accepted: Accepted, moved: Moved | None, time: float) -> Outcome:
        """Store a step that the laws have committed, and move the particles."""
        self.begun, grid, layout = True, self.model.grid, self.domain.layout
        if moved is None:
            self.total = self.total + accepted.step.coefficients
            return self._outcome(accepted, self.total)
        self.supports.follow(layout, accepted.u, accepted.problem.reduction.points)
        projects = self._travel.must_project(self.domain, moved.particles)
        self.domain.particles.move_to(moved.particles)
        with taken_over(self.domain, self.supports.all, accepted.forces):
            self.border.move(moved.border)
        outcome = self._outcome(accepted, accepted.step.coefficients)
        self.border.divide()
        particles, gone = placement.removed(grid, self.domain.particles, moved.gone)
        self.left += [(number, x, time) for number, x in gone]
        self._attach(placement.shared(grid, particles, self._work))
        self.total = np.zeros(self.domain.layout.size)
        self.loads.follow(layout, self.domain.layout)
        with self.stopwatch("commit"):
            self.projected = mean_stress.project(self.domain) if projects else 0.0
            if projects:
                own_fields.project(self.domain)
        return outcome

    def _outcome(self, accepted: Accepted, coefficients: Array) -> Outcome:
        self.obstacles.warn(self.domain, coefficients)
        wall_gap.warn_of_distant(self.supports.walls, self.domain, accepted)
        arrays = copies(self.domain.particles)
        return Outcome(accepted, coefficients, Reactions.of(accepted, self.supports), arrays)

    # -- checkpoints ---------------------------------------------------------

    def identity(self) -> dict[str, Any]:
        """Facts that identify it, for checkpoints; a call for all ranks."""
        grid = self.model.grid
        sizes = {"stress": self.domain.responses.stiffest} | dict.fromkeys(LENGTHS, grid.h)
        found = fingerprints(grid.comm, self.domain.particles, sizes)
        particles = {f"'{name}' of the particles at its start": one for name, one in found.items()}
        facts = {
            "tolerance": self.numerics.tolerance,
            "supports": self.supports.identity(),
            "loads": self.loads.identity(),
            "obstacles": self.obstacles.identity(),
        }
        return self.model.identity() | facts | particles

    def state(self) -> dict[str, Any]:
        """State that passes from one step to the next, of all ranks; a call for all ranks."""
        return {
            "particles": placement.stored(self.model.grid.comm, self.domain.particles),
            "work": self._work.state(self.model.grid),
            "time": self.activity.time,
            "inputs": self.inputs.state(),
            "total": self.domain.layout.owned(self.total).rows,
            "left": self.left,
            "removed": [*self.removed],
            "laws": self.model.texts,
            "travel": self._travel.cells,
            "coverage_checked": self._coverage_checked,
            "supports": self.supports.state(),
            "loads": self.loads.state(self.domain.layout),
            "obstacles": self.obstacles.state(),
            "border": self.border.state(),
            "newton": self.domain.newton.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, for a scene that was made in the same way; a call for all ranks.

        Raises:
            CheckpointError: Particles or fields with other arrays.
        """
        grid, moving = self.model.grid, self.model.moves
        placed = placement.restored(grid, self.domain.particles, self._work, state, moving=moving)
        sizes = {np.shape(state["total"]), np.shape(state["loads"]["unbalanced"])}
        if sizes - {(0,)} != {(self.domain.layout.size_of_grid,)}:
            raise CheckpointError("its fields have another number of coefficients than the scene")
        self.model.check_same_laws(state["laws"])
        self.activity.time = state["time"]
        self.activity.statics += 1
        self.left = [(number, (x, y), time) for number, (x, y), time in state["left"]]
        self.removed = np.reshape(state["removed"], 2)
        self._coverage_checked, self.begun = state["coverage_checked"], True
        self._travel.cells = state["travel"]
        for name in ("inputs", "border", "supports", "obstacles"):
            getattr(self, name).restore(state[name])
        self._attach(placed)
        self.total = picked(grid.comm, state["total"], self.domain.layout.in_grid)
        self.loads.restore(state["loads"], self.domain.layout)
        self.domain.newton.record()
        self.domain.newton.restore(state["newton"])
