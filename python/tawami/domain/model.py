"""Grid, form and laws of a scene: input that was checked once and never changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks, ranks
from tawami.base.arrays import Array
from tawami.base.errors import CheckpointError, InputError, ParameterWarning
from tawami.base.identity import text
from tawami.base.meaning import meaning
from tawami.base.sealed import Settings
from tawami.base.space import Space
from tawami.base.warn import warn
from tawami.body.body import Body
from tawami.body.part import Part
from tawami.border.pieces import Border
from tawami.domain import locking
from tawami.domain.parameters import by_kind, check_names
from tawami.field import fitted_volumes
from tawami.form.compilation import CompiledForm, check_used, compile_form
from tawami.form.form import Form
from tawami.form.symbols import Assembly
from tawami.grid.basis import BASES, Basis
from tawami.grid.grid import Grid
from tawami.particles import assignment, making
from tawami.particles.assignment import Law

Leaving = Literal["stop", "remove"]

#: Arguments of `Scene` that are not parameters of the form.
KEYWORDS = (
    "material_of", "form", "basis", "tolerance", "max_iterations", "assembly", "factorise",
    "linear_solver", "density", "leaving", "volumes",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Model:
    """Grid, weak form and material laws of a scene; made by :func:`build`.

    Attributes:
        grid: The background grid.
        form: The weak form.
        compiled: The same, compiled.
        basis: Basis of the displacement.
        values: Every number that the form declares (alpha, ...).
        parameters: Those that this choice of options uses, as the scene was made.
        in_time: Parameters that are functions of time [s].
        in_space: Sources of the parameters that are numbers of each particle.
        options: Choices that the form offers.
        given: The material laws, in Rust or in NumPy.
        density: Of each material [kg/m3]; None if the scene has no mass.
        names: Name of the group of each material; empty if the body has no names.
        leaving: 'stop' or 'remove', for particles that leave the grid.
        num_particles: Particles of the body, on all ranks.
        part: The part of the body that the driver script has on this rank, whose order arrays of the
            script have; None if it has the whole body.
        volumes: Volumes that the form integrates with, as in `Scene`.
        border: The border of the body; None if it has none.
    """

    grid: Grid
    form: Form
    compiled: CompiledForm
    basis: Basis
    values: Mapping[str, float]
    parameters: Mapping[str, float]
    in_time: Mapping[str, Callable[[float], float]]
    in_space: Mapping[str, Any]
    options: Settings[str]
    given: Sequence[Law]
    density: Array | None
    names: tuple[str, ...]
    leaving: Leaving
    num_particles: int
    part: Part | None
    volumes: fitted_volumes.Volumes
    border: Border | None

    @property
    def space(self) -> Space:
        """Everything that follows from the dimension."""
        return self.grid.space

    def on(self, grid: Grid) -> Model:
        """The model on its grid with other cells for each rank; itself if they are the same."""
        return self if grid is self.grid else replace(self, grid=grid)

    @property
    def along_body(self) -> int:
        """Length of the arrays of a driver script: the particles of its body on this rank."""
        return self.num_particles if self.part is None else len(self.part.number)

    def of_script(self, rows: npt.NDArray[Any], number: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Rows of some particles, from an array of a driver script; a collective call.

        Args:
            rows: Row of each particle of the body of the script.
            number: Numbers of the particles.
        """
        return rows[number] if self.part is None else self.part.at(rows, number)

    @property
    def moves(self) -> bool:
        """Whether particles move with the body: strains are finite and each step resets the grid."""
        return self.form.strain.finite

    @cached_property
    def materials(self) -> list[_rust.Material]:
        """The laws as the Rust part knows them: name, moduli, history variables."""
        return assignment.materials_of(self.given)

    @property
    def moduli(self) -> Array:
        """K and mu [Pa] of each material, materials x 2."""
        return np.array([(m.bulk_modulus, m.shear_modulus) for m in self.materials])

    @property
    def without_history(self) -> npt.NDArray[np.bool_]:
        """Whether each material is elastic: a law in Rust that has no history variables."""
        laws = zip(self.given, self.materials, strict=True)
        return np.array([given is m and not m.history_names for given, m in laws])

    @property
    def laws(self) -> list[str]:
        """Names of the laws, each with its history variables."""
        histories = [(m.name, ", ".join(m.history_names)) for m in self.materials]
        return [f"{name} ({history})" if history else name for name, history in histories]

    @property
    def texts(self) -> list[str]:
        """The laws with their parameters, for checkpoints."""
        return list(map(repr, self.materials))

    def check_same_laws(self, texts: Sequence[str]) -> None:
        """Check that a checkpoint has these laws.

        Raises:
            CheckpointError: It has others.
        """
        if list(texts) != self.texts:
            raise CheckpointError(
                "laws were changed during the run (each=): expected change_material(...) between two "
                "phases"
            )

    @property
    def least_density(self) -> float:
        """The smallest density of a material [kg/m3]; 0 if the scene has no mass."""
        return 0.0 if self.density is None else float(self.density.min())

    @property
    def form_line(self) -> str:
        """The form with its parameters, for the header of a run."""
        used = [f"{name} = {value:g}" for name, value in self.parameters.items()]
        used += [f"{name} in time" for name in self.in_time]
        used += [f"{name} of each particle" for name in self.in_space]
        used += [f"{name} '{choice}'" for name, choice in self.options.items()]
        return ", ".join([f"{self.form.name} in {' and '.join(self.form.fields)}", *used])

    def identity(self) -> dict[str, Any]:
        """Facts that identify the model, for checkpoints."""
        laws = [law.identity() for law in assignment.in_numpy(self.given).values()]
        return (
            self.grid.identity()
            | self.form.identity()
            | {
                "basis": self.basis,
                "parameters": {**self.parameters, **self.options},
                "changing parameters": {n: text(f) for n, f in self.in_time.items()}
                | {n: meaning(source) for n, source in self.in_space.items()},
                "laws": [*self.texts, *laws],
                "density": None if self.density is None else self.density.tolist(),
                "leaving": self.leaving,
                "volumes": self.volumes,
                "number of particles": self.num_particles,
            }
        )


