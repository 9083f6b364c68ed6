"""A scene: particles on a grid, a weak form, supports and loads; what a driver script builds."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from tawami import _rust
from tawami.base import checks, ranks, signals
from tawami.base.errors import ConvergenceError, InputError, LockingWarning, ParameterWarning
from tawami.base.process import Unique, check_process
from tawami.base.timing import Stopwatch
from tawami.body.body import Body
from tawami.fem.rules import TangentRule
from tawami.field.fast import FastField
from tawami.field.reduction import Reduction
from tawami.field.reference import Field
from tawami.form.compilation import check_used, compile_form
from tawami.form.form import Form
from tawami.grid.basis import BASES, Basis
from tawami.grid.edges import Component, Interval, Profile, cells_between
from tawami.grid.grid import Edge, Grid
from tawami.particles import assignment, placement
from tawami.particles.numpy_law import NumpyStage
from tawami.particles.responses import Responses
from tawami.scene import coverage, description, initial
from tawami.scene.domain import Attached
from tawami.scene.loads import Loads, Traction
from tawami.scene.solution import Solution
from tawami.scene.sources import Source
from tawami.scene.supports import Support, Supports, Velocity
from tawami.solve.inertia import Inertia
from tawami.solve.newton import Converged, Newton
from tawami.solve.numerics import Assembly, Factorise, Numerics, SolverName

Array = npt.NDArray[np.float64]
FIELDS: dict[str, type[Field]] = {"fast": FastField, "reference": Field}
#: K/mu from which displacement-only forms lock: nu = 0.49. At 0.495 the mean stress of the cantilever
#: has 4 times the error that it has at 0.3, at 0.49995 70 times (`python -m cases.extremes`).
LOCKS = 50.0
#: Times that a step is solved with other states of the walls before it is given up.
PASSES = 40


@dataclass(frozen=True)
class Problem:
    """One step to solve; see `Newton.solve`, and `Supports.stay_on_edges` for the ways."""

    reduction: Reduction
    external: Array
    inertia: Inertia | None = None
    guess: Array | None = None
    ways: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Accepted:
    """A step that was solved, with the particles still where they were.

    Attributes:
        step: What Newton found.
        u: Increments of the displacement, functions x 2.
        acceleration: At the end of a dynamic step, functions x 2 [m/s2].
        forces: What supports and walls give, functions x 2 [N per metre depth].
        smooth: The same without their impulse at the beginning of the step.
    """

    step: Converged
    u: Array
    acceleration: Array | None
    forces: Array
    smooth: Array


class Scene(description.Elsewhere, Unique):
    """Particles on a grid with a weak form, supports and loads.

    By itself it is static; `ramp` brings its loads up in steps, `Dynamics` sets it in motion. With a
    form of finite strain every step moves the particles and resets the grid; their stress is
    Kirchhoff's then.

    Args:
        grid: The background grid.
        body: Positions and volumes of the particles, as `box(...)` or `Body(x, volume)`; the same on
            every rank.
        material: The material law, or several as a list or, by the names of the body, as a dictionary;
            or one `NumpyLaw` for all particles.
        material_of: Number of the law of each particle; that of the body by default, or the first.
        form: Weak form: the name of a shipped one ('u_epsv', 'u_p', 'u_bbar', 'u'), the path of a
            file, a module, or a `Form`.
        basis: Basis of the displacement: 'quadratic_spline', 'bilinear' or 'biquadratic'.
        tolerance, max_iterations, assembly, tangent_rule, factorise, linear_solver: How a step is
            solved; see `tawami.solve.numerics.Numerics`.
        density: Mass density at the start [kg/m3], one for all materials or one each (a list or a
            dictionary as that of the materials); gravity needs it.
        leaving: What to do with particles that leave the grid: 'stop' with an error before they do, or
            'remove' them; `left` says which and where.
        parameters: What the form names: alpha, stabilisation, ...

    Attributes:
        particles: The particles on this rank: those in its cells; `number` says which of the body
            they are. Where particles change rank or leave the grid this is another object after a
            step. Their arrays are views of the storage, not copies: `x` [m], `material` and
            `number`, which cannot be written, `volume` [m2], `stress` [Pa] (xx, yy, zz, xy; tension
            positive), `displacement` [m], and `eps_v` with forms that have that field.
        num_particles: Number of particles of the body, on all ranks.
        left: Number, position [m] and time [s] (NaN in a static scene) of the particles that left.
        supports, loads: As fix(...), gravity(...) and their like have made them.
        parameters, options: Of the form, as they are used.
        begun: Whether it has been solved, or moves: initial fields come before.
        numerics: How a step is solved.

    Raises:
        InputError: Particles outside the grid, a body without particles, NaN, an incompressible
            material with a form that cannot take it, a parameter that is unknown or without effect.
        FormError: A form that cannot be used as it stands.

    Warns:
        LockingWarning: A form without a field for the volume, and a material nearly incompressible.
        InstabilityWarning: When solving: cells filled in part, and an option that needs whole ones.
        ParameterWarning: A parameter of the form beyond its usual range.
        QuadratureWarning: When first solving: particles that do not integrate over the cells they fill.
    """

    def __init__(
        self,
        grid: Grid,
        body: Body,
        material: assignment.Given,
        *,
        material_of: npt.ArrayLike | None = None,
        form: str | Path | ModuleType | Form = "u_epsv",
        basis: Basis = "quadratic_spline",
        tolerance: float = 1e-6,
        max_iterations: int = 20,
        assembly: Assembly = "fast",
        tangent_rule: TangentRule = "full",
        factorise: Factorise = "when_it_pays",
        linear_solver: SolverName = "direct",
        density: float | Sequence[float] | Mapping[str, float] | None = None,
        leaving: Literal["stop", "remove"] = "stop",
        **parameters: Any,
    ) -> None:
        if not checks.one_of(basis, BASES):
            names = ", ".join(map(repr, BASES))
            raise InputError(f"basis {checks.shown(basis)}: expected one of {names}")
        checks.choice("leaving", leaving, ("stop", "remove"))
        if not isinstance(grid, Grid) or not isinstance(body, Body):
            raise InputError(
                f"Scene({type(grid).__name__}, {type(body).__name__}, ...): expected a tawami.Grid and "
                "a tawami.Body"
            )
        check_process()
        self.numerics = Numerics(
            tolerance, max_iterations, assembly, tangent_rule, factorise, linear_solver
        )
        self.grid, self.basis = grid, basis
        self.form = Form.load(form)
        values, options = self.form.settings(parameters)
        for sentence in [] if grid.comm.rank else self.form.unusual(values):
            warnings.warn(sentence, ParameterWarning, stacklevel=2)
        self._whole_cells = [o for o in options.values() if o in self.form.whole_cells]
        x, volume = checks.array("x", body.x, 2), checks.array("volume", body.volume, 1)
        assigned = assignment.assigned(material, material_of, body, len(x))
        materials, law, numbers = assigned.materials, assigned.law, assigned.number
        whole = _rust.Particles(x, volume, numbers)
        whole.check_materials(materials, self.form.kinematics.name, self.form.strain.finite)
        whole.add_history(materials)
        self._materials, self._law, self._values = materials, law, values
        self._moduli = np.array([(m.bulk_modulus, m.shear_modulus) for m in materials])
        self._densities = assignment.densities(density, len(materials), body.names)
        self._finite = self.form.strain.finite
        if self._finite and law is not None:
            raise InputError(
                f"form {self.form.name} has finite strains: expected a law in Rust, a NumpyLaw has "
                "small ones only"
            )
        self._warn_of_locking(whole)
        self.num_particles = len(whole)
        self.particles, location = placement.distributed(grid, whole, moving=self._finite)
        self._compiled = compile_form(grid.comm, self.form, options, tangent_rule)
        check_used(self._compiled, options, parameters)
        self.options = options
        self.parameters = {name: values[name] for name in values if name in self._compiled.used}
        if self.form.kinematics.has_eps_v:
            self.particles.add_eps_v()
        self.stopwatch = Stopwatch()
        self._leaving, self.left = leaving, list[tuple[int, tuple[float, float], float]]()
        self.attached = self._attach(location)
        self.supports, self.loads = Supports(grid, basis), Loads(grid, self.num_particles)
        self._total = np.zeros(self.num_coefficients)
        self._looked_at = self.begun = False

    def _warn_of_locking(self, particles: _rust.Particles) -> None:
        bulk, mu = self._moduli[particles.material].T
        p = int(np.argmax(bulk / mu))
        if not self.form.kinematics.locks or bulk[p] < LOCKS * mu[p] or self.grid.comm.rank:
            return
        warnings.warn(
            f"form {self.form.name} has no field for the volume, and K/mu = {bulk[p] / mu[p]:.3g} at "
            f"particle {p}: it locks, and its mean stress is useless where K/mu is large. Expected "
            f"K/mu below {LOCKS:g} (nu < 0.49); use form 'u_epsv' or 'u_epsv_finite'",
            LockingWarning,
            stacklevel=3,
        )

    def _attach(self, location: _rust.Location) -> Attached:
        """Field side, laws and Newton's method for the particles in these places."""
        with self.stopwatch("set-up"):
            field = FIELDS[self.numerics.assembly](
                self.grid, self._compiled, self.basis, location, self.particles.volume,
                self._values, self.stopwatch,
            )  # fmt: skip
        kinematics, law = self.form.kinematics.name, self._law
        rust = _rust.Stage(
            self.particles, location, self._materials, kinematics, self._finite, self.basis
        )
        stage = rust if law is None else NumpyStage(rust, self.particles, law)
        responses = Responses(
            self._compiled, self.particles, location, stage, self.constants, self.grid.comm,
            self.stopwatch,
        )  # fmt: skip
        newton = Newton(field, responses, self.stopwatch, self.numerics)
        return Attached(location, field, stage, newton)

    @property
    def laws(self) -> list[str]:
        """Names of the laws, each with its history variables."""
        if self._law is not None:
            return ["NumpyLaw"]
        histories = [(m.name, ", ".join(m.history_names)) for m in self._materials]
        return [f"{name} ({history})" if history else name for name, history in histories]

    @property
    def law_texts(self) -> list[str]:
        """The laws with their parameters."""
        return [repr(law) for law in self._materials] + (
            [] if self._law is None else [self._law.source]
        )

    @property
    def constants(self) -> dict[str, Array]:
        """K and mu [Pa] of each particle."""
        of_particle = self._moduli[self.particles.material]
        return {"K": of_particle[:, 0].copy(), "mu": of_particle[:, 1].copy()}

    @property
    def elastic(self) -> npt.NDArray[np.bool_]:
        """Whether each particle's law has no history."""
        plain = [self._law is None and not m.history_names for m in self._materials]
        return np.array(plain)[self.particles.material]

    @property
    def mass(self) -> Array:
        """Mass of each particle [kg per metre depth].

        Raises:
            InputError: No density.
        """
        if self._densities is None:
            raise InputError("mass needs Scene(..., density=...) [kg/m3]")
        return np.asarray(self._densities[self.particles.material] * self.particles.volume)

    @property
    def has_density(self) -> bool:
        """Whether the scene has a density."""
        return self._densities is not None

    @property
    def densities(self) -> list[float] | None:
        """Density of each material [kg/m3]; None without any."""
        return None if self._densities is None else self._densities.tolist()

    @property
    def least_density(self) -> float:
        """The smallest density of a material [kg/m3]; 0 without any."""
        return 0.0 if self._densities is None else float(self._densities.min())

    # -- supports and loads --------------------------------------------------

    def fix(
        self,
        edge: Edge,
        component: Component,
        value: Profile = 0.0,
        *,
        velocity: Velocity | None = None,
        between: Interval | None = None,
    ) -> None:
        """Prescribe a displacement component along an edge of the grid.

        Args:
            edge: 'left', 'right', 'bottom' or 'top'.
            component: 'x' or 'y'.
            value: Displacement [m] from now on (at small strain from the start of the scene): a
                number, or a function f(x, y) on arrays, which is projected in L2 on the functions of
                the edge.
            velocity: For `Dynamics`, in place of a value: a number [m/s], or a function of time [s].
            between: Part of the edge, from one line of the grid to another [m].

        Raises:
            InputError: An unknown edge or component, or a part that is not one of whole cells.
        """
        self.supports.fix(edge, component, value, velocity, between)

    def hold(
        self,
        point: Sequence[float],
        component: Component,
        value: float = 0.0,
        *,
        velocity: Velocity | None = None,
    ) -> None:
        """Prescribe a displacement component at a point of the body: a constraint on the interpolated
        value. Where particles move the point moves with them.

        Args:
            point: Position (x, y) [m].
            component: 'x' or 'y'.
            value: Displacement [m], as in `fix`.
            velocity: As in `fix`.

        Raises:
            InputError: A point outside the grid, or an unknown component.
        """
        self.supports.hold(point, component, value, velocity)

    def wall(self, edge: Edge, friction: float = 0.0, *, separates: bool = True) -> None:
        """A wall along an edge of the grid, with Coulomb friction.

        Args:
            edge: 'left', 'right', 'bottom' or 'top'.
            friction: Coefficient of friction; 0 is smooth, infinity does not slide.
            separates: Whether the body may leave the wall.

        Raises:
            InputError: An unknown edge, a negative friction, or a wall that is there already.
        """
        self.supports.wall(edge, friction, separates)

    def release(self, place: Edge | Sequence[float], component: Component | None = None) -> None:
        """Take away what `fix`, `hold` or `wall` made.

        Args:
            place: Name of the edge, or point (x, y) [m].
            component: 'x' or 'y'; both, and a wall, by default.

        Raises:
            InputError: Nothing of the kind is there.
        """
        self.supports.release(place, component)

    def traction(
        self,
        edge: Edge,
        value: tuple[Profile, Profile],
        *,
        between: Interval | None = None,
    ) -> None:
        """Load an edge of the grid where the body touches it.

        Args:
            edge: 'left', 'right', 'bottom' or 'top'.
            value: Traction (t_x, t_y) [Pa]: numbers, or functions f(x, y) on arrays, taken at the
                biquadratic nodes of the grid (exact up to parabolas).
            between: Part of the edge, from one line of the grid to another [m].

        Raises:
            InputError: An unknown edge or part of it, or a form without a term `dot(t, w) * ds`.
        """
        self.grid.edge(edge)
        what = f"traction(edge='{edge}')"
        if self._compiled.traction is None:
            raise InputError(
                f"{what}: form {self.form.name} has no edge term; add "
                "- dot(t, w) * ds to its residual"
            )
        t_x, t_y = checks.pair(what, value, "components (t_x, t_y)")
        components = checks.profile(f"{what}: t_x", t_x), checks.profile(f"{what}: t_y", t_y)
        cells_between(self.grid, edge, between)
        self.loads.tractions.append(Traction(edge, components, between))

    def load(self, particles: npt.ArrayLike, force: Sequence[float]) -> None:
        """Load particles of the body, wherever they move: a traction on a surface that is not an edge
        of the grid, in a direction that stays.

        Args:
            particles: A mask of the particles of the body, or their numbers.
            force: (f_x, f_y) [N per metre depth], shared out evenly.

        Raises:
            InputError: No particle, or others than those of the body.
        """
        self.loads.add_forces(particles, force)

    def gravity(self, acceleration: Sequence[float]) -> None:
        """Load the body by its weight.

        Args:
            acceleration: (b_x, b_y) [m/s2], in place of what was set before.

        Raises:
            InputError: No density, or not two finite numbers.
        """
        if self._densities is None:
            raise InputError("gravity(...) needs Scene(..., density=...) [kg/m3]")
        self.loads.gravity = np.array(checks.point("gravity", acceleration))

    def initial(self, name: str, source: Source, *, beyond: initial.Beyond = "stop") -> None:
        """Give the particles a field to begin with, before anything is solved; loads and supports act
        on top of it. A call for all ranks.

        'stress' is what the laws go on from: (xx, yy, zz, xy) [Pa], Kirchhoff's per V0 at finite
        strain. With a field eps_v it sets that too, to sigma_m / K, the elastic part. 'eps_v' (more
        than this part, by plastic strain; or 0: counted from this state) and 'displacement' [m] are
        records that enter no equation: positions stay. Then the history variables of the laws by name.

        Args:
            name: 'stress', 'displacement', 'eps_v', or a history variable.
            source: Numbers, the same for all or one row a particle of the body; a function f(x, y) on
                arrays that returns the components; `tawami.table(...)` or `tawami.earlier(...)`.
            beyond: What to do with stress beyond the yield surface: 'stop' with an error, or 'return'
                it to the surface as the law does.

        Raises:
            InputError: An unknown name, another shape, a number that is not finite, stress beyond the
                yield surface, eps_v that does not fit an elastic stress, or a scene that was solved.
        """
        initial.give(self, name, source, beyond)

    # -- what it is made of --------------------------------------------------

    def header(self) -> str:
        """What the scene models and what it does not, with the switches that would add it: lines for
        the start of a run, with the arrays of the particles, their bytes, and the unknowns.

        A call for all ranks.

        Raises:
            SupportError: A point is held that no particle is near.
        """
        return description.header(self)

    def split(self, coefficients: Array) -> tuple[Array, Array | None]:
        """Coefficients of the displacement and of the bilinear field (None if there is none).

        Raises:
            InputError: Not the coefficients of all fields.
        """
        return self.attached.field.layout.split(self._coefficients(coefficients))

    @property
    def particles_per_cell(self) -> npt.NDArray[np.int64]:
        """Number of particles in each cell, x fastest; a call for all ranks."""
        nx, ny = self.grid.cells
        counts = np.bincount(self.attached.location.cell, minlength=nx * ny)
        return ranks.sum_of(self.grid.comm, counts)

    def residual(self, coefficients: Array) -> Array:
        """The form's integrals over particles and cells, for every test function, before supports.

        Args:
            coefficients: Increments of all fields: displacement (two per function, x fastest),
                then the bilinear field, as `split` takes them apart.
        """
        return self.attached.newton.internal(self._coefficients(coefficients))

    def tangent(self, coefficients: Array) -> sp.csr_matrix:
        """Derivative of :meth:`residual` as the form's tangent gives it, before supports."""
        coefficients = self._coefficients(coefficients)
        self.attached.newton.internal(coefficients)
        return self.attached.field.unreduced_tangent(coefficients, self.attached.newton.data)

    def _coefficients(self, values: Array) -> Array:
        coefficients = checks.array("coefficients", values, 1)
        if len(coefficients) != self.num_coefficients:
            raise InputError(
                f"coefficients has {len(coefficients)} entries: expected {self.num_coefficients}, the "
                "num_coefficients of this scene"
            )
        return coefficients

    @property
    def num_coefficients(self) -> int:
        """Number of coefficients of all fields, supports and empty cells included."""
        size: int = self.attached.field.layout.size
        return size

    # -- steps ---------------------------------------------------------------

    def solve(self) -> Solution:
        """Find equilibrium under the present supports and loads, and store it in the particles.

        May be called again after more supports or loads were added.

        Raises:
            SupportError: Supports that leave a rigid motion free or contradict each other.
            ConvergenceError: Newton did not converge; the particles are as they were.
            SingularError: The tangent cannot be solved; the message names the cells.
            InputError: NaN or infinity in an array of the particles, a particle that would leave the
                grid, or a support with a velocity.
        """
        return self.solve_part(1.0)

    def solve_part(self, part: float) -> Solution:
        """As :meth:`solve`, under this share of the loads and prescribed displacements that are new
        since all of them were solved for; `ramp` takes it from 0 to 1.
        """
        for support in self.supports.all:
            if support.velocity is not None:
                raise InputError(
                    f"{support} has a velocity, and solve() knows no time: expected a value, or "
                    "Dynamics(scene)"
                )
        if not self._looked_at:
            coverage.warn(self.attached, self.particles.volume)
            self._looked_at = True
        return self.advance(lambda: self.problem(part), done=lambda: self.carry(part))

    def problem(self, part: float = 1.0) -> Problem:
        """The static problem under this share of what is new, in the present states of the walls."""
        start = np.zeros_like(self._total) if self._finite else self._total

        def amount(support: Support) -> float:
            return support.at(part) - (support.applied if self._finite else 0.0)

        with self.stopwatch("set-up"):
            ways = self.supports.stay_on_edges(amount) if self._finite else {}
            reduction = self.supports.reduction(
                self.attached, amount, start, self.gap, moving=False
            )
            return Problem(reduction, self.external(part), ways=ways)

    @property
    def gap(self) -> Array:
        """Coefficients since the start of the scene where particles do not move, 0 where they do."""
        return np.zeros_like(self._total) if self._finite else self._total

    def carry(self, part: float) -> None:
        """This share of what was new is what the scene bears now."""
        for support in self.supports.all:
            support.applied = support.at(part)
        if part == 1.0:
            self.accept(1.0)

    def accept(self, part: float) -> None:
        """What is new from now on is what is missing to all of the loads and prescribed values, of
        which this share is there.
        """
        for support in self.supports.all:
            support.carried = support.at(part)
        self.loads.accept(part)

    def external(self, part: float = 1.0) -> Array:
        """External forces on all coefficients [N per metre depth]."""
        return self.loads.external(self.attached, self.particles, lambda: self.mass, part)

    @contextmanager
    def tolerance_of(self, tolerance: float) -> Iterator[None]:
        """Newton's tolerance within a block."""
        before = self.numerics
        try:
            self.numerics = self.attached.newton.numerics = replace(before, tolerance=tolerance)
            yield
        finally:
            self.numerics = self.attached.newton.numerics = before

    def advance(
        self,
        problem: Callable[[], Problem],
        also: Callable[[Accepted], Callable[[float], None]] | None = None,
        time: float = np.nan,
        done: Callable[[], None] = lambda: None,
    ) -> Solution:
        """One step: find it, store it in the particles, move them where strains are finite. Ctrl-C ends
        it before anything is stored, or after all of it is.

        Args:
            problem: Makes the problem for the present states of the walls.
            also: Gets the step and returns what stores it elsewhere, called with what the laws
                dissipate [J per metre depth] after the particles have their stress and before they
                move; what may fail comes first.
            time: At its end [s].
            done: What else belongs to a step that is stored.
        """
        check_process()
        with ranks.raise_together(self.grid.comm):
            self.particles.check()
        for option in self._whole_cells:
            self.attached.warn_of_parts(self.particles.volume, option)
        walls = [copy.deepcopy(wall.state) for wall in self.supports.walls]
        committed = False
        try:
            step, settled = self._settled(problem)
            u = self.split(step.coefficients)[0].reshape(-1, 2)
            moved = None
            if self._finite:
                moved = np.asarray(self.particles.x + self.attached.at_particles(u))
                stop = self._leaving == "stop"
                placement.check_staying(self.grid, self.particles, moved, time, stop=stop)
            n = u.size
            forces = step.forces[:n]
            inertia = settled.inertia
            smooth = forces if inertia is None else forces - inertia.impulse
            a = None if step.acceleration is None else step.acceleration.reshape(-1, 2)
            accepted = Accepted(step, u, a, forces.reshape(-1, 2), smooth.reshape(-1, 2))
            store = also(accepted) if also is not None else None
            with signals.deferred():
                with self.stopwatch("commit"), ranks.raise_together(self.grid.comm):
                    dissipated = self.attached.stage.commit(*self.split(step.coefficients))
                committed = True
                if store is not None:
                    store(dissipated)
                solution = self._stored(settled, step, u, moved, time)
                done()
                return solution
        except BaseException:  # Ctrl-C too
            if not committed:
                for wall, state in zip(self.supports.walls, walls, strict=True):
                    wall.state = state
            raise

    def _stored(
        self, settled: Problem, step: Converged, u: Array, moved: Array | None, time: float
    ) -> Solution:
        """The scene after a step that the laws have accepted: where particles move, they do."""
        self.begun = True
        if moved is None:
            self._total = self._total + step.coefficients
            return Solution(self, step, settled.reduction, self._total)
        self.supports.follow(u, settled.reduction.points)
        for number, way in settled.ways.items():
            self.supports.all[number].way = way
        self.particles.move_to(moved)
        solution = Solution(self, step, settled.reduction, step.coefficients)
        self.particles, gone = placement.removed(self.grid, self.particles)
        self.left += [(number, x, time) for number, x in gone]
        self.particles, location = placement.migrated(self.grid, self.particles)
        self.attached = self._attach(location)
        return solution

    def state(self) -> dict[str, Any]:
        """All that it carries from one step to the next, of all ranks, for a checkpoint; a call for all
        ranks.
        """
        return {
            "particles": placement.gathered(self.grid, self.particles),
            "total": self._total,
            "left": self.left,
            "looked_at": self._looked_at,
            "supports": self.supports.state(),
            "loads": self.loads.state(),
            "newton": self.attached.newton.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, of a scene that was made in the same way; a call for all ranks.

        Raises:
            CheckpointError: Particles with other arrays.
        """
        self.particles, location = placement.scattered(
            self.grid, self.particles, state["particles"], moving=self._finite
        )
        self._total = state["total"]
        self.left = [(number, (x, y), time) for number, (x, y), time in state["left"]]
        self._looked_at, self.begun = state["looked_at"], True
        self.supports.restore(state["supports"])
        self.loads.restore(state["loads"])
        self.attached = self._attach(location)
        self.attached.newton.keep()
        self.attached.newton.restore(state["newton"])

    def _settled(self, problem: Callable[[], Problem]) -> tuple[Converged, Problem]:
        """A step in which no wall pulls, is passed through, or gives more friction than it has."""
        newton, supports, step = self.attached.newton, self.supports, None
        active = self.attached.layout.active[: self.attached.layout.num_displacement : 2]
        friction = supports.friction if supports.walls else None
        n = self.attached.layout.num_displacement
        gap = self.gap[:n].reshape(-1, 2)
        for wall in supports.walls:
            wall.begin()
        for _ in range(PASSES):
            now = problem()
            guess = now.guess if step is None else step.coefficients
            found = newton.solve(now.reduction, now.external, now.inertia, guess, friction)
            if step is not None:
                history, krylov = step.history + found.history[1:], step.krylov + found.krylov
                found = replace(found, history=history, krylov=krylov)
            step = found
            forces, u = (part[:n].reshape(-1, 2) for part in (step.forces, step.coefficients))
            if not supports.adapt(forces, u, gap, active):
                return step, now
        assert step is not None
        raise ConvergenceError(
            f"contact and friction of the walls did not settle in {PASSES} solves. Nothing was changed "
            "in the particles. Take a smaller step",
            step.history,
        )
