"""The solution of a scene: equilibrium, or the end of a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks, html, ranks
from tawami.base.arrays import Array, of_components
from tawami.base.errors import InputError, NotModelledError
from tawami.base.process import Unique
from tawami.base.sealed import Sealed
from tawami.base.text import meant, quoted
from tawami.conditions.contact_result import ContactResult
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.walls import Wall
from tawami.domain.points import ROUND_OFF, outside
from tawami.estimate.error import ErrorEstimate, estimate
from tawami.estimate.goal import Goal
from tawami.field.constraints import LEAST_SHARE
from tawami.field.owned import Owned
from tawami.form.kinematics import KINEMATICS
from tawami.grid import edges
from tawami.particles.gathered import Gathered
from tawami.quantities import presentation, quantities
from tawami.quantities.of_all_particles import OfAllParticles
from tawami.quantities.outline import Outline
from tawami.quantities.quantities import Arrays, Given, Quantity
from tawami.scene.absent import Elsewhere
from tawami.step.configuration import Configuration
from tawami.step.outcome import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Solved(Protocol):
    """The scene of a solution."""

    @property
    def configuration(self) -> Configuration:
        """Its particles, supports and loads."""


class Solution(OfAllParticles, Elsewhere, Sealed, Unique):
    """Equilibrium of a scene, or the end of a step.

    Arrays of particles are in the order of their numbers. On several ranks a solution holds the
    particles and coefficients of this rank. An array of all (`x`, `stress`, `u`, ...) is gathered when
    it is first read, and kept: this is a call for all ranks. `own` has the particles of this rank.

    Attributes:
        scene: The scene.
        unknowns: Number of reduced unknowns.
        load: Share of the new loads and displacements that it is in equilibrium with; NaN in dynamics.
        iterations: Newton iterations of the last step.
        history: (momentum, volume) measures of every residual of the last step; with fields without a
            role, the largest of theirs as well.
        krylov: FGMRES iterations of every linear solve of the last step; 0 where the tangent was
            factorised.
        num_particles: Number of particles, on all ranks.
        own: Arrays of the particles of this rank by name, as `own.stress`.
        condition: Estimate of the condition number of the scaled tangent that was factorised last: its
            Frobenius norm over the square root of its size, times that of its inverse as random
            vectors show it.
        symmetric: Whether that tangent was symmetric.
    """

    def __init__(self, scene: Solved, outcome: Outcome) -> None:
        #: `tawami.Scene`, which is built on solutions and cannot be imported here.
        self.scene: Any = scene
        self._model = scene.configuration.model
        layout, step = outcome.accepted.problem.reduction.layout, outcome.accepted.step
        self._coefficients, self._of_grid = layout.owned(outcome.coefficients), layout.of_grid
        self._active = layout.owned(layout.active.astype(float))
        self.unknowns, self.iterations = outcome.accepted.problem.reduction.size, step.iterations
        self.load, self.history = outcome.accepted.load, step.history
        self.krylov = tuple(step.krylov)
        self.condition, self.symmetric = step.condition, step.symmetric
        self._reactions = outcome.reactions
        points, domain = scene.configuration.border.points, scene.configuration.domain
        self._outline = None if points is None else Outline(points, domain, outcome.coefficients)
        self._arrays = Gathered(self._model.grid.comm, outcome.particles)
        self.arrays = Arrays(lambda name: self._array(name, self._arrays))
        self.own = Arrays(lambda name: self._array(name, self._arrays.own))
        self.num_particles = self._arrays.num_particles
        self._seal()

    def __repr__(self) -> str:
        momentum = self.history[-1][0]
        return (
            f"Solution({self._model.form.name}: {self.num_particles} particles, "
            f"{self.unknowns} unknowns, {self.iterations} Newton iterations to {momentum:.1e})"
        )

    @property
    def coefficients(self) -> Array:
        """Coefficients of all fields, one after the other, as `u`; gathered from the ranks when they are
        first read.
        """
        return self._coefficients.whole

    @property
    def u(self) -> Array:
        """Coefficients of the displacement [m], two per function, x fastest: since the start, and of the
        last step where strains are finite; gathered as `coefficients`.
        """
        return self.coefficients[next(iter(self._of_grid.values())).slice]

    @property
    def on_edges(self) -> Array:
        """Forces of edges and walls on the body, functions x 2 [N per metre depth]; gathered as
        `coefficients`.
        """
        forces = self._reactions.on_edges.whole + self._reactions.on_walls.whole
        return forces.reshape(-1, self._model.space.dim)

    @property
    def owned(self) -> tuple[Owned, Owned, Owned]:
        """Coefficients, and forces of edges and of walls, each on its rank: for outputs."""
        return self._coefficients, self._reactions.on_edges, self._reactions.on_walls

    @property
    def volumetric(self) -> Array:
        """Coefficients of eps_v, or of p [Pa].

        Raises:
            InputError: The form has neither.
        """
        volumetric = [
            self.coefficients[self._of_grid[name].slice]
            for name, field in self._model.form.fields.items()
            if field.role in ("volumetric_strain", "pressure")
        ]
        return self._of_form("volumetric", next(iter(volumetric), None), "has_mean_stress")

    @property
    def eps_v(self) -> Array:
        """Volumetric strain of the particles.

        Raises:
            InputError: The form does not have that field.
        """
        values = self.arrays["eps_v"] if "eps_v" in self._arrays.own else None
        return self._of_form("eps_v", values, "has_eps_v")

    def field(self, name: str) -> Array:
        """A field of the form at the particles, in its unit: the value, not the increment of the step.

        Args:
            name: As in `fields` of the form: a field without a role, or eps_v.

        Raises:
            InputError: The form has no such field.
        """
        form = self._model.form
        known = [*form.own_fields, *(["eps_v"] if form.kinematics.has_eps_v else [])]
        if not checks.one_of(name, known):
            raise InputError(
                f"field({checks.shown(name)}): form {form.name} has {quoted(known) or 'no such field'}: "
                f"displacement_of_particles and stress have the rest{meant(str(name), known)}"
            )
        return self.arrays[name]

    def _array(self, name: str, of: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """An array by its name, of the particles of this rank or of all."""
        if name == "strain" and quantities.GRADIENT in self._arrays.own:
            gradient = of[quantities.GRADIENT]
            return _rust.logarithmic_strain(gradient.reshape(len(gradient), -1))
        if name not in self._arrays.own:
            with quantities.not_modelled():  # the error says how to model it
                quantities.array_of(self.scene.particles, name)
            raise NotModelledError(
                f"{name}: this solution is older than this quantity of the scene"
            )
        return of[name]

    def _of_form(self, name: str, values: Array | None, having: str) -> Array:
        if values is None:
            form = self._model.form
            kinematics = [k.name for k in KINEMATICS.values() if getattr(k, having)]
            raise InputError(
                f"{name}: form {form.name} does not have it: expected a form with the kinematics "
                f"{' or '.join(map(repr, kinematics))}, as form='{form.strain.mixed_form}'"
            )
        return values

    @property
    def strain(self) -> Array:
        """Strain (xx, yy, zz, xy) of the particles since the start, from the displacement: the small
        strain, or at finite strain the logarithmic strain 1/2 ln(F F^T). xy is half the engineering
        shear strain. Its volume is div u, not the field eps_v.
        """
        return self.arrays["strain"]

    def displacement(self, point: Sequence[float]) -> Array:
        """Displacement (u_x, u_y) [m] of the grid at a point; a call for all ranks.

        At small strain it is the displacement since the start. At finite strain, where the grid is reset
        after each step, it is the increment of the last step only: `displacement_of_particles` has the
        total, at the particle nearest to the point, and so has the column 'displacement (x, y)' of a
        `TableOutput`.

        Args:
            point: Position (x, y) [m]; at finite strain at the start of the last step.

        Raises:
            InputError: The point is outside the grid or the body.
        """
        what = f"displacement({checks.shown(point)})"
        location = edges.locate_point(self._model.grid, point, what)
        functions, shares, _ = _rust.functions_at(location, self._model.basis)
        places = of_components(functions[0], self._model.space.dim)
        value, share = (shares[0] @ of.at(places) for of in (self._coefficients, self._active))
        reached = float(share.min())
        if reached < LEAST_SHARE:
            distances = np.linalg.norm(self.own["x"] - np.asarray(point), axis=1)
            nearest = np.array([distances.min(initial=np.inf)])
            raise outside(what, float(ranks.least_of(self._model.grid.comm, nearest)[0]))
        return np.asarray(value if reached > 1 - ROUND_OFF else value / reached)

    def error(self, goal: Goal) -> ErrorEstimate:
        """The estimated error of a quantity, by source; see `tawami.estimate.error.estimate`."""
        return estimate(self.scene.configuration, goal, self.coefficients, self.load)

    # -- in a notebook -------------------------------------------------------

    def plot(
        self,
        quantity: Given = "mean stress",
        axes: Axes | None = None,
        *,
        deformed: float = 1.0,
        limits: tuple[float, float] | None = None,
    ) -> Axes:
        """Draw the particles as squares, coloured by a quantity, with the borders of body and grid.

        A call for all ranks, each of which draws all particles in a figure of its own.

        Args:
            quantity: 'mean stress', 'deviatoric stress q', 'stress xx', 'strain xy', 'displacement' (its
                size), 'displacement y', a history variable, ..., or a `Quantity`.
            axes: Of matplotlib; in a new figure of pyplot by default.
            deformed: Factor on the displacements: 0 draws the body as it was at the start.
            limits: Ends of the range of colours, in the unit of the quantity (Pa); by default those of
                the values without the outermost 1 %.

        Returns:
            The axes; `axes.figure.savefig(...)` writes the picture.

        Raises:
            NotModelledError, InputError: A quantity that the scene does not have, or an unknown one.
            MissingDependencyError: matplotlib is not installed.
        """
        return presentation.plot(
            self.arrays, self._model.grid, quantity, axes, moved=self._model.moves, deformed=deformed,
            limits=limits, more=quantities.of_scene(self.scene), outline=self._outline,
        )  # fmt: skip

    def to_pandas(self, *names: Given) -> Any:
        """The particles as a `pandas.DataFrame`, with columns "x [m]", "stress xx [Pa]", ... and the
        numbers of the particles as index.

        Args:
            names: Quantities, as in :class:`ParticleOutput`; all that the solution has by default.

        Raises:
            NotModelledError, InputError: As :meth:`plot`.
            MissingDependencyError: pandas is not installed.
        """
        table = presentation.columns(self.arrays, names, *self._usual())
        return presentation.to_pandas(table, self.number)

    def to_pyvista(self, *names: Given) -> Any:
        """The particles as a `pyvista.PolyData` of points, with fields "stress xx yy zz xy [Pa]", ...

        Args:
            names: As in :meth:`to_pandas`.

        Raises:
            NotModelledError, InputError: As :meth:`plot`.
            MissingDependencyError: pyvista is not installed.
        """
        data = presentation.fields(self.arrays, names, *self._usual())
        return presentation.to_pyvista(presentation.in_space(self.x), data)

    def _usual(self) -> tuple[list[str], dict[str, Quantity]]:
        """Quantities of a table without names, and those of the laws and the form among them."""
        more = quantities.of_scene(self.scene)
        known = {*self._arrays.own, "strain"} - {"number"}
        stored = [name for name in quantities.PARTICLES if name in known]
        return [*dict.fromkeys([*stored, *quantities.DERIVED, *more])], more

    def _repr_html_(self) -> str:
        momentum, volume, *others = zip(*self.history, strict=True)
        rows = {
            "form": self._model.form_line,
            "particles": str(self.num_particles),
            "unknowns": str(self.unknowns),
            "load": "" if np.isnan(self.load) else f"{100 * self.load:g} %",
            "Newton": f"{self.iterations} iterations",
            "momentum": ", ".join(f"{measure:.1e}" for measure in momentum),
            "volume": ", ".join(f"{measure:.1e}" for measure in volume if measure is not None),
        }
        if others:
            rows["other fields"] = ", ".join(f"{measure:.1e}" for measure in others[0])
        return html.table("Solution", rows)

    # -- forces --------------------------------------------------------------

    def contact(self, obstacle: Obstacle | str) -> ContactResult:
        """Contact with an obstacle: force and moment on it, pressure and friction at the border.

        Args:
            obstacle: As `scene.obstacle` returned it, or its name.

        Raises:
            InputError: The scene had no such obstacle in this step.
        """
        return self._reactions.contact(obstacle)

    def reaction(self, place: str | Sequence[float] | Obstacle | Wall) -> Array:
        """Force (x, y) [N per metre depth] that a support, wall or obstacle exerts on the body.

        In dynamics it is the force at the end of the step and the impulse at its beginning over its
        length.

        Args:
            place: Name of a part of the border or of an edge of the grid. Along an edge of the grid it
                is the sum over the functions of the edge, so that forces at a corner belong to both
                edges, and parts of the border on one edge share its force. Or the point (x, y) of a
                `hold` [m], as it was given or where it is now. Or an obstacle or its name. Or a wall,
                which is its edge of the grid.

        Raises:
            InputError: No such part or nothing that supports it, or no point held there.
        """
        return self._reactions.at(self._model, place)

    @property
    def on_points(self) -> list[tuple[tuple[float, float], Array]]:
        """Position (x, y) [m] of each held point at the start of the step, and its force [N/m]."""
        return [
            (one.places[-1], one.force * np.eye(self._model.space.dim)[one.component])
            for one in self._reactions.at_points
        ]