def build(
    grid: Grid,
    body: Body,
    material: assignment.Given,
    material_of: npt.ArrayLike | None,
    form: str | Path | ModuleType | Form,
    basis: Basis,
    density: float | Sequence[float] | Mapping[str, float] | None,
    leaving: Leaving,
    volumes: fitted_volumes.Volumes,
    assembly: Assembly,
    parameters: Mapping[str, Any],
) -> tuple[Model, _rust.Particles]:
    """The model of a scene and the particles of its body on this rank; the arguments are those of
    `Scene`.

    Raises:
        InputError, FormError: As `Scene`.
    """
    if not checks.one_of(basis, BASES):
        names = ", ".join(map(repr, BASES))
        raise InputError(f"basis {checks.shown(basis)}: expected one of {names}")
    checks.choice("leaving", leaving, ("stop", "remove"))
    if not isinstance(grid, Grid) or not isinstance(body, Body):
        raise InputError(
            f"Scene({type(grid).__name__}, {type(body).__name__}, ...): expected a tawami.Grid and "
            "a tawami.Body"
        )
    loaded = Form.load(form)
    numbers, in_time, in_space = by_kind(loaded, parameters)
    values, options = loaded.settings(numbers, static=density is None, others=KEYWORDS)
    for message in [] if grid.comm.rank else loaded.unusual(values):
        warn(message, ParameterWarning)
    with ranks.raise_together(grid.comm):
        particles, laws = making.particles(grid, body, material, material_of, loaded)
    materials = assignment.materials_of(laws)
    densities = assignment.densities(density, len(materials), body.names)
    locking.warn_of_first(grid, loaded, materials, particles)
    compiled = _compiled(grid, loaded, options, assembly, laws, in_space)
    check_names(loaded, in_space, materials)
    if "rho" in compiled.used and densities is None:
        raise InputError(
            f"form {loaded.name} reads the density rho: expected Scene(..., density=...) [kg/m3]"
        )
    check_used(compiled, options, parameters)
    with ranks.raise_together(grid.comm):
        _check_plastic_volume(compiled, laws, particles)
    fixed = "options of the form are fixed when a scene is made: Scene(..., stabilisation=...)"
    changing = {*in_time, *in_space}
    used = {n: value for n, value in values.items() if n in compiled.used and n not in changing}
    model = Model(
        grid, loaded, compiled, basis, values,
        used, in_time, in_space, Settings(options, fixed),
        laws, densities, _names(body, len(materials)), leaving,
        len(particles) if body.part is None else body.part.total, body.part,
        fitted_volumes.checked(volumes, body.border),
        body.border,
    )  # fmt: skip
    return model, particles


