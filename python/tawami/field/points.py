"""Assembly at the particles: Rust calls point kernels and fills the reduced matrix (`rust/assembly`).

For each cell, on all threads: the integrand and its derivative at each particle, B^T r and B^T D B with
the functions there, and the sum into known entries of P^T K P. There is no matrix of the mesh. Integrals
over cells (`dx`) are kernels of FFCx on the cell. The numbers are those of `reference` (dolfinx) up to
round-off (`tests/field/test_assemblies.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.errors import FormError
from tawami.fem.rules import Rule
from tawami.field.assembly import Assembly
from tawami.field.attachment import Attachment
from tawami.field.kernels import KernelsAtPoints
from tawami.field.matrix import ReducedMatrix
from tawami.field.reduction import Reduction


class PointAssembly(Assembly):
    """Residual and tangent by kernels at the particles.

    Args:
        attachment: The form and the active cells.

    Raises:
        FormError: The fields have too many functions on a cell.
    """

    def __init__(self, attachment: Attachment) -> None:
        super().__init__(attachment)
        (on_cell,), _ = self.layout.on_cells(np.array([self.layout.window.first]))
        count = len(on_cell)
        if count > _rust.MAX_COEFFICIENTS:
            raise FormError(
                f"form {attachment.compiled.form.name}: too many fields: they have {count} coefficients "
                f"on a cell: expected at most {_rust.MAX_COEFFICIENTS}. Use fewer fields, or "
                "basis='bilinear' for some of them"
            )
        self._matrix = ReducedMatrix(attachment.grid.comm)
        compiled = attachment.compiled
        self._kernels = KernelsAtPoints(
            attachment, attachment.location, attachment.volume,
            compiled.residual, compiled.tangent, compiled.couplings,
        )  # fmt: skip

    def integrate_with(self, volume: Array) -> None:
        """See `Assembly.integrate_with`."""
        super().integrate_with(volume)
        self._kernels.weight = volume

    def follow(self, earlier: Assembly) -> None:
        """See `Assembly.follow`."""
        if isinstance(earlier, PointAssembly):
            self._matrix = earlier._matrix

    def forces(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.forces`."""
        return self._vector(coefficients, data, absolute=False)

    def magnitude(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.magnitude`."""
        return self._vector(coefficients, data, absolute=True)

    def _vector(self, coefficients: Array, data: Mapping[Rule, Array], *, absolute: bool) -> Array:
        with self._stopwatch("residual"):
            arrays = list(data.values())
            of_cells = self._kernels.vector(arrays, coefficients, absolute=absolute)
            if self._compiled.border:
                of_cells = self.border.add_vector(of_cells, coefficients, absolute=absolute)
            return self.layout.sum(of_cells)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """See `Assembly.tangent`."""
        matrix = self._matrix
        with self._stopwatch("pattern"):
            self.reduction = None
            matrix.fit(self._kernels.assembler, self.attachment, reduction)
            self.reduction = reduction
        with self._stopwatch("tangent"):
            arrays, place = list(data.values()), (matrix.pattern, matrix.values)
            self._kernels.write_matrix(arrays, coefficients, *place)
            if self._compiled.border:
                self.border.add_matrix(coefficients, *place)
            matrix.written()
        with self._stopwatch("reduction"):
            tangent = matrix.summed()
        return self._ghost.add_tangent(tangent, data, reduction)
