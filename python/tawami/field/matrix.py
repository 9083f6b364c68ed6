"""The reduced matrix of the assembly at the particles: pattern, values and PETSc objects."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.petsc import Handles
from tawami.field.attachment import Attachment
from tawami.field.unknowns import Unknowns


class ReducedMatrix:
    """P^T K P as a PETSc matrix whose values Rust writes.

    Assemblies follow one another when the grid is reset. They share this object, so that the pattern,
    and the analysis of the solver for it, are made once for the same unknowns.

    Args:
        comm: Communicator.

    Attributes:
        reduction: The reduction that it belongs to; None before the first.
        pattern: Pattern of the matrix of this rank's cells, in the unknowns that they reach.
        values: Its values.
    """

    pattern: _rust.Pattern
    values: Array

    def __init__(self, comm: Any) -> None:
        self._comm, self._petsc = comm, Handles(self, comm)
        self.reduction: Unknowns | None = None

    def fit(self, assembler: _rust.Assembler, attachment: Attachment, reduction: Unknowns) -> None:
        """Make a new matrix if the unknowns, or the cells that couple them, are others.

        A collective call.
        """
        if reduction.same_unknowns(self.reduction):
            return
        self._petsc.free()
        self.reduction = None
        selection, used = reduction.selection, np.arange(len(reduction.number))
        if self._comm.size > 1:
            reached = reduction.reached_by(attachment.location.active)
            selection, used = _rows_of(selection, reached)
        pattern = assembler.pattern(as_arrays(selection, reduction.place[used]))
        values = np.empty(len(pattern.columns))
        size, csr = (len(used), len(used)), (pattern.start, pattern.columns, values)
        # the matrix uses the arrays themselves: what Rust writes is what PETSc sees
        matrix = PETSc.Mat().createAIJWithArrays(size, csr, comm=PETSc.COMM_SELF)
        self._petsc["of cells"] = matrix
        if self._comm.size > 1:
            own = (reduction.num_own, reduction.size)
            known = reduction.number[used].astype(PETSc.IntType)
            numbers = PETSc.LGMap().create(known, comm=self._comm)
            # by name: their position depends on the version of petsc4py
            maps = {"lgmapr": numbers, "lgmapc": numbers}
            unassembled = PETSc.Mat().createIS((own, own), **maps, comm=self._comm)
            unassembled.setISLocalMat(matrix)
            numbers.destroy()
            self._petsc["unassembled"], self._petsc["reduced"] = unassembled, PETSc.Mat()
        self.pattern, self.values, self.reduction = pattern, values, reduction

    def written(self) -> None:
        """Tell PETSc that Rust has written the values."""
        self._petsc["of cells"].assemble()

    def summed(self) -> Any:
        """The matrix with the cells of all ranks; the same object as long as the unknowns are."""
        if self._comm.size == 1:
            return self._petsc["of cells"]
        unassembled, reduced = self._petsc["unassembled"], self._petsc["reduced"]
        unassembled.assemble()
        self._petsc["reduced"] = unassembled.convert("aij", reduced)
        return self._petsc["reduced"]


def as_arrays(s: sp.csr_matrix, unknowns: Indices) -> tuple[Any, ...]:
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