def _compiled(
    grid: Grid,
    form: Form,
    options: Mapping[str, str],
    assembly: Assembly,
    laws: Sequence[Law],
    in_space: Iterable[str],
) -> CompiledForm:
    """The form, with the plastic volume of the laws if any of them may have one."""
    materials = assignment.materials_of(laws)
    plastic_volume = any(one.pressure_dependent for one in materials)
    histories = [name for one in materials for name in one.history_names]
    return compile_form(
        grid.comm, form, options, assembly, plastic_volume=plastic_volume, space=grid.space,
        histories=histories, fields_of_particles=in_space,
    )  # fmt: skip


def with_laws(
    model: Model,
    particles: _rust.Particles,
    laws: Sequence[Law],
    of: Sequence[int],
    assembly: Assembly,
) -> Model:
    """A model with other laws; a call for all ranks.

    Args:
        model: The model before.
        particles: The particles of this rank, with the numbers of their new laws.
        laws: The new laws.
        of: Number of the old material of each, whose density and name it has.
        assembly: As of `Scene`.

    Raises:
        InputError: A law that does not fit the form.
    """
    form, materials = model.form, assignment.materials_of(laws)
    with ranks.raise_together(model.grid.comm):
        particles.check_materials(materials, form.kinematics.name, form.strain.finite)
    check_names(form, model.in_space, materials)
    compiled = _compiled(model.grid, form, model.options, assembly, laws, model.in_space)
    with ranks.raise_together(model.grid.comm):
        _check_plastic_volume(compiled, laws, particles)
    return replace(
        model,
        compiled=compiled,
        given=laws,
        density=None if model.density is None else model.density[list(of)],
        names=tuple(model.names[k] for k in of) if model.names else (),
    )


def _names(body: Body, materials: int) -> tuple[str, ...]:
    """Names of the groups of a body, if they are those of its materials."""
    return tuple(body.names) if len(body.names) == materials else ()


def _check_plastic_volume(
    compiled: CompiledForm,
    laws: Sequence[Law],
    particles: _rust.Particles,
) -> None:
    """Check that the form has the plastic volume of the laws in its volume equation.

    Raises:
        InputError: It does not name eps_p, and flow may change the volume of a particle.
    """
    form = compiled.form
    if not form.kinematics.has_mean_stress or compiled.names("eps_p"):
        return
    dilates = np.array([one.pressure_dependent for one in assignment.materials_of(laws)])
    bad = np.flatnonzero(dilates[particles.material])
    if len(bad):
        own = laws[particles.material[bad[0]]]
        why = "depends on the mean stress" if isinstance(own, _rust.Material) else f"is {own.name}"
        raise InputError(
            f"the law of particle {particles.number[bad[0]]} {why}, so that its flow may change the "
            f"volume, and form {form.name} has no term for that: expected eps_p in its volume equation, "
            "as - sum_p(K * eps_p, q) in 'u_epsv'"
        )
