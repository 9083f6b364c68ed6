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

    def _kernel(self, integral: Integral) -> tuple[Any, ...]:
        """An integral as `_rust.Kernels` reads it."""
        rules = list(self._compiled.densities)
        slots: list[tuple[Any, ...] | None] = []
        for slot in integral.slots:
            if slot.source == "fields":
                slots.append(None)
                continue
            assert slot.source != "traction"  # compilation rejects it in integrals over cells
            points, vertices = self.attachment.points[slot.source], slot.source == "vertex"
            slots.append((rules.index(slot.data), points, vertices, slot.columns))
        kernel, constants = integral.kernel, self.attachment.constants(integral).tolist()
        return kernel.module, kernel.address, integral.rank, integral.width, slots, constants

    def _kernels(self, rank: int, integrals: Sequence[Integral]) -> _rust.Kernels:
        return _rust.Kernels(self._assembler, rank, list(map(self._kernel, integrals)))

    @functools.cached_property
    def _of_residual(self) -> _rust.Kernels:
        return self._kernels(1, self._compiled.residual)

    @functools.cached_property
    def _of_tangent(self) -> tuple[_rust.Kernels, _rust.Kernels]:
        """Kernels of rank 2, and the pairs of kernels of rank 1 whose products are added."""
        pairs = [integral for pair in self._compiled.couplings for integral in pair]
        return self._kernels(2, self._compiled.tangent), self._kernels(1, pairs)

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.residual`."""
        with self._stopwatch("residual"):
            arrays, volume = list(data.values()), self.attachment.volume
            of_cells = self._assembler.vector(self._of_residual, arrays, volume, coefficients)
            forces = self.attachment.summed(of_cells)
        return self._ghost.add_forces(forces, coefficients, data)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """See `Assembly.tangent`."""
        with self._stopwatch("pattern"):
            if not reduction.same_unknowns(self.reduction):
                self._new_pattern(reduction)
        with self._stopwatch("tangent"):
            arrays, volume = list(data.values()), self.attachment.volume
            self._assembler.matrix(*self._of_tangent, arrays, volume, coefficients, *self._pattern)
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
