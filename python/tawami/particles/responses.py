"""The responses of the particles to increments of the fields, in the columns that a form reads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import ranks
from tawami.base.errors import InputError
from tawami.base.timing import Stopwatch
from tawami.fem.rules import Rule
from tawami.form.compilation import CompiledForm
from tawami.form.quantities import Density, LawQuantity, ParticleScalar
from tawami.particles.numpy_law import NumpyStage

Array = npt.NDArray[np.float64]


class Responses:
    """Constants and law quantities of this rank's particles, as a compiled form reads them.

    Making one is a collective call.

    Args:
        compiled: The form.
        particles: The particles, with volumes and stresses.
        location: Their cells and positions in them.
        stage: Their material laws.
        constants: K and mu of each particle [Pa].
        comm: Communicator.
        stopwatch: Measures the time of the laws.

    Attributes:
        data: Particle data of each rule, particles x columns; :meth:`evaluate` writes them.

    Raises:
        InputError: A constant that the form names is not finite.
    """

    def __init__(
        self,
        compiled: CompiledForm,
        particles: _rust.Particles,
        location: _rust.Location,
        stage: _rust.Stage | NumpyStage,
        constants: Mapping[str, Array],
        comm: Any,
        stopwatch: Stopwatch,
    ) -> None:
        self.compiled, self.particles, self.location = compiled, particles, location
        self.stage, self.constants = stage, constants
        self._comm, self._stopwatch = comm, stopwatch
        self.data: dict[Rule, Array] = {
            rule: np.zeros((len(particles), compiled.columns(rule))) for rule in compiled.densities
        }
        #: Law quantities of each rule: (name, part, first column).
        self._requests: dict[Rule, list[tuple[str, str, int]]] = {rule: [] for rule in self.data}
        #: Constants that multiply some of them, with their columns.
        self._factors: dict[Rule, list[tuple[slice, Array]]] = {rule: [] for rule in self.data}
        with ranks.raise_together(comm):
            for rule, densities in compiled.densities.items():
                for density, column in densities.items():
                    self._place(rule, density, column)

    def _place(self, rule: Rule, density: Density, column: int) -> None:
        quantity = density.quantity
        if isinstance(quantity, ParticleScalar):
            self.data[rule][:, column] = self._constant(quantity)
            return
        assert isinstance(quantity, LawQuantity)
        self._requests[rule].append((quantity.name, density.part, column))
        if quantity.factor is not None:
            columns = slice(column, column + density.size)
            self._factors[rule].append((columns, quantity.factor.evaluate(self.constants)))

    def _constant(self, scalar: ParticleScalar) -> Array:
        with np.errstate(all="ignore"):
            values = np.asarray(scalar.evaluate(self.constants), dtype=float)
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            p = bad[0]
            K, mu = (self.constants[name][p] for name in ("K", "mu"))
            raise InputError(
                f"form {self.compiled.form.name}: '{scalar.text}' is not finite at particle "
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
            for rule, requests in self._requests.items():
                if requests:
                    with ranks.raise_together(self._comm):
                        self.stage.evaluate(u, volumetric, requests, self.data[rule])
                    for columns, factor in self._factors[rule]:
                        self.data[rule][:, columns] *= factor[:, None]
        return self.data

    def sums(self, columns: Array) -> Array:
        """Volume-weighted sums over all particles of the body on the bilinear functions.

        A collective call.

        Args:
            columns: Values of this rank's particles, particles x columns.
        """
        volume = self.particles.volume
        sums = _rust.nodal_sums(self.location, volume, columns, "bilinear")
        return ranks.sum_of(self._comm, sums)
