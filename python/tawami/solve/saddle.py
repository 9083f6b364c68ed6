"""Constraints of supports, whose multipliers are unknowns of the tangent.

    ( K   B^T ) ( dx )       ( R )
    ( B   -D  ) ( dl )  =  - ( e )

e are the errors of the constraints, linear in the coefficients, and B their derivatives. R contains the
forces -B^T l of the multipliers. D = 1e-10 diag(B diag(K)^-1 B^T) changes the iterates, not the solution
(proximal point: Rockafellar 1976). With it the matrix is regular although a constraint follows from
others. The system is symmetric if K is, and K may be singular without the constraints.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.petsc import Handles, aij, diagonal_of, rows_of, values_of
from tawami.base.rows import Rows
from tawami.field.reduction import Reduction

#: D relative to B diag(K)^-1 B^T.
PROXIMAL = 1e-10


class Saddle:
    """Adds rows and columns of constraints to reduced tangents. The last rank owns the multipliers.

    Args:
        comm: Communicator.

    Attributes:
        count: Number of constraints of the last matrix.
        num_own: Number of the multipliers that this rank owns.
    """

    def __init__(self, comm: Any) -> None:
        self._comm, self._petsc = comm, Handles(self, comm)
        self._tangent: Any = None
        none = np.zeros(0, dtype=np.int64)
        self._rows = self._own = Rows(none, none, np.zeros(0), (0, 0))
        #: Values of the matrix, the runs of those of K in it, and places of those of B^T, B and -D.
        self._values = np.zeros(0)
        self._of_tangent = list[tuple[slice, slice]]()
        self._others: Indices = np.zeros(0, dtype=np.int64)
        self.count = 0

    @property
    def num_own(self) -> int:
        """Number of multipliers that this rank owns."""
        return self.count if self._comm.rank == self._comm.size - 1 else 0

    def of(self, tangent: Any, gradients: Rows, reduction: Reduction) -> Any:
        """The matrix of a tangent and constraints; a collective call.

        It is the same object as long as the tangent is and B has the same pattern.

        Args:
            tangent: Reduced tangent K.
            gradients: Derivatives of the errors by the coefficients of this rank, constraints x
                coefficients.
            reduction: The unknowns.
        """
        self.count = gradients.shape[0]
        rows = reduction.of_constraints(gradients)
        same = self._tangent is tangent and self._rows.same_places(rows)
        same = not ranks.anywhere(self._comm, not same)
        self._rows, self._tangent = rows, tangent
        stiffness = np.abs(diagonal_of(tangent))
        largest = ranks.largest(self._comm, float(stiffness.max(initial=0.0)))
        stiffness[stiffness == 0] = largest or 1.0
        self._own = rows.columns(reduction.own)
        every = np.arange(self.count)
        sizes = -PROXIMAL * self._squares(1 / stiffness)
        added = [self._own.transposed]
        if self.num_own:
            added += [rows, Rows(every, every, sizes, (self.count, self.count))]
        if not same:
            self._make([rows_of(tangent), *(part.csr for part in added)])
        given = values_of(tangent)
        for place, mine in self._of_tangent:
            self._values[place] = given[mine]
        self._values[self._others] = np.concatenate([part.values for part in added])
        matrix = self._petsc["matrix"]
        if self._comm.size > 1:
            matrix.setValuesCSR(*self._pattern, self._values)
        matrix.assemble()
        return matrix

    def _make(self, parts: list[sp.csr_matrix]) -> None:
        """Make a matrix with the pattern of the parts."""
        ends = np.cumsum([0, *(part.nnz for part in parts)])
        blocks = [
            sp.csr_matrix((np.arange(a, b), part.indices, part.indptr), shape=part.shape)
            for part, a, b in zip(parts, ends[:-1], ends[1:], strict=True)
        ]
        whole = sp.hstack(blocks[:2], format="csr")
        if len(blocks) > 2:
            whole = sp.vstack([whole, sp.hstack(blocks[2:], format="csr")], format="csr")
        whole.sort_indices()
        self._values, self._of_tangent = np.zeros(whole.nnz), _runs(whole.data < parts[0].nnz)
        places = np.empty(whole.nnz, dtype=np.int64)
        places[whole.data] = np.arange(whole.nnz)
        self._others = places[parts[0].nnz :]
        self._pattern = (whole.indptr.astype(PETSc.IntType), whole.indices.astype(PETSc.IntType))
        self._petsc.free("matrix")
        if self._comm.size > 1:
            zero = sp.csr_matrix((self._values, whole.indices, whole.indptr), shape=whole.shape)
            self._petsc["matrix"] = aij(self._comm, zero, whole.shape[0])
            return
        # the matrix uses the array itself
        csr = (*self._pattern, self._values)
        self._petsc["matrix"] = PETSc.Mat().createAIJWithArrays(whole.shape, csr, comm=self._comm)

    def factors(self, of_unknowns: Array) -> Array:
        """Factors of this rank's unknowns and multipliers in a scaled system; a collective call.

        Args:
            of_unknowns: Factors of this rank's unknowns.
        """
        sizes = self._squares(of_unknowns**2)
        return np.concatenate([of_unknowns, 1 / np.sqrt(sizes[: self.num_own])])

    def _squares(self, weights: Array) -> Array:
        """Diagonal of B W B^T, W the diagonal matrix of weights of this rank's unknowns; 1 where it is
        0, as others hold all that the constraint acts on. A collective call.
        """
        own = self._own
        squares = Rows(own.row, own.column, own.values**2, own.shape).times(weights)
        sizes = ranks.sum_of(self._comm, squares)
        return np.asarray(np.where(sizes > 0, sizes, 1.0))


def _runs(chosen: Mask) -> list[tuple[slice, slice]]:
    """Runs of chosen entries of an array, and the places of these among all that are chosen."""
    ends = np.flatnonzero(np.diff(chosen, prepend=False, append=False)).reshape(-1, 2)
    after = np.cumsum(ends[:, 1] - ends[:, 0])
    before = after - (ends[:, 1] - ends[:, 0])
    return [
        (slice(*place), slice(*mine))
        for place, mine in zip(
            ends.tolist(), np.stack([before, after], axis=1).tolist(), strict=True
        )
    ]
