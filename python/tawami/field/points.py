"""Assembly at the particles: Rust calls point kernels and fills the reduced matrix (`rust/assembly`).

For each cell, on all threads: the integrand and its derivative at each particle, B^T r and B^T D B with
the functions there, and the sum into known entries of P^T K P. There is no matrix of the mesh. Integrals
over cells (`dx`) are kernels of FFCx on the cell. The numbers are those of `reference` (dolfinx) up to
round-off (`tests/field/test_assemblies.py`).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.errors import FormError
from tawami.fem import dolfinx
from tawami.fem.rules import Rule
from tawami.field.assembly import Assembly
from tawami.field.attachment import Attachment
from tawami.field.matrix import ReducedMatrix
from tawami.field.reduction import Reduction
from tawami.form.integral import Integral


class PointAssembly(Assembly):
    """Residual and tangent by kernels at the particles.

    Args:
        attachment: The form and the active cells.

    Raises:
        FormError: The fields have too many functions on a cell.
    """

    def __init__(self, attachment: Attachment) -> None:
        super().__init__(attachment)
        on_cell, _ = self.layout.on_cell(np.zeros(self.layout.grid.space.dim, dtype=np.int64))
        count = len(on_cell)
        if count > _rust.MAX_COEFFICIENTS:
            raise FormError(
                f"form {attachment.compiled.form.name}: too many fields: they have {count} coefficients "
                f"on a cell: expected at most {_rust.MAX_COEFFICIENTS}. Use fewer fields, or "
                "basis='bilinear' for some of them"
            )
        self._matrix = ReducedMatrix(attachment.grid.comm)
        #: Kernels, which hold the values of the constants, with the version of these.
        self._residual: tuple[int, _rust.Kernels] | None = None
        self._tangent: tuple[int, _rust.Kernels, _rust.Kernels] | None = None

    def follow(self, earlier: Assembly) -> None:
        """See `Assembly.follow`."""
        if isinstance(earlier, PointAssembly):
            self._matrix = earlier._matrix

    @functools.cached_property
    def _assembler(self) -> _rust.Assembler:
        to_grid = self.layout.grid.rectangle.to_grid_axes
        nodes, vertices = (
            np.rint(degree * to_grid(dolfinx.reference_nodes(degree))).astype(int).tolist()
            for degree in (2, 1)
        )
        fields = [(f.basis, f.components, f.degree) for f in self.layout.fields.values()]
        return _rust.Assembler(self.attachment.location, fields, nodes, vertices)

    def _kernel(self, integral: Integral) -> tuple[Any, ...]:
        """An integral as `_rust.Kernels` reads it."""
        rules = list(self._compiled.densities)
        slots: list[tuple[Any, ...] | str] = []
        for slot in integral.slots:
            if slot.source in ("fields", "position"):
                slots.append(slot.source)
                continue
            slots.append((rules.index(slot.data), slot.source == "mean", slot.columns))
        kernel, constants = integral.kernel, self.attachment.constants(integral).tolist()
        point = None
        if integral.points is not None:
            place, entries = integral.points
            point = (place, entries.fields, entries.test, entries.trial)
        reads_position = integral.reads_position
        code = kernel.module, kernel.address
        return *code, integral.rank, integral.width, slots, constants, reads_position, point

    def _kernels(self, rank: int, integrals: Sequence[Integral]) -> _rust.Kernels:
        return _rust.Kernels(self._assembler, rank, list(map(self._kernel, integrals)))

    @property
    def _of_residual(self) -> _rust.Kernels:
        if self._residual is None or self._residual[0] != self.attachment.version:
            kernels = self._kernels(1, self._compiled.residual)
            self._residual = self.attachment.version, kernels
        return self._residual[1]

    @property
    def _of_tangent(self) -> tuple[_rust.Kernels, _rust.Kernels]:
        """Kernels of rank 2, and the pairs of kernels of rank 1 whose products are added."""
        if self._tangent is None or self._tangent[0] != self.attachment.version:
            pairs = [integral for pair in self._compiled.couplings for integral in pair]
            kernels = self._kernels(2, self._compiled.tangent), self._kernels(1, pairs)
            self._tangent = self.attachment.version, *kernels
        return self._tangent[1:]

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.residual`."""
        forces = self._vector(coefficients, data, absolute=False)
        return self._ghost.add_forces(forces, coefficients, data)

    def magnitude(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.magnitude`."""
        return self._vector(coefficients, data, absolute=True)

    def _vector(self, coefficients: Array, data: Mapping[Rule, Array], *, absolute: bool) -> Array:
        with self._stopwatch("residual"):
            arrays, volume = list(data.values()), self.attachment.volume
            of_cells = self._assembler.vector(
                self._of_residual, arrays, volume, coefficients, absolute
            )
            return self.attachment.summed(of_cells)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """See `Assembly.tangent`."""
        matrix = self._matrix
        with self._stopwatch("pattern"):
            self.reduction = None
            matrix.fit(self._assembler, self.attachment, reduction)
            self.reduction = reduction
        with self._stopwatch("tangent"):
            arrays, volume = list(data.values()), self.attachment.volume
            self._assembler.matrix(
                *self._of_tangent, arrays, volume, coefficients, matrix.pattern, matrix.values
            )
            matrix.written()
        with self._stopwatch("reduction"):
            tangent = matrix.summed()
        return self._ghost.add_tangent(tangent, data, reduction)
