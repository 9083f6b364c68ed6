"""A scene: particles on a grid, a weak form, supports and loads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from tawami import _rust
from tawami.base import checks, html
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.process import Unique, check_process
from tawami.base.sealed import Sealed, Settings
from tawami.base.timing import Stopwatch
from tawami.body.body import Body
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.support import Support
from tawami.domain.border import SceneBorder
from tawami.domain.model import build
from tawami.domain.sources import Source
from tawami.field.reduction import Reduction
from tawami.form.form import Form
from tawami.form.symbols import Assembly
from tawami.grid.basis import Basis
from tawami.grid.grid import Grid
from tawami.particles import assignment
from tawami.scene import description, initial
from tawami.scene.absent import Elsewhere
from tawami.scene.conditions import Conditions
from tawami.scene.construction import Construction
from tawami.scene.solution import Solution
from tawami.solve.numerics import Factorise, Numerics, SolverName
from tawami.step.configuration import Configuration
from tawami.step.statics import StaticStep
from tawami.step.step import StepKind


class Scene(Conditions, Construction, Elsewhere, Sealed, Unique):
    """Particles on a grid with a weak form, supports and loads.

    By itself it is static; `ramp` applies its loads in steps, `Dynamics` sets it in motion. With a
    form of finite strain every step moves the particles and resets the grid; their stress is then
    Kirchhoff's.

    Args:
        grid: The background grid.
        body: Positions and volumes of the particles, as `box(...)`, or `Body(x, volume)`, which is the
            same on every rank.
        material: The material law, in Rust or a `NumpyLaw`, or several as a list or, by the names of
            the body, as a dictionary.
        material_of: Number of the law of each particle; that of the body by default.
        form: Weak form: the name of a shipped one ('u_epsv', 'u_p', 'u_bbar', 'u'), the path of a
            file, a module, or a `Form`.
        basis: Basis of the displacement: 'quadratic_spline', 'bilinear' or 'biquadratic'.
        tolerance, max_iterations, assembly, factorise, linear_solver: Numerical settings; see
            `tawami.solve.numerics.Numerics`.
        density: Mass density at the start [kg/m3], one for all materials or one each (a list or a
            dictionary as for the materials); gravity needs it.
        leaving: Treatment of particles that leave the grid: 'stop' with an error before they do, or
            'remove' them; `left` lists them.
        volumes: Volumes in the integrals of the form. 'full_cells': those of the particles, corrected at
            small strain so that polynomials are integrated exactly over full cells with 9 particles or
            more; 'own': those of the particles; 'fitted': also corrected so that the divergence theorem
            holds for the functions of the grid. Masses stay.
        parameters: Parameters and options of the form: alpha, stabilisation, ... A parameter is a
            number, a function of time [s], or one number for each particle: a function f(x, y), an
            array, `tawami.table(...)` or `tawami.earlier(...)`.

    Attributes:
        grid, form, basis: As given.
        numerics: Numerical settings of a step.
        options: Of the form. They cannot be changed.
        num_particles: Number of particles of the body, on all ranks.
        stopwatch: Time of each stage of a step.
        configuration: Particles, supports and loads as the solver sees them. Its attributes may change
            between versions.

    Raises:
        InputError: Particles outside the grid, a body without particles, NaN, an incompressible
            material with a form that cannot take it, a parameter that is unknown or without effect.
        FormError: A form that cannot be used.

    Warns:
        LockingWarning: A form without a field for the volume, and a nearly incompressible material.
        InstabilityWarning: When solving: partially filled cells, and an option that needs whole ones.
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
        assembly: Assembly = "points",
        factorise: Factorise = "when_it_pays",
        linear_solver: SolverName = "auto",
        density: float | Sequence[float] | Mapping[str, float] | None = None,
        leaving: Literal["stop", "remove"] = "stop",
        volumes: Literal["full_cells", "own", "fitted"] = "full_cells",
        **parameters: Any,
    ) -> None:
        check_process()
        numerics = Numerics(tolerance, max_iterations, assembly, factorise, linear_solver)
        model, particles = build(
            grid,
            body,
            material,
            material_of,
            form,
            basis,
            density,
            leaving,
            volumes,
            assembly,
            parameters,
        )
        self.configuration = Configuration(model, particles, numerics)
        self.grid, self.form, self.basis = model.grid, model.form, model.basis
        self.options = model.options
        self.num_particles = model.num_particles
        self.stopwatch: Stopwatch = self.configuration.stopwatch
        self._seal()

    def _how_to_set(self, name: str) -> str:
        """Advice for an attribute that cannot be set."""
        if name in self.form.parameters:
            return f"expected scene.parameter('{name}', ...), between two steps"
        if name in self.form.options:
            return f"the form's parameters are fixed when a scene is made: Scene(..., {name}=...)"
        if name == "particles":
            return "write into its arrays, as scene.particles.stress[:] = ..., or use scene.initial(...)"
        return "a scene is given by Scene(...) and changed by its methods (fix, traction, gravity, ...)"

    def __repr__(self) -> str:
        nx, ny = self.grid.cells
        return (
            f"Scene({self.num_particles} particles on {nx} x {ny} cells of {self.grid.h:g} m, form "
            f"{self.form.name}, {', '.join(dict.fromkeys(self.configuration.model.laws))})"
        )

    def _repr_html_(self) -> str:
        return html.table(f"Scene at {self.time:g} s", description.lines(self.configuration))

    # -- the body ------------------------------------------------------------

    @property
    def particles(self) -> _rust.Particles:
        """The particles on this rank: those in its cells.

        Their arrays are views of the storage, not copies: `x` [m], `material` and `number` (which of
        the body they are), which cannot be written, `volume` [m2], `stress` [Pa] (xx, yy, zz, xy;
        tension positive), `displacement` [m], and `eps_v` with forms that have that field. `strain`, as
        in `Solution`, and at finite strain `displacement_gradient` (F - I) are read only. Where
        particles change rank or leave the grid this is another object after a step, and always after
        `remove` and `change_material`.
        """
        return self.configuration.domain.particles

    @property
    def border(self) -> SceneBorder:
        """The border of the body: its `names`, and its points with their positions `x` [m]."""
        return self.configuration.border

    @property
    def left(self) -> list[tuple[int, tuple[float, float], float]]:
        """Number, position [m] and time [s] (NaN in a static scene) of the particles that left the grid
        or were removed.
        """
        return self.configuration.left

    @property
    def numerics(self) -> Numerics:
        """Numerical settings of a step."""
        return self.configuration.numerics

    @property
    def laws(self) -> list[str]:
        """Names of the material laws, each with its history variables."""
        return self.configuration.model.laws

    @property
    def mass(self) -> Array:
        """Mass of each particle [kg per metre depth].

        Raises:
            InputError: The scene has no density.
        """
        return self.configuration.domain.mass

    @property
    def particles_per_cell(self) -> npt.NDArray[np.int64]:
        """Number of particles in each cell, x fastest; a call for all ranks."""
        domain = self.configuration.domain
        return domain.layout.window.whole(domain.particles_per_cell)

    def initial(self, name: str, source: Source, *, beyond: initial.Beyond = "stop") -> None:
        """Give the particles an initial field, before anything is solved; loads and supports act on
        top of it. A call for all ranks.

        'stress' is the stress from which the laws start: (xx, yy, zz, xy) [Pa], Kirchhoff's per V0 at
        finite strain. With a field eps_v it sets this too, to sigma_m / K, the elastic part. 'eps_v'
        (larger than this part, by plastic strain; or 0: counted from this state) and 'displacement' [m]
        are records that enter no equation: positions stay. History variables of the laws have their own
        names.

        Args:
            name: 'stress', 'displacement', 'eps_v', a history variable, or a field of
                the form without a role, as 'p_w'.
            source: Numbers, the same for all or one row a particle of the body; a function f(x, y) on
                arrays that returns the components; `tawami.table(...)` or `tawami.earlier(...)`.
            beyond: Treatment of stress beyond the yield surface: 'stop' with an error, or 'return'
                it to the surface as the law does.

        Raises:
            InputError: An unknown name, another shape, a number that is not finite, stress beyond the
                yield surface, eps_v that does not fit an elastic stress, or a scene that was solved.
        """
        with self.configuration.activity.step("initial(...)"):
            initial.set_field(self.configuration, name, source, beyond)

    def data(self, name: str, source: Source) -> None:
        """Give the particles data that the form declares; a call for all ranks, also between steps.

        Args:
            name: As in `data` of the form.
            source: Numbers, in the unit that the form declares: one for all or one for each particle of
                the body; a function f(x, y) on arrays of present positions; `tawami.table(...)` or
                `tawami.earlier(...)`. Particles that move keep their number.

        Raises:
            InputError: An unknown name, another shape, or a number that is not finite.
        """
        self.configuration.activity.check_between_steps("data(...)")
        self.configuration.inputs.set_data(self.configuration.domain, name, source)

    def parameter(self, name: str, value: float | Callable[[float], float] | Source) -> None:
        """Change a parameter of the form from the next step on, without compiling again.

        A call for all ranks.

        Args:
            name: Of the parameter.
            value: A number or a function of time [s]. For a scene that was made with one number for each
                particle, a source as in :meth:`data`.

        Raises:
            InputError: An unknown or unused parameter, or a value beyond its limits.
        """
        self.configuration.activity.check_between_steps("parameter(...)")
        self.configuration.inputs.set_parameter(self.configuration.domain, name, value)

    @property
    def parameters(self) -> Settings[float]:
        """Parameters of the form that are numbers, as they are used; :meth:`parameter` changes them."""
        return self.configuration.inputs.parameters

    # -- solving -------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time at the end of the last phase of statics with `until`, or of the last dynamic step [s]."""
        return self.configuration.activity.time

    def solve(self, *, until: float | None = None) -> Solution:
        """Find equilibrium under the present supports and loads, and store it in the particles.

        It may be called again after supports or loads were added or changed.

        Args:
            until: Time for amplitudes [s], from the time of the scene on; that time by default.

        Raises:
            SupportError: Supports that leave a rigid motion free or contradict each other.
            ConvergenceError: Newton did not converge; the particles are unchanged.
            SingularError: The tangent cannot be solved; the message names the cells.
            SolverError: Memory for the linear system ran out.
            InputError: NaN or infinity in an array of the particles, a particle that would leave the
                grid, a support with a velocity, an earlier time, or a call from within a step.
        """
        return self.solve_part(1.0, until)

    def solve_part(self, part: float, until: float | None = None) -> Solution:
        """Find equilibrium under a part, from 0 to 1, of the loads and prescribed displacements that
        are new since the last full solve, as :meth:`solve` does; `ramp` takes it from 0 to 1.
        """
        now = self.configuration.moment(part, until)
        return self.advanced(StaticStep(self.configuration, now))

    def advanced(self, kind: StepKind) -> Solution:
        """Take a static step, as :meth:`solve` does."""
        with self.configuration.activity.step("solve()"):
            now = self.configuration
            actions: list[Support | Obstacle] = [*now.supports.all, *now.obstacles.all]
            for support in actions:
                if support.has_velocity:
                    raise InputError(
                        f"{support} has a velocity, which static steps do not follow: expected a value, "
                        "with amplitude=... and until=... if it changes in time, or Dynamics(scene)"
                    )
            self.configuration.check_coverage()
            return Solution(self, self.configuration.advance(kind))

    def header(self) -> str:
        """Lines for the start of a run: what the scene models and what it does not, with the switches
        that would add it, the arrays of the particles, their bytes, and the unknowns.

        A call for all ranks.

        Raises:
            SupportError: A point is held that no particle is near.
        """
        return description.header(self.configuration)

    # -- as the subject of a run ---------------------------------------------

    @property
    def scene(self) -> Scene:
        """Itself: observers find the scene in the same way in a scene and in its `Dynamics`."""
        return self

    @property
    def motion(self) -> None:
        """None: a scene by itself is static."""

    def identity(self) -> dict[str, Any]:
        """Facts that identify the scene, for checkpoints; a call for all ranks."""
        return self.configuration.identity()

    def state(self) -> dict[str, Any]:
        """State that passes from one step to the next, for checkpoints; a call for all ranks."""
        return self.configuration.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`; a call for all ranks.

        Raises:
            CheckpointError: Particles with other arrays.
        """
        self.configuration.restore(state)

    # -- the discrete problem ------------------------------------------------

    @property
    def num_coefficients(self) -> int:
        """Number of coefficients of all fields, supports and empty cells included."""
        return self.configuration.domain.layout.size_of_grid

    def split(self, coefficients: Array) -> tuple[Array, Array | None]:
        """Coefficients of the displacement, and of eps_v or p (None if the form has neither).

        Raises:
            InputError: Not the coefficients of all fields.
        """
        given, layout = self._coefficients(coefficients), self.configuration.domain.layout
        names = [name for name, place in layout.fields.items() if place is layout.volumetric]
        volumetric = given[layout.of_grid[names[0]].slice] if names else None
        return given[: layout.num_displacement_of_grid], volumetric

    def reduction(self) -> Reduction:
        """Unknowns that the supports leave free: coefficients = selection @ unknowns + offset."""
        return StaticStep(self.configuration, self.configuration.moment()).problem().reduction

    def residual(self, coefficients: Array, *, dt: float | None = None) -> Array:
        """The form's integrals over particles, cells and border, for every test function.

        Loads, supports and obstacles are not included, nor their forces on the border.

        Args:
            coefficients: Increments of all fields one after the other, in the order of the form; each
                with its components for every function, x fastest.
            dt: Length of the step [s], for a form that reads it.

        Raises:
            InputError: The form reads data that the scene does not have, or dt, and it is not given.
        """
        self.configuration.activity.check_between_steps("residual(...)")
        self.configuration.prepare(self.configuration.moment(), dt)
        domain, given = self.configuration.domain, self._coefficients(coefficients)
        return domain.layout.whole(domain.newton.internal(domain.layout.part(given)))

    def tangent(self, coefficients: Array, *, dt: float | None = None) -> sp.csr_matrix:
        """Derivative of :meth:`residual` as the form's tangent gives it, without loads and supports."""
        self.configuration.activity.check_between_steps("tangent(...)")
        self.configuration.prepare(self.configuration.moment(), dt)
        domain = self.configuration.domain
        coefficients = domain.layout.part(self._coefficients(coefficients))
        domain.newton.internal(coefficients)
        return domain.assembly.unreduced_tangent(coefficients, domain.responses.data)

    def _coefficients(self, values: Array) -> Array:
        coefficients = checks.array("coefficients", values, 1)
        if len(coefficients) != self.num_coefficients:
            raise InputError(
                f"coefficients has {len(coefficients)} entries: expected {self.num_coefficients}, the "
                "num_coefficients of this scene"
            )
        return coefficients
