"""The field side without a matrix of the mesh: kernels called from Rust, into the reduced matrix.

It does what `Field` does, from the same compiled form (`rust/assembly`): gather, FFCx kernel and
extraction cell by cell on all threads, scatter into known slots of P^T K P. Edge terms stay with
`Field`. Both give the same numbers to round-off (`tests/field/test_fast_field.py`).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from tawami import _rust
from tawami.fem import dolfinx
from tawami.fem.rules import Rule
from tawami.field.reduction import Reduction
from tawami.field.reference import Field
from tawami.form.compilation import Integral

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


class FastField(Field):
    """A compiled form on the active cells of a grid; made as `Field` is."""

    _pattern: tuple[_rust.Pattern, Array]

    @functools.cached_property
    def _assembler(self) -> _rust.Assembler:
        to_grid = self.grid.rectangle.to_grid_axes
        nodes, vertices = (
            np.rint(degree * to_grid(dolfinx.reference_nodes(degree))).astype(int).tolist()
            for degree in (2, 1)
        )
        bilinear = len(self.compiled.form.fields) > 1
        return _rust.Assembler(self._location, self.layout.basis, nodes, vertices, bilinear)

    def _kernel(self, integral: Integral) -> tuple[Any, ...]:
        """An integral as `_rust.Kernels` reads it."""
        rules = list(self.compiled.densities)
        slots: list[tuple[Any, ...] | None] = []
        for slot in integral.slots:
            if slot.source == "fields":
                slots.append(None)
                continue
            assert slot.source != "traction"  # rejected in integrals over cells
            points, vertices = self._points[slot.source], slot.source == "vertex"
            slots.append((rules.index(slot.data), points, vertices, slot.columns))
        kernel, constants = integral.kernel, self._constants(integral).tolist()
        return kernel.module, kernel.address, integral.rank, integral.width, slots, constants

    def _kernels(self, rank: int, integrals: Sequence[Integral]) -> _rust.Kernels:
        return _rust.Kernels(self._assembler, rank, list(map(self._kernel, integrals)))

    @functools.cached_property
    def _of_residual(self) -> _rust.Kernels:
        return self._kernels(1, self.compiled.residual)

    @functools.cached_property
    def _of_tangent(self) -> tuple[_rust.Kernels, _rust.Kernels]:
        """Kernels of rank 2, and the pairs of kernels of rank 1 whose products are added."""
        pairs = [integral for pair in self.compiled.couplings for integral in pair]
        return self._kernels(2, self.compiled.tangent), self._kernels(1, pairs)

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Internal forces and volume residual on all coefficients, before supports, on every rank."""
        with self.stopwatch("residual"):
            arrays = list(data.values())
            vector = self._assembler.vector(self._of_residual, arrays, self._volume, coefficients)
            forces = self._sum(vector)
        return self._with_ghost(forces, coefficients, data)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """P^T K P as a PETSc matrix; it is overwritten by the next call, and stays the same object
        as long as the unknowns do.
        """
        with self.stopwatch("pattern"):
            if not reduction.same_unknowns(self.reduction):
                self._new_pattern(reduction)
        with self.stopwatch("tangent"):
            arrays = list(data.values())
            self._assembler.matrix(
                *self._of_tangent, arrays, self._volume, coefficients, *self._pattern
            )
            self._petsc["of cells"].assemble()
        if self.grid.comm.size == 1:
            return self._tangent_with_ghost(self._petsc["of cells"], data, reduction)
        with self.stopwatch("reduction"):
            unassembled, reduced = self._petsc["unassembled"], self._petsc["reduced"]
            unassembled.assemble()
            self._petsc["reduced"] = unassembled.convert("aij", reduced)
        return self._tangent_with_ghost(self._petsc["reduced"], data, reduction)

    def _new_pattern(self, reduction: Reduction) -> None:
        """Pattern and matrix of what this rank's cells add, in the unknowns that they reach; the sum
        over the ranks is PETSc's.
        """
        self._petsc.free("of cells", "unassembled", "reduced")
        self.reduction = None
        selection, used = reduction.selection, np.arange(reduction.size)
        if self.grid.comm.size > 1:
            reached = self.layout.reached_by(self._location.active)
            selection, used = _rows_of(selection, reached)
        unknowns = reduction.unknowns[used]
        pattern = self._assembler.pattern(_selection(selection, unknowns))
        values = np.empty(len(pattern.columns))
        size, csr = (len(used), len(used)), (pattern.start, pattern.columns, values)
        # the matrix uses the arrays themselves: what Rust writes is what PETSc sees
        matrix = PETSc.Mat().createAIJWithArrays(size, csr, comm=PETSc.COMM_SELF)
        self._petsc["of cells"] = matrix
        if self.grid.comm.size > 1:
            own = (reduction.own.stop - reduction.own.start, reduction.size)
            numbers = PETSc.LGMap().create(used.astype(PETSc.IntType), comm=self.grid.comm)
            maps = {"lgmapr": numbers, "lgmapc": numbers}  # their position changed with petsc4py
            unassembled = PETSc.Mat().createIS((own, own), **maps, comm=self.grid.comm)
            unassembled.setISLocalMat(matrix)
            numbers.destroy()
            self._petsc["unassembled"], self._petsc["reduced"] = unassembled, PETSc.Mat()
        self._pattern, self.reduction = (pattern, values), reduction


def _selection(s: sp.csr_matrix, unknowns: npt.NDArray[np.int64]) -> tuple[Any, ...]:
    """S as `_rust.Assembler` takes it."""
    return s.indptr.astype(np.int32), s.indices.astype(np.int32), s.data, unknowns


def _rows_of(s: sp.csr_matrix, coefficients: Mask) -> tuple[sp.csr_matrix, Any]:
    """The rows of S of some coefficients, empty for the others, in the unknowns that they name; and
    these unknowns.
    """
    entries = np.repeat(coefficients, np.diff(s.indptr))
    named = np.zeros(s.shape[1], dtype=bool)
    named[s.indices[entries]] = True
    lengths = np.where(coefficients, np.diff(s.indptr), 0)
    start = np.concatenate([[0], np.cumsum(lengths)])
    columns = (np.cumsum(named) - 1)[s.indices[entries]]
    shape = (s.shape[0], int(named.sum()))
    return sp.csr_matrix((s.data[entries], columns, start), shape=shape), np.flatnonzero(named)
