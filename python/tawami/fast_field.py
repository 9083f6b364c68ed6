"""The field side without a matrix of the mesh: kernels called from Rust, into the reduced matrix.

It does what `Field` does, from the same compiled form (`rust/assembly`): gather, FFCx kernel and
extraction cell by cell on all threads, scatter into known slots of P^T K P. Edge terms stay with
`Field`. Both give the same numbers to round-off (`tests/test_fast_field.py`).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from tawami import _dolfinx, _rust
from tawami.compilation import Integral
from tawami.density import Rule
from tawami.field import Field
from tawami.reduction import Reduction

Array = npt.NDArray[np.float64]


class FastField(Field):
    """A compiled form on the active cells of a grid; made as `Field` is."""

    _pattern: tuple[_rust.Pattern, Array]

    @functools.cached_property
    def _assembler(self) -> _rust.Assembler:
        to_grid = self.grid.rectangle.to_grid_axes
        nodes, vertices = (
            np.rint(degree * to_grid(_dolfinx.reference_nodes(degree))).astype(int).tolist()
            for degree in (2, 1)
        )
        bilinear = len(self.compiled.form.fields) > 1
        return _rust.Assembler(self._location, self.layout.basis, nodes, vertices, bilinear)

    def _kernels(self, integrals: Sequence[Integral], data: Mapping[Rule, Array]) -> list[Any]:
        """Address, rank, width, coefficients and constants of each kernel, as Rust takes them."""
        kernels = []
        for integral in integrals:
            slots: list[Any] = []
            for slot in integral.slots:
                if slot.source == "fields":
                    slots.append(None)
                else:
                    assert slot.source != "traction"  # refused in integrals over cells
                    points, columns = self._points[slot.source], list(slot.columns)
                    slots.append((data[slot.source], points, columns))
            constants = self._constants(integral).tolist()
            kernels.append(
                (integral.kernel.address, integral.rank, integral.width, slots, constants)
            )
        return kernels

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Internal forces and volume residual on all coefficients, before supports."""
        with self.stopwatch("residual"):
            kernels = self._kernels(self.compiled.residual, data)
            return self._assembler.vector(kernels, self._volume, coefficients)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """P^T K P as a PETSc matrix; it is overwritten by the next call."""
        with self.stopwatch("pattern"):
            if self._reduction is not reduction:
                self._new_pattern(reduction)
        with self.stopwatch("tangent"):
            self._fill(coefficients, data, *self._pattern)
            matrix = self._petsc["reduced"]
            matrix.assemble()
        return matrix

    def _fill(
        self,
        coefficients: Array,
        data: Mapping[Rule, Array],
        pattern: _rust.Pattern,
        values: Array,
    ) -> None:
        kernels = self._kernels(self.compiled.tangent, data)
        self._assembler.matrix(kernels, self._volume, coefficients, pattern, values)

    def unreduced_tangent(self, coefficients: Array, data: Mapping[Rule, Array]) -> sp.csr_matrix:
        """E^T K E, the tangent of :meth:`residual`."""
        n = self.layout.size
        pattern = self._assembler.pattern(_selection(sp.identity(n, format="csr"), np.arange(n)))
        values = np.zeros(len(pattern.columns))
        self._fill(coefficients, data, pattern, values)
        return sp.csr_matrix((values, pattern.columns, pattern.start), shape=(n, n))

    def _new_pattern(self, reduction: Reduction) -> None:
        self._petsc.free("reduced")
        self._reduction = None
        pattern = self._assembler.pattern(_selection(reduction.selection, reduction.unknowns))
        values = np.zeros(len(pattern.columns))
        size, csr = (reduction.size, reduction.size), (pattern.start, pattern.columns, values)
        # the matrix uses the arrays themselves: what Rust writes is what PETSc sees
        matrix = PETSc.Mat().createAIJWithArrays(size, csr, comm=self.grid.comm)
        self._petsc["reduced"] = matrix
        self._pattern, self._reduction = (pattern, values), reduction


def _selection(s: sp.csr_matrix, unknowns: npt.NDArray[np.int64]) -> tuple[Any, ...]:
    """S as `_rust.Assembler` takes it."""
    return s.indptr.astype(np.int32), s.indices.astype(np.int32), s.data, unknowns
