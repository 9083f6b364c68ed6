"""The sum of a reduced tangent and a sparse matrix."""

from __future__ import annotations

from typing import Any

import scipy.sparse as sp
from petsc4py import PETSc

from tawami.base import ranks
from tawami.base.arrays import Indices
from tawami.base.petsc import Handles, add_rows, aij
from tawami.base.places import same_places
from tawami.field.reduction import Reduction


class Sum:
    """Adds S^T A S to reduced tangents, A a matrix on all coefficients.

    Args:
        comm: Communicator.
    """

    def __init__(self, comm: Any) -> None:
        self._comm, self._petsc = comm, Handles(self, comm)
        #: What is in `_petsc`: the sum of this tangent and this matrix, with its reduced rows.
        self._tangent: Any = None
        self._matrix: sp.csr_matrix | None = None
        self._rows: sp.csr_matrix | None = None

    def of(
        self,
        tangent: Any,
        matrix: sp.csr_matrix,
        reduction: Reduction,
        far: Indices | None = None,
    ) -> Any:
        """The sum: the same object as long as the tangent is the same and the matrix has its pattern.

        Args:
            tangent: A reduced tangent.
            matrix: The part of this rank in A. If its values change it must be another object.
            reduction: S.
            far: See `Unknowns.of_window`.
        """
        known, same = self._petsc, self._tangent is tangent
        if not same or self._matrix is not matrix:
            rows = reduction.of_window(matrix, far)
            differs = not (same and same_places(self._rows, rows))
            same = not ranks.anywhere(self._comm, differs)
            self._rows = rows
        if same:
            known["total"].zeroEntries()
            known["total"].axpy(1.0, tangent, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
            add_rows(known["total"], self._rows)
        else:
            known.free("total")
            part = aij(self._comm, self._rows, reduction.num_own)
            known["total"] = tangent.copy()
            known["total"].axpy(1.0, part, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
            part.destroy()
        self._tangent, self._matrix = tangent, matrix
        return known["total"]
