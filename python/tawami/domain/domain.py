"""The particles in their present cells, from one reset of the grid to the next."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError, InstabilityWarning
from tawami.base.timing import Stopwatch
from tawami.base.warn import warn
from tawami.domain.model import Model
from tawami.field.assembly import Assembly
from tawami.field.attachment import Attachment
from tawami.field.border import BorderInCells
from tawami.field.layout import Layout
from tawami.field.points import PointAssembly
from tawami.field.reference import ReferenceAssembly
from tawami.form.kinematics import KINEMATICS, Kinematics
from tawami.grid.basis import Basis
from tawami.particles import assignment
from tawami.particles.numpy_stage import NumpyStage
from tawami.particles.responses import Responses
from tawami.particles.values import ParticleValues
from tawami.solve.newton import Newton
from tawami.solve.numerics import Numerics

ASSEMBLIES: dict[str, type[PointAssembly | ReferenceAssembly]] = {
    "points": PointAssembly,
    "dolfinx": ReferenceAssembly,
}
#: Share of a cell that a form which needs whole cells takes for a whole one.
WHOLE = 0.5


@dataclass(frozen=True, eq=False)
class Domain:
    """This rank's particles with all that belongs to their present cells.

    Attributes:
        model: Grid, form and laws of the scene.
        particles: The particles of this rank.
        location: Their cells and positions in them.
        assembly: Assembly of the form over these cells.
        stage: The material laws of the particles.
        responses: Their responses, as the form reads them.
        newton: The nonlinear problem of a step.
    """

    model: Model
    particles: _rust.Particles
    location: _rust.Location
    assembly: Assembly
    stage: _rust.Stage | NumpyStage
    responses: Responses
    newton: Newton

    @classmethod
    def attach(
        cls,
        model: Model,
        particles: _rust.Particles,
        location: _rust.Location,
        numerics: Numerics,
        stopwatch: Stopwatch,
        earlier: Domain | None = None,
    ) -> Domain:
        """Attach the form and the laws to particles at their present location.

        Args:
            earlier: The domain of the same scene before its particles moved.
        """
        with stopwatch("set-up"):
            attachment = Attachment(
                model.grid, model.compiled, model.basis, location, particles.volume, model.values,
                stopwatch,
            )  # fmt: skip
            assembly = ASSEMBLIES[numerics.assembly](attachment)

        def responses_of(stage: _rust.Stage | NumpyStage) -> Responses:
            return Responses(
                model.compiled, particles, location, stage,
                ParticleValues(model.form, particles, model.moduli, model.density),
                model.grid, stopwatch,
            )  # fmt: skip

        def elastic() -> Responses:
            """The same particles with the elastic parts of their laws."""
            laws = [  # an incompressible law is elastic already
                _rust.Material.of("linear_elastic", (K, mu), []) if np.isfinite(K) else given
                for given, (K, mu) in zip(model.materials, model.moduli, strict=True)
            ]
            return responses_of(
                _rust_stage(model, particles, location, model.form.kinematics, laws)
            )

        stage = _stage(model, particles, location, model.form.kinematics)
        responses = responses_of(stage)
        laws = all(material.name == "linear_elastic" for material in model.materials)
        linear = laws and model.compiled.is_linear
        newton = Newton(assembly, responses, numerics, stopwatch, elastic, linear=linear)
        if earlier is not None:
            assembly.follow(earlier.assembly)
            newton.follow(earlier.newton)
        return cls(model, particles, location, assembly, stage, responses, newton)

    @property
    def total_strain_stage(self) -> _rust.Stage | NumpyStage:
        """The laws as they answer to total strains, whatever the form has as fields."""
        return _stage(self.model, self.particles, self.location, KINEMATICS["displacement"])

    @property
    def layout(self) -> Layout:
        """Positions of the coefficients of each field."""
        return self.assembly.layout

    @property
    def active(self) -> npt.NDArray[np.bool_]:
        """Whether each cell of the window holds particles, on any rank, ny x nx."""
        return self.assembly.attachment.active

    @property
    def volume(self) -> Array:
        """Volumes of this rank's particles in the integrals of the form."""
        return self.assembly.attachment.volume

    @property
    def elastic_energy(self) -> float:
        """Energy that the laws store on this rank [J per metre depth]."""
        return self.stage.elastic_energy(self.volume)

    def commit(self, coefficients: Array) -> float:
        """Let the laws accept increments of all fields.

        Returns:
            The energy that they dissipate on this rank [J per metre depth].
        """
        return self.stage.commit(*self.layout.split(coefficients), volume=self.volume)

    @property
    def constants(self) -> dict[str, Array]:
        """K and mu [Pa] of each particle."""
        return self.responses.constants

    @property
    def is_elastic(self) -> npt.NDArray[np.bool_]:
        """Whether the law of each particle has no history."""
        mask: npt.NDArray[np.bool_] = self.model.without_history[self.particles.material]
        return mask

    def means_at(self, cells: BorderInCells) -> tuple[Array, Array]:
        """Mean mu [Pa] and density [kg/m3] of particles in the cells of points; a call for all ranks.

        Args:
            cells: The points in the cells of the grid.
        """
        found = np.zeros((2, len(cells)))
        found[:, cells.own] = [of[cells.here[cells.own]] for of in self._means_of_cells]
        mu, rho = ranks.sum_of(self.model.grid.comm, found)
        return mu, rho

    @functools.cached_property
    def _means_of_cells(self) -> tuple[Array, Array]:
        """Mean mu [Pa] and density [kg/m3] of the particles in each cell of this rank, 0 without any."""
        density, of = self.model.density, self.particles.material
        rho = np.zeros(len(of)) if density is None else density[of]
        columns = np.column_stack([np.ones(len(of)), self.constants["mu"], rho])
        sums = _rust.cell_sums(self.location, self.particles.volume, columns)
        volume, *weighted = sums.T
        mu, rho = (
            np.divide(one, volume, out=np.zeros_like(volume), where=volume > 0) for one in weighted
        )
        return mu, rho

    @property
    def areas(self) -> Array:
        """Area of each particle in the plane of the grid [m2]."""
        return np.asarray(self.particles.volume / self.model.space.thickness(self.particles.x))

    @property
    def mass(self) -> Array:
        """Mass of each particle [kg per metre depth].

        Raises:
            InputError: The scene has no density.
        """
        if self.model.density is None:
            raise InputError("mass needs Scene(..., density=...) [kg/m3]")
        return np.asarray(self.model.density[self.particles.material] * self.particles.volume)

    @property
    def lumped_mass(self) -> Array:
        """Mass of each displacement function [kg per metre depth]; a call for all ranks.

        Raises:
            InputError: The scene has no density.
        """
        return self.sums(self.mass, np.ones((len(self.particles), 1)))[:, 0]

    def sums(self, weight: Array, data: Array, basis: Basis | None = None) -> Array:
        """Sums over all particles of the body, sum_p weight_p data_p N_i: functions x columns.

        The functions are those of the window. A call for all ranks.

        Args:
            weight: One number per particle of this rank.
            data: Particles x columns.
            basis: Whose functions N_i are; that of the displacement by default.
        """
        basis = basis or self.layout.basis
        return self.layout.functions.sums(self.location, weight, data, basis)

    def at_particles(self, values: Array) -> Array:
        """A displacement field (functions x dim) at this rank's particles, particles x dim."""
        flat = np.ascontiguousarray(values).ravel()
        return np.asarray(
            _rust.interpolate(self.location, self.layout.basis, self.model.space.dim, flat)
        )

    def gradients(self, values: Array) -> Array:
        """Gradient of a displacement field (functions x dim) at the particles, particles x dim x dim."""
        return self.model.space.in_space(self.all_gradients(values))

    def all_gradients(self, values: Array) -> Array:
        """The same with the row and the column of the hoop direction where there is one."""
        flat = np.ascontiguousarray(values).ravel()
        gradients = _rust.gradients(self.location, self.layout.basis, flat)
        return self.model.space.gradients(np.asarray(gradients))

    @property
    def particles_per_cell(self) -> npt.NDArray[np.int64]:
        """Number of particles in each cell of the window, x fastest; a call for all ranks."""
        return self.responses.particles_per_cell

    def warn_of_partial_cells(self) -> None:
        """Warn of partially filled cells if an option of the form needs whole ones.

        A call for all ranks.
        """
        form, options = self.model.form, self.model.options
        for option in options.values():
            if option in form.whole_cells:
                self._warn_of_partial_cells(option)

    def _warn_of_partial_cells(self, option: str) -> None:
        grid = self.model.grid
        areas = self.responses.cell_sums(self.areas[:, None])[:, 0]
        shares = np.where(areas > 0, areas / self.model.space.measure(grid.h), 1.0)
        c = int(shares.argmin())
        i, j = grid.window.indices(c)
        share, j, i = min(grid.comm.allgather((float(shares[c]), int(j), int(i))))
        if share < WHOLE and not grid.comm.rank:
            warn(
                f"'{option}' is not stable in partially filled cells: cell ({i}, {j}) holds "
                f"{share:.2g} of its area, expected at least {WHOLE:g}; use another option of the "
                "form, or a grid whose lines follow the body",
                InstabilityWarning,
            )


def _rust_stage(
    model: Model,
    particles: _rust.Particles,
    location: _rust.Location,
    kinematics: Kinematics,
    laws: Sequence[_rust.Material],
) -> _rust.Stage:
    return _rust.Stage(particles, location, list(laws), kinematics.name, model.moves, model.basis)


def _stage(
    model: Model, particles: _rust.Particles, location: _rust.Location, kinematics: Kinematics
) -> _rust.Stage | NumpyStage:
    rust = _rust_stage(model, particles, location, kinematics, model.materials)
    laws = assignment.in_numpy(model.given)
    if not laws:
        return rust
    return NumpyStage(rust, particles, laws, kinematics, finite=model.form.strain.finite)
