"""The particles where they are: field side, laws and Newton's method from one reset of the grid to the
next.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import ranks
from tawami.base.errors import InstabilityWarning
from tawami.field.reduction import Layout
from tawami.field.reference import Field
from tawami.grid.basis import Basis
from tawami.particles.numpy_law import NumpyStage
from tawami.solve.newton import Newton

Array = npt.NDArray[np.float64]
#: Part of a cell that is as good as all of it, to forms that need whole cells.
WHOLE = 0.5


@dataclass(frozen=True)
class Attached:
    """What belongs to the present cells of this rank's particles.

    Attributes:
        location: Where they are.
        field: The field side.
        stage: Their laws.
        newton: The nonlinear problem of a step.
    """

    location: _rust.Location
    field: Field
    stage: _rust.Stage | NumpyStage
    newton: Newton

    @property
    def layout(self) -> Layout:
        """Where the coefficients stand."""
        return self.field.layout

    def sums(self, weight: Array, data: Array, basis: Basis | None = None) -> Array:
        """Sums over all particles of the body on the functions of a basis, that of the displacement
        by default: sum_p weight_p data_p N_i, functions x columns.
        """
        sums = _rust.nodal_sums(self.location, weight, data, basis or self.layout.basis)
        return ranks.sum_of(self.layout.grid.comm, sums)

    def warn_of_parts(self, volume: Array, option: str) -> None:
        """Warn of cells that the body fills in part, for an option of the form that needs whole ones."""
        grid = self.layout.grid
        areas = np.bincount(self.location.cell, volume, minlength=grid.cells[0] * grid.cells[1])
        areas = ranks.sum_of(grid.comm, areas)
        parts = np.where(areas > 0, areas / grid.h**2, 1.0)
        c = int(parts.argmin())
        if parts[c] < WHOLE and not grid.comm.rank:
            i, j = c % grid.cells[0], c // grid.cells[0]
            warnings.warn(
                f"'{option}' is not stable in cells that the body fills in part: cell ({i}, {j}) holds "
                f"{parts[c]:.2g} of its area, expected at least {WHOLE:g}; use another option of the "
                "form, or a grid whose lines follow the body",
                InstabilityWarning,
                stacklevel=2,
            )

    def at_particles(self, values: Array) -> Array:
        """A displacement field (functions x 2) at this rank's particles, particles x 2."""
        flat = np.ascontiguousarray(values).ravel()
        return np.asarray(_rust.interpolate(self.location, self.layout.basis, 2, flat))

    def gradients(self, values: Array) -> Array:
        """Gradient of a displacement field (functions x 2) at the particles, particles x 2 x 2."""
        flat = np.ascontiguousarray(values).ravel()
        gradients = _rust.gradients(self.location, self.layout.basis, flat)
        return np.asarray(gradients).reshape(-1, 2, 2)
