"""The responses of the particles to increments of the fields, in the columns that a form reads."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.base.timing import Stopwatch
from tawami.fem.rules import Rule
from tawami.form.compilation import CompiledForm
from tawami.form.quantities import Density, LawQuantity, ParticleScalar
from tawami.grid.grid import Grid
from tawami.particles.numpy_stage import NumpyStage

#: K/mu beyond which a larger bulk modulus makes forces no larger.
LOCKED = 1e4
#: Law quantity, value or derivative, first column, and constants that multiply it.
Request = tuple[str, str, int, Array | None]


class Responses:
    """Constants and law quantities of this rank's particles, as a compiled form reads them.

    Making one is a collective call.

    Args:
        compiled: The form.
        particles: The particles, with volumes and stresses.
        location: Their cells and positions in them.
        stage: Their material laws.
        values: Numbers of the particles by name, K and mu [Pa] among them.
        grid: The grid.
        stopwatch: Measures the time of the laws.

    Attributes:
        form: The form.
        values: Numbers of the particles by name.
        constants: K and mu of each particle [Pa].
        data: Particle data of each rule, particles x columns; :meth:`evaluate` writes them.
        stiffest: Largest modulus of the body [Pa]; a bulk modulus counts up to `LOCKED` mu.
        largest_mu: Largest shear modulus of the body [Pa].

    Raises:
        InputError: A constant that the form names is not finite.
    """

    def __init__(
        self,
        compiled: CompiledForm,
        particles: _rust.Particles,
        location: _rust.Location,
        stage: _rust.Stage | NumpyStage,
        values: Mapping[str, Array],
        grid: Grid,
        stopwatch: Stopwatch,
    ) -> None:
        self.form, self.stage, self.values = compiled.form, stage, values
        self.constants = {name: values[name] for name in ("K", "mu")}
        self.particles, self.location = particles, location
        self._comm, self._window, self._stopwatch = grid.comm, grid.window, stopwatch
        self.data: dict[Rule, Array] = {
            rule: np.zeros((len(particles), compiled.columns(rule))) for rule in compiled.densities
        }
        requests: dict[Rule, list[Request]] = {rule: [] for rule in self.data}
        #: Numbers that may change between steps, with their arrays and columns.
        self._varying = list[tuple[ParticleScalar, Array, int]]()
        with ranks.raise_together(self._comm):
            for rule, densities in compiled.densities.items():
                for density, column in densities.items():
                    quantity = density.quantity
                    if isinstance(quantity, ParticleScalar) and quantity.varies:
                        self._varying.append((quantity, self.data[rule], column))
                    elif isinstance(quantity, ParticleScalar):
                        self.data[rule][:, column] = self._constant(quantity)
                    else:
                        requests[rule].append(self._request(density, column))
        #: Particle data with law quantities, and these quantities.
        self._written = [self.data[rule] for rule, of_rule in requests.items() if of_rule]
        self._requests = _rust.Requests([of_rule for of_rule in requests.values() if of_rule])
        mu = self.constants["mu"]
        softer = np.minimum(self.constants["K"], LOCKED * mu)
        self.stiffest, self.largest_mu = (
            ranks.largest(self._comm, float(modulus.max(initial=0.0))) for modulus in (softer, mu)
        )

    def _request(self, density: Density, column: int) -> Request:
        quantity = density.quantity
        assert isinstance(quantity, LawQuantity)
        factor = None
        if quantity.factor is not None:
            factor = np.asarray(quantity.factor.evaluate(self.values), dtype=float)
        return quantity.name, density.part, column, factor

    def refresh(self) -> None:
        """Read again what may have changed since the last step: old fields, data, parameters.

        A collective call.

        Raises:
            InputError: Data that the scene does not have, or an expression that is not finite.
        """
        if self._varying:
            with ranks.raise_together(self._comm):
                for scalar, data, column in self._varying:
                    data[:, column] = self._constant(scalar)

    def _constant(self, scalar: ParticleScalar) -> Array:
        with np.errstate(all="ignore"):
            values = np.asarray(scalar.evaluate(self.values), dtype=float)
        incompressible = scalar.text == "K" and self.form.kinematics.deviatoric
        bad = np.flatnonzero(~np.isfinite(values) & (not incompressible))
        if len(bad):
            p = bad[0]
            K, mu = (self.constants[name][p] for name in ("K", "mu"))
            raise InputError(
                f"form {self.form.name}: '{scalar.text}' is not finite at particle "
                f"{self.particles.number[p]}, where K = {K:g} and mu = {mu:g} Pa; with nu = 0.5 (K "
                "infinite) use form 'u_p', or nu < 0.5"
            )
        return values

    @property
    def bytes_per_particle(self) -> int:
        """Bytes of the particle data and the constants of one particle."""
        arrays = [*self.data.values(), *self.constants.values()]
        return sum(array.itemsize * int(np.prod(array.shape[1:])) for array in arrays)

    def evaluate(self, u: Array, volumetric: Array | None) -> Mapping[Rule, Array]:
        """Evaluate the laws at increments of the fields; returns :attr:`data`.

        Args:
            u: Coefficients of the displacement.
            volumetric: Coefficients of the bilinear field, if the form has one.
        """
        with self._stopwatch("law"):
            if self._written:
                with ranks.raise_together(self._comm):
                    self.stage.evaluate(u, volumetric, self._requests, self._written)
        return self.data

    def cell_sums(self, columns: Array) -> Array:
        """Sums over all particles of the body in each cell of the window, cells x columns.

        A collective call.

        Args:
            columns: Values of this rank's particles, particles x columns.
        """
        once = np.ones(len(self.particles))
        return self._window.of_cells.update(_rust.cell_sums(self.location, once, columns))

    @property
    def particles_per_cell(self) -> Indices:
        """Number of particles in each cell of the window, x fastest; a collective call."""
        return self.cell_sums(np.ones((len(self.particles), 1)))[:, 0].astype(np.int64)
