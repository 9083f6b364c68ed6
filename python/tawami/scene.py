"""A scene: particles on a grid, a weak form, supports and loads; what a driver script builds."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from tawami import _rust, boundary, inputs, ranks
from tawami.basis import BASES, Basis
from tawami.body import Body
from tawami.boundary import Component, Profile
from tawami.compilation import compile_form
from tawami.errors import InputError, SupportError
from tawami.fast_field import FastField
from tawami.field import Field
from tawami.formulation import Form
from tawami.grid import Edge, Grid
from tawami.newton import Converged, History, Inertia, Newton
from tawami.numpy_law import NumpyLaw, NumpyStage
from tawami.reduction import Reduction
from tawami.stopwatch import Stopwatch

Array = npt.NDArray[np.float64]
FIELDS: dict[str, type[Field]] = {"fast": FastField, "reference": Field}


class Scene:
    """A static scene.

    With a form of finite strain every `solve` is one step: the particles move, the grid is reset, and
    what supports prescribe are displacements of the step. Their stress is Kirchhoff's then.

    Args:
        grid: The background grid.
        body: Positions and volumes of the particles, as `box(...)` or `Body(x, volume)`; the same on
            every rank.
        material: The material law, or several; or one `NumpyLaw` for all particles.
        material_of: Number of the law of each particle; the first for all by default.
        form: Weak form: the name of a shipped one ('u_epsv', 'u_p', 'u_bbar', 'u'), the path of a
            file, a module, or a `Form`.
        basis: Basis of the displacement: 'quadratic_spline', 'bilinear' or 'biquadratic'.
        tolerance: Newton stops when both measures of `tawami.newton` are below it.
        max_iterations: Newton iterations before the step is given up.
        assembly: 'fast', kernels called from Rust, or 'reference', dolfinx and P^T K P: the same
            numbers to round-off.
        density: Mass density at the start [kg/m3], one for all materials or one each; gravity needs it.
        parameters: What the form names: alpha, stabilisation, ...

    Attributes:
        particles: The particles on this rank: those in its cells; `number` says which of the body
            they are. Their arrays are views of the storage, not copies: `x` [m], `material` and
            `number`, which cannot be written, `volume` [m2], `stress` [Pa] (xx, yy, zz, xy; tension
            positive), `displacement` [m], and `eps_v` with forms that have that field (None
            otherwise).
        num_particles: Number of particles of the body, on all ranks.

    Raises:
        InputError: Particles outside the grid, a body without particles, NaN, an incompressible
            material with a form that cannot take it, an unknown parameter.
        FormError: A form that cannot be used as it stands.
    """

    def __init__(
        self,
        grid: Grid,
        body: Body,
        material: _rust.Material | Sequence[_rust.Material] | NumpyLaw,
        *,
        material_of: npt.ArrayLike | None = None,
        form: str | Path | ModuleType | Form = "u_epsv",
        basis: Basis = "quadratic_spline",
        tolerance: float = 1e-6,
        max_iterations: int = 20,
        assembly: Literal["fast", "reference"] = "fast",
        density: float | Sequence[float] | None = None,
        **parameters: Any,
    ) -> None:
        if basis not in BASES:
            raise InputError(f"basis '{basis}': expected one of {', '.join(map(repr, BASES))}")
        if assembly not in FIELDS:
            raise InputError(f"assembly = {assembly!r}: expected 'fast' or 'reference'")
        if not isinstance(grid, Grid) or not isinstance(body, Body):
            raise InputError(
                f"Scene({type(grid).__name__}, {type(body).__name__}, ...): expected a tawami.Grid and "
                "a tawami.Body"
            )
        tolerance = inputs.number("tolerance", tolerance, low=1e-14, high=0.1)
        max_iterations = inputs.whole_number("max_iterations", max_iterations, low=1)
        self.grid, self.basis = grid, basis
        self.form = Form.load(form)
        values, options = self.form.settings(parameters)
        law = None
        if isinstance(material, NumpyLaw):
            law, material = material, material.elastic()
        many = isinstance(material, Sequence)
        materials: list[_rust.Material] = list(material) if many else [material]  # type: ignore[list-item, arg-type]
        if not materials or not all(isinstance(m, _rust.Material) for m in materials):
            raise InputError(
                f"material = {material!r}: expected a material as linear_elastic(...) makes it, a "
                "list of these, or a NumpyLaw"
            )
        x, volume = inputs.array("x", body.x, 2), inputs.array("volume", body.volume, 1)
        numbers = np.zeros(len(x)) if material_of is None else material_of
        numbers = inputs.numbering("material_of", numbers, len(x))
        whole = _rust.Particles(x, volume, numbers)
        whole.check_materials(materials, self.form.kinematics, self.form.strain == "finite")
        whole.add_history(materials)
        self._distribute(whole, grid.rust.locate(whole.x))
        self._compiled = compile_form(grid.comm, self.form, options)
        if self.form.kinematics == "mixed":
            self.particles.add_eps_v()
        self._finite = self.form.strain == "finite"
        if self._finite and law is not None:
            raise InputError(
                f"form {self.form.name} has finite strains: expected a law in Rust, a NumpyLaw has "
                "small ones only"
            )
        if self._finite and grid.comm.size > 1:
            raise InputError(
                f"form {self.form.name} has finite strains, with which particles move: expected one "
                "rank for now"
            )
        moduli = np.array([(m.bulk_modulus, m.shear_modulus) for m in materials])
        of_particle = moduli[self.particles.material]
        self._constants = {"K": of_particle[:, 0], "mu": of_particle[:, 1]}
        self._density = None
        if density is not None:
            given = list(density) if isinstance(density, Sequence) else [density] * len(materials)
            if len(given) != len(materials):
                raise InputError(
                    f"density has {len(given)} values: expected one, or one for each of the "
                    f"{len(materials)} materials"
                )
            each = np.array([inputs.number("density", rho, low=0.0) for rho in given])
            self._density = each[self.particles.material]
        self._materials, self._law, self._values = materials, law, values
        self._side, self._limits = FIELDS[assembly], (tolerance, max_iterations)
        self.stopwatch = Stopwatch()
        self._field, self._stage, self._newton = self._attached(self._location)
        self._gravity = (0.0, 0.0)
        self._edges: list[tuple[Edge, int, Profile]] = []
        self._points: list[tuple[Sequence[float], int, float]] = []
        self._tractions: list[tuple[Edge, Profile, Profile]] = []
        self._total = np.zeros(self._field.layout.size)

    def _attached(self, location: _rust.Location) -> tuple[Field, _rust.Stage | NumpyStage, Newton]:
        """Field side, laws and Newton's method for the particles in these places."""
        tolerance, max_iterations = self._limits
        with self.stopwatch("set-up"):
            field = self._side(
                self.grid, self._compiled, self.basis, location, self.particles.volume,
                self._values, self.stopwatch,
            )  # fmt: skip
        kinematics, law = self.form.kinematics, self._law
        rust = _rust.Stage(
            self.particles, location, self._materials, kinematics, self._finite, self.basis
        )
        stage = rust if law is None else NumpyStage(rust, self.particles, law)
        newton = Newton(
            field, self._compiled, stage, self.particles, location, self._constants, self.stopwatch,
            tolerance=tolerance, max_iterations=max_iterations,
        )  # fmt: skip
        return field, stage, newton

    def _distribute(self, body: _rust.Particles, location: _rust.Location) -> None:
        """Keep the particles in this rank's cells."""
        self.num_particles = len(body)
        self.particles, self._location = body, location
        if self.grid.comm.size > 1:
            parts = (body.x, body.volume, body.material)
            digest = hashlib.sha1(b"".join(part.tobytes() for part in parts)).digest()
            if len(set(self.grid.comm.allgather(digest))) > 1:
                raise InputError(
                    "the body is not the same on all ranks: expected the same positions, volumes and "
                    "materials on each. Give random numbers a seed, or make it on one rank and bcast it"
                )
            here = self.grid.rank_of_cell[location.cell] == self.grid.comm.rank
            mine = np.flatnonzero(here).astype(np.uint32)
            self.particles, self._location = body.select(mine), location.select(mine)

    def fix(self, edge: Edge, component: Component, value: Profile = 0.0) -> None:
        """Prescribe a displacement component along an edge of the grid.

        Args:
            edge: 'left', 'right', 'bottom' or 'top'.
            component: 'x' or 'y'.
            value: Displacement [m] from the start: a number, or a function f(x, y) on arrays,
                which is projected in L2 on the functions of the edge.

        Raises:
            InputError: An unknown edge or component.
        """
        self.grid.edge(edge)
        self._edges.append((edge, boundary.component_index(component), value))

    def hold(self, point: Sequence[float], component: Component, value: float = 0.0) -> None:
        """Prescribe a displacement component at a point: a constraint on the interpolated value.

        Args:
            point: Position (x, y) [m].
            component: 'x' or 'y'.
            value: Displacement [m] from the start.

        Raises:
            InputError: A point outside the grid, or an unknown component.
        """
        what = f"hold(point={point})"
        boundary.locate_point(self.grid, point, what)
        held = inputs.number(f"{what}: value", value)
        self._points.append((point, boundary.component_index(component), held))

    def traction(self, edge: Edge, value: tuple[Profile, Profile]) -> None:
        """Load an edge of the grid where the body touches it.

        Args:
            edge: 'left', 'right', 'bottom' or 'top'.
            value: Traction (t_x, t_y) [Pa]: numbers, or functions f(x, y) on arrays, taken at the
                biquadratic nodes of the grid (exact up to parabolas).

        Raises:
            InputError: An unknown edge, or a form without a term `dot(t, w) * ds`.
        """
        self.grid.edge(edge)
        what = f"traction(edge='{edge}')"
        if self._compiled.traction is None:
            raise InputError(
                f"{what}: form {self.form.name} has no edge term; add "
                "- dot(t, w) * ds to its residual"
            )
        components = inputs.pair(what, value, "components (t_x, t_y)")
        self._tractions.append((edge, *components))

    def gravity(self, acceleration: Sequence[float]) -> None:
        """Load the body by its weight.

        Args:
            acceleration: (b_x, b_y) [m/s2], in place of what was set before.

        Raises:
            InputError: No density, or not two finite numbers.
        """
        if self._density is None:
            raise InputError("gravity(...) needs Scene(..., density=...) [kg/m3]")
        self._gravity = inputs.point("gravity", acceleration)

    def _weight(self) -> Array:
        """External forces on all coefficients of the weight, sum_p N_i m_p b."""
        force = np.zeros(self._field.layout.size)
        if self._density is not None and any(self._gravity):
            data = self._density[:, None] * np.array(self._gravity)
            sums = _rust.nodal_sums(self._location, self.particles.volume, data, self.basis)
            force[: self._field.layout.num_displacement] = sums.ravel()
        return ranks.sum_of(self.grid.comm, force)

    def _reduction(self, *, moving: bool = False) -> Reduction:
        """What the supports leave free; a moving body may have left one, and may turn freely."""
        field = self._field
        held = [
            boundary.held_edge(self.grid, self.basis, field.active, edge, component, value)
            for edge, component, value in self._edges
            if not moving or len(field.edge_nodes(edge))
        ]
        points = [
            boundary.held_point(self.grid, self.basis, field.active, point, component, value)
            for point, component, value in self._points
        ]
        return Reduction(field.layout, held, points, self._total, moving=moving)

    def _external(self) -> Array:
        force = self._weight()
        for edge, *components in self._tractions:
            nodes = self._field.edge_nodes(edge)
            if len(nodes) == 0:
                raise SupportError(
                    f"traction(edge='{edge}'): no cell along that edge of the grid holds "
                    "particles; let the grid end where the body is loaded"
                )
            x, y = nodes[..., 0].ravel(), nodes[..., 1].ravel()
            what = f"traction(edge='{edge}')"
            values = [boundary.evaluate(c, x, y, what) for c in components]
            force += self._field.traction(edge, np.stack(values, axis=-1).reshape(nodes.shape))
        return force

    def split(self, coefficients: Array) -> tuple[Array, Array | None]:
        """Coefficients of the displacement and of the bilinear field (None if there is none)."""
        return self._field.layout.split(coefficients)

    @property
    def particles_per_cell(self) -> npt.NDArray[np.int64]:
        """Number of particles in each cell, x fastest; a call for all ranks."""
        nx, ny = self.grid.cells
        counts = np.bincount(self._location.cell, minlength=nx * ny)
        return ranks.sum_of(self.grid.comm, counts)

    def residual(self, coefficients: Array) -> Array:
        """The form's integrals over particles and cells, for every test function, before supports.

        Args:
            coefficients: Increments of all fields: displacement (two per function, x fastest),
                then the bilinear field, as `split` takes them apart.
        """
        return self._newton.internal(self._coefficients(coefficients))

    def tangent(self, coefficients: Array) -> sp.csr_matrix:
        """Derivative of :meth:`residual` as the form's tangent gives it, before supports."""
        coefficients = self._coefficients(coefficients)
        self._newton.internal(coefficients)
        return self._field.unreduced_tangent(coefficients, self._newton.data)

    def _coefficients(self, values: Array) -> Array:
        coefficients = inputs.array("coefficients", values, 1)
        if len(coefficients) != self.num_coefficients:
            raise InputError(
                f"coefficients has {len(coefficients)} entries: expected {self.num_coefficients}, the "
                "num_coefficients of this scene"
            )
        return coefficients

    @property
    def num_coefficients(self) -> int:
        """Number of coefficients of all fields, supports and empty cells included."""
        size: int = self._field.layout.size
        return size

    def solve(self) -> Solution:
        """Find equilibrium under the present supports and loads, and store it in the particles.

        May be called again after more supports or loads were added.

        Raises:
            SupportError: Supports that leave a rigid motion free or contradict each other.
            ConvergenceError: Newton did not converge; the particles are as they were.
            SingularError: The tangent cannot be solved; the message names the cells.
            InputError: NaN or infinity in an array of the particles.
        """
        with ranks.together(self.grid.comm):
            self.particles.check()
        with self.stopwatch("set-up"):
            reduction = self._reduction()
            external = self._external()
        return self._advance(reduction, external)

    def _advance(
        self,
        reduction: Reduction,
        external: Array,
        inertia: Inertia | None = None,
        guess: Array | None = None,
        also: Callable[[Array], Callable[[], None]] | None = None,
    ) -> Solution:
        """One step: find it, store it in the particles, move them where strains are finite.

        What may fail comes before anything changes; `also` gets the increments of the displacement
        and returns what is to be stored besides.
        """
        step = self._newton.solve(reduction, external, inertia, guess)
        fields = self._field.layout.split(step.coefficients)
        if self._finite:
            moved = self.particles.x + _rust.interpolate(self._location, self.basis, 2, fields[0])
            location = self.grid.rust.locate(moved)
            attached = self._attached(location)
        store = also(fields[0]) if also is not None else None
        with self.stopwatch("commit"), ranks.together(self.grid.comm):
            self._stage.commit(*fields)
        if store is not None:
            store()
        solution = Solution(self, step, reduction.size, self._total + step.coefficients)
        if self._finite:
            self.particles.move_to(moved)
            self._location = location
            self._field, self._stage, self._newton = attached
        else:
            self._total = self._total + step.coefficients
        return solution


