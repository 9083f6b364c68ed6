"""Grid, form and laws of a scene: input that was checked once and never changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks, ranks
from tawami.base.errors import CheckpointError, InputError, LockingWarning, ParameterWarning
from tawami.base.sealed import Settings
from tawami.base.space import Space
from tawami.base.warn import warn
from tawami.body.body import Body
from tawami.form.compilation import CompiledForm, check_used, compile_form
from tawami.form.form import Form
from tawami.form.symbols import Assembly
from tawami.grid.basis import BASES, Basis
from tawami.grid.grid import Grid
from tawami.particles import assignment
from tawami.particles.assignment import Law

Array = npt.NDArray[np.float64]
Leaving = Literal["stop", "remove"]
#: K/mu from which displacement-only forms lock: nu = 0.49. At 0.495 the mean stress of the cantilever
#: has 4 times the error that it has at 0.3, at 0.49995 70 times (`python -m cases.extremes`).
LOCKS = 50.0

#: Arguments of `Scene` that are not parameters of the form.
KEYWORDS = (
    "material_of", "form", "basis", "tolerance", "max_iterations", "assembly", "factorise",
    "linear_solver", "density", "leaving",
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
        parameters: Those that this choice of options uses.
        options: Choices that the form offers.
        given: The material laws, in Rust or in NumPy.
        density: Of each material [kg/m3]; None if the scene has no mass.
        names: Name of the group of each material; empty if the body has no names.
        leaving: 'stop' or 'remove', for particles that leave the grid.
        num_particles: Particles of the body, on all ranks.
    """

    grid: Grid
    form: Form
    compiled: CompiledForm
    basis: Basis
    values: Mapping[str, float]
    parameters: Settings[float]
    options: Settings[str]
    given: Sequence[Law]
    density: Array | None
    names: tuple[str, ...]
    leaving: Leaving
    num_particles: int

    @property
    def space(self) -> Space:
        """Everything that follows from the dimension."""
        return self.grid.space

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
                "laws": [*self.texts, *laws],
                "density": None if self.density is None else self.density.tolist(),
                "leaving": self.leaving,
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
    assembly: Assembly,
    parameters: Mapping[str, Any],
) -> tuple[Model, _rust.Particles]:
    """The model of a scene and the particles of its whole body; the arguments are those of `Scene`.

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
    values, options = loaded.settings(parameters, static=density is None, others=KEYWORDS)
    for message in [] if grid.comm.rank else loaded.unusual(values):
        warn(message, ParameterWarning)
    particles, laws = _particles(body, material, material_of, loaded)
    materials = assignment.materials_of(laws)
    densities = assignment.densities(density, len(materials), body.names)
    ratios = np.array([m.bulk_modulus / m.shear_modulus for m in materials])[particles.material]
    warn_of_locking(grid, loaded, float(ratios.max()), int(ratios.argmax()))
    compiled = _compiled(grid, loaded, options, assembly, materials)
    check_used(compiled, options, parameters)
    _check_plastic_volume(compiled, laws, particles)
    instead = "the form's parameters are fixed when a scene is made: Scene(..., {}=...)"
    used = {name: value for name, value in values.items() if name in compiled.used}
    model = Model(
        grid, loaded, compiled, basis, values,
        Settings(used, instead.format("alpha")), Settings(options, instead.format("stabilisation")),
        laws, densities, _names(body, len(materials)), leaving, len(particles),
    )  # fmt: skip
    return model, particles


def _compiled(
    grid: Grid,
    form: Form,
    options: Mapping[str, str],
    assembly: Assembly,
    materials: Sequence[_rust.Material],
) -> CompiledForm:
    """The form, with the plastic volume of the laws if any of them may have one."""
    plastic_volume = any(one.pressure_dependent for one in materials)
    return compile_form(grid.comm, form, options, assembly, plastic_volume=plastic_volume)


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
    compiled = _compiled(model.grid, form, model.options, assembly, materials)
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


def _particles(
    body: Body, material: assignment.Given, material_of: npt.ArrayLike | None, form: Form
) -> tuple[_rust.Particles, list[Law]]:
    """All particles of the body with their materials and history variables."""
    x, volume = checks.array("x", body.x, 2), checks.array("volume", body.volume, 1)
    assigned = assignment.assigned(material, material_of, body, len(x))
    particles = _rust.Particles(x, volume, assigned.number)
    materials = assignment.materials_of(assigned.laws)
    particles.check_materials(materials, form.kinematics.name, form.strain.finite)
    particles.add_history(materials)
    return particles, assigned.laws


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


def warn_of_locking(grid: Grid, form: Form, ratio: float, number: int) -> None:
    """Warn of a nearly incompressible material in a form without a field for the volume.

    Args:
        grid: The grid.
        form: The form.
        ratio: Largest K/mu of a particle.
        number: Of this particle.
    """
    if not form.kinematics.locks or grid.comm.rank or ratio < LOCKS:
        return
    warn(
        f"form {form.name} has no field for the volume, and K/mu = {ratio:.3g} at particle {number}: it "
        f"locks, and its mean stress is useless where K/mu is large. Expected K/mu below {LOCKS:g} "
        "(nu < 0.49); use form 'u_epsv' or 'u_epsv_finite'",
        LockingWarning,
    )
