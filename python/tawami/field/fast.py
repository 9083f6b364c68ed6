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
                    slots.append((data[slot.data], points, slot.source == "vertex", columns))
            constants = self._constants(integral).tolist()
            kernels.append(
                (integral.kernel.address, integral.rank, integral.width, slots, constants)
            )
        return kernels

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Internal forces and volume residual on all coefficients, before supports, on every rank."""
        with self.stopwatch("residual"):
            kernels = self._kernels(self.compiled.residual, data)
            forces = self._sum(self._assembler.vector(kernels, self._volume, coefficients))
        return self._with_ghost(forces, coefficients, data)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """P^T K P as a PETSc matrix; it is overwritten by the next call, and stays the same object
        as long as the unknowns do.
        """
        with self.stopwatch("pattern"):
            if not reduction.same_unknowns(self.reduction):
                self._new_pattern(reduction)
        with self.stopwatch("tangent"):
            kernels = self._kernels(self.compiled.tangent, data)
            couplings = [self._kernels(pair, data) for pair in self.compiled.couplings]
            self._assembler.matrix(kernels, couplings, self._volume, coefficients, *self._pattern)
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