class Solution:
    """Equilibrium of a scene. On several ranks all of it is on every rank, and arrays of particles
    are in the order of the body.

    Attributes:
        scene: What was solved.
        u: Coefficients of the displacement [m] since the start, two per function, x fastest.
        volumetric: Coefficients of eps_v, or of p [Pa]; None with forms that have neither.
        unknowns: Number of reduced unknowns.
        iterations: Newton iterations of the last step.
        history: (momentum, volume) measures of every residual of the last step.
        krylov: FGMRES iterations of every linear solve of the last step; 0 where the tangent was
            factorised.
        x: Positions of the particles [m].
        volume: Their volumes [m2].
        stress: Their stress [Pa] (xx, yy, zz, xy), as it was when this was solved.
        displacement_of_particles: Their displacement [m] since the start.
        eps_v: Their volumetric strain; None with forms that do not have it.
        condition: Estimate of the condition number of the tangent last factorised, scaled: its
            Frobenius norm over the square root of its size, times that of its inverse as random
            vectors show it.
        symmetric: Whether that tangent was symmetric.
    """

    def __init__(self, scene: Scene, step: Converged, unknowns: int, total: Array) -> None:
        self.scene = scene
        self.u, self.volumetric = scene.split(total)
        self.unknowns, self.iterations = unknowns, step.iterations
        self.history: History = step.history
        self.krylov = tuple(step.krylov)
        self.condition, self.symmetric = step.condition, step.symmetric
        particles, comm = scene.particles, scene.grid.comm
        number = ranks.joined(comm, particles.number)

        def whole(values: Array) -> Array:
            if comm.size == 1:
                return np.array(values)
            ordered = np.empty((len(number), *values.shape[1:]))
            ordered[number] = ranks.joined(comm, values)
            return ordered

        self.x, self.volume = whole(particles.x), whole(particles.volume)
        self.stress = whole(particles.stress)
        self.displacement_of_particles = whole(particles.displacement)
        self.eps_v = None if particles.eps_v is None else whole(particles.eps_v)

    def displacement(self, point: Sequence[float]) -> Array:
        """Displacement (u_x, u_y) [m] of the grid at a point.

        Raises:
            InputError: The point is outside the grid.
        """
        location = boundary.locate_point(self.scene.grid, point, "displacement(...)")
        value = _rust.interpolate(location, self.scene.basis, 2, self.u)[0]
        return np.asarray(value)

    @property
    def mean_stress(self) -> Array:
        """Mean stress [Pa] at the particles, (xx + yy + zz)/3, tension positive."""
        return np.asarray(self.stress[:, :3].mean(axis=1))
