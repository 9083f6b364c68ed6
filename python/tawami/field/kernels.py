"""Kernels of a form at points in the cells of a grid: the particles, or points of a border."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.fem import dolfinx
from tawami.field.attachment import Attachment
from tawami.form.integral import Integral

Pair = tuple[Integral, Integral]


def assembler_of(
    location: _rust.Location, fields: Sequence[tuple[str, int, int]]
) -> _rust.Assembler:
    """The loop over the cells with points.

    Args:
        location: Cells of the points and positions in them.
        fields: Basis, number of components, and degree of the element of each field.
    """
    nodes, vertices = (
        np.rint(degree * dolfinx.reference_nodes(degree)).astype(int).tolist() for degree in (2, 1)
    )
    return _rust.Assembler(location, fields, nodes, vertices)


class KernelsAtPoints:
    """Kernels of residual and tangent, called at weighted points.

    Args:
        attachment: The form and the active cells.
        location: Cells of the points and positions in them.
        weight: One number per point: volumes of particles, lengths of a border.
        residual: Integrals of rank 1.
        tangent: Integrals of rank 2.
        couplings: Pairs of integrals of rank 1 whose products are part of the tangent.

    Attributes:
        weight: As given; another array may replace it.
    """

    def __init__(
        self,
        attachment: Attachment,
        location: _rust.Location,
        weight: Array,
        residual: Sequence[Integral],
        tangent: Sequence[Integral],
        couplings: Sequence[Pair] = (),
    ) -> None:
        self._attachment, self._location, self.weight = attachment, location, weight
        self._integrals = residual, tangent, [one for pair in couplings for one in pair]
        #: Kernels, which hold the values of the constants, with the version of these.
        self._residual: tuple[int, _rust.Kernels] | None = None
        self._tangent: tuple[int, _rust.Kernels, _rust.Kernels] | None = None

    @functools.cached_property
    def assembler(self) -> _rust.Assembler:
        """The loop over the cells with points."""
        layout = self._attachment.layout
        fields = [(f.basis, f.components, f.degree) for f in layout.fields.values()]
        return assembler_of(self._location, fields)

    def vector(self, data: Sequence[Array], coefficients: Array, *, absolute: bool) -> Array:
        """Residual on all coefficients, or the sums of absolute values of its contributions.

        Args:
            data: Data of each rule, points x columns.
            coefficients: Increments of all fields.
            absolute: Whether absolute values are summed.
        """
        kernels, weight = self._of_residual, self.weight
        return self.assembler.vector(kernels, data, weight, coefficients, absolute)

    def write_matrix(
        self,
        data: Sequence[Array],
        coefficients: Array,
        pattern: _rust.Pattern,
        values: Array,
        *,
        add: bool = False,
    ) -> None:
        """Write the tangent into the values of a reduced matrix, or add it to them.

        Args:
            data: Data of each rule, points x columns.
            coefficients: Increments of all fields.
            pattern: Pattern of the matrix, of cells that hold all of the points.
            values: Its values.
            add: Whether they are kept and added to.
        """
        self.assembler.matrix(
            *self._of_tangent, data, self.weight, coefficients, pattern, values, add
        )

    def _kernel(self, integral: Integral) -> tuple[Any, ...]:
        """An integral as `_rust.Kernels` reads it."""
        rules = list(self._attachment.compiled.densities)
        slots: list[tuple[Any, ...] | str] = []
        for slot in integral.slots:
            if slot.source in ("fields", "position"):
                slots.append(slot.source)
                continue
            slots.append((rules.index(slot.data), slot.source == "mean", slot.columns))
        kernel, constants = integral.kernel, self._attachment.constants(integral).tolist()
        point = None
        if integral.points is not None:
            place, entries = integral.points
            point = (place, entries.fields, entries.test, entries.trial)
        reads_position = integral.reads_position
        code = kernel.module, kernel.address
        return *code, integral.rank, integral.width, slots, constants, reads_position, point

    def _kernels(self, rank: int, integrals: Sequence[Integral]) -> _rust.Kernels:
        return _rust.Kernels(self.assembler, rank, list(map(self._kernel, integrals)))

    @property
    def _of_residual(self) -> _rust.Kernels:
        version = self._attachment.version
        if self._residual is None or self._residual[0] != version:
            self._residual = version, self._kernels(1, self._integrals[0])
        return self._residual[1]

    @property
    def _of_tangent(self) -> tuple[_rust.Kernels, _rust.Kernels]:
        """Kernels of rank 2, and the pairs of kernels of rank 1 whose products are added."""
        version = self._attachment.version
        if self._tangent is None or self._tangent[0] != version:
            _, tangent, pairs = self._integrals
            self._tangent = version, self._kernels(2, tangent), self._kernels(1, pairs)
        return self._tangent[1:]
