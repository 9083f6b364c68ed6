"""The fast assembly: Rust calls the kernels cell by cell and fills the reduced matrix (`rust/assembly`).

For each cell, on all threads: gather, kernel of FFCx, extraction, scatter into known entries of P^T K P.
There is no matrix of the mesh. The numbers are those of the reference assembly up to round-off
(`tests/field/test_fast_field.py`).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.petsc import Handles
from tawami.fem import dolfinx
from tawami.fem.rules import Rule
from tawami.field.assembly import Assembly
from tawami.field.attachment import Attachment
from tawami.field.ghost import GhostPenalty
from tawami.field.reduction import Reduction
from tawami.form.integral import Integral


class FastAssembly(Assembly):
    """Residual and tangent by kernels that Rust calls.

    Args:
        attachment: The form and the active cells.
    """

    #: Pattern of the matrix of this rank's cells, and its values.
    _pattern: tuple[_rust.Pattern, Array]

    def __init__(self, attachment: Attachment) -> None:
        self.attachment = attachment
        self._compiled, self._stopwatch = attachment.compiled, attachment.stopwatch
        self._comm = attachment.grid.comm
        self._ghost = GhostPenalty(attachment)
        self._petsc = Handles(self, self._comm)

    @functools.cached_property
    def _assembler(self) -> _rust.Assembler:
        to_grid = self.layout.grid.rectangle.to_grid_axes
        nodes, vertices = (
            np.rint(degree * to_grid(dolfinx.reference_nodes(degree))).astype(int).tolist()
            for degree in (2, 1)
        )
        bilinear = len(self._compiled.form.fields) > 1
        return _rust.Assembler(
            self.attachment.location, self.layout.basis, nodes, vertices, bilinear
        )

    def _kernels(self, integrals: Sequence[Integral], data: Mapping[Rule, Array]) -> list[Any]:
        """Address, rank, width, coefficients and constants of each kernel, for Rust."""
        kernels = []
        for integral in integrals:
            slots: list[Any] = []
            for slot in integral.slots:
                if slot.source == "fields":
                    slots.append(None)
                else:
                    assert (
                        slot.source != "traction"
                    )  # compilation rejects it in integrals over cells
                    points, columns = self.attachment.points[slot.source], list(slot.columns)
                    slots.append((data[slot.data], points, slot.source == "vertex", columns))
            constants = self.attachment.constants(integral).tolist()
            kernels.append(
                (integral.kernel.address, integral.rank, integral.width, slots, constants)
            )
        return kernels

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.residual`."""
        with self._stopwatch("residual"):
            kernels = self._kernels(self._compiled.residual, data)
            of_cells = self._assembler.vector(kernels, self.attachment.volume, coefficients)
            forces = self.attachment.summed(of_cells)
        return self._ghost.add_forces(forces, coefficients, data)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """See `Assembly.tangent`."""
        with self._stopwatch("pattern"):
            if not reduction.same_unknowns(self.reduction):
                self._new_pattern(reduction)
        with self._stopwatch("tangent"):
            kernels = self._kernels(self._compiled.tangent, data)
            couplings = [self._kernels(pair, data) for pair in self._compiled.couplings]
            volume = self.attachment.volume
            self._assembler.matrix(kernels, couplings, volume, coefficients, *self._pattern)
            self._petsc["of cells"].assemble()
        if self._comm.size == 1:
            return self._ghost.add_tangent(self._petsc["of cells"], data, reduction)
        with self._stopwatch("reduction"):
            unassembled, reduced = self._petsc["unassembled"], self._petsc["reduced"]
            unassembled.assemble()
            self._petsc["reduced"] = unassembled.convert("aij", reduced)
        return self._ghost.add_tangent(self._petsc["reduced"], data, reduction)

    def _new_pattern(self, reduction: Reduction) -> None:
        """Make the matrix of this rank's cells, in the unknowns that they reach.

        PETSc adds those of all ranks.
        """
        self._petsc.free("of cells", "unassembled", "reduced")
        self.reduction = None
        selection, used = reduction.selection, np.arange(reduction.size)
        if self._comm.size > 1:
            reached = self.layout.reached_by(self.attachment.location.active)
            selection, used = _rows_of(selection, reached)
        unknowns = reduction.unknowns[used]
        pattern = self._assembler.pattern(_selection(selection, unknowns))
        values = np.empty(len(pattern.columns))
        size, csr = (len(used), len(used)), (pattern.start, pattern.columns, values)
        # the matrix uses the arrays themselves: what Rust writes is what PETSc sees
        matrix = PETSc.Mat().createAIJWithArrays(size, csr, comm=PETSc.COMM_SELF)
        self._petsc["of cells"] = matrix
        if self._comm.size > 1:
            own = (reduction.num_own, reduction.size)
            numbers = PETSc.LGMap().create(used.astype(PETSc.IntType), comm=self._comm)
            # by name: their position depends on the version of petsc4py
            maps = {"lgmapr": numbers, "lgmapc": numbers}
            unassembled = PETSc.Mat().createIS((own, own), **maps, comm=self._comm)
            unassembled.setISLocalMat(matrix)
            numbers.destroy()
            self._petsc["unassembled"], self._petsc["reduced"] = unassembled, PETSc.Mat()
        self._pattern, self.reduction = (pattern, values), reduction


def _selection(s: sp.csr_matrix, unknowns: Indices) -> tuple[Any, ...]:
    """S in the form of `_rust.Assembler`."""
    return s.indptr.astype(np.int32), s.indices.astype(np.int32), s.data, unknowns


def _rows_of(s: sp.csr_matrix, coefficients: Mask) -> tuple[sp.csr_matrix, Any]:
    """The rows of S of some coefficients, in the unknowns that they name, and these unknowns.

    The other rows are empty.
    """
    entries = np.repeat(coefficients, np.diff(s.indptr))
    named = np.zeros(s.shape[1], dtype=bool)
    named[s.indices[entries]] = True
    lengths = np.where(coefficients, np.diff(s.indptr), 0)
    start = np.concatenate([[0], np.cumsum(lengths)])
    columns = (np.cumsum(named) - 1)[s.indices[entries]]
    shape = (s.shape[0], int(named.sum()))
    return sp.csr_matrix((s.data[entries], columns, start), shape=shape), np.flatnonzero(named)
