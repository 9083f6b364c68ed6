"""PETSc objects: who frees them, and how SciPy's matrices become theirs."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc


class Handles(dict[str, Any]):
    """PETSc objects by name; petsc4py frees them late or never, so we do.

    Each of petsc4py's handles (`getPC()`, `getFactorMatrix()`, ...) keeps the object behind it.

    Args:
        owner: When Python drops it, the handles go too.
        comm: Communicator of the objects.
    """

    def __init__(self, owner: object, comm: Any) -> None:
        super().__init__()
        weakref.finalize(owner, self._abandon, comm.size)

    def free(self, *names: str) -> None:
        """Free those of these names that are there; all of them if none is named. A call for all
        ranks, which wait for each other.
        """
        for name in names or list(self):
            if name in self:
                self.pop(name).destroy()

    def _abandon(self, ranks: int) -> None:
        """Python drops objects when it pleases, not on all ranks together: on several ranks PETSc
        keeps a list of what is dropped, for :func:`clean_up`.
        """
        if ranks == 1:
            self.free()
        else:
            self.clear()


#: One object on every communicator of several ranks: PETSc's own copy of a communicator is made and
#: dropped with the first and last object on it, and making it waits for all ranks.
_staying: list[Any] = []


def stay(comm: Any) -> None:
    """Keep PETSc's copy of a communicator; a call for all ranks."""
    _staying.append(PETSc.Vec().createMPI((1, PETSc.DETERMINE), comm=comm))


def clean_up(comm: Any) -> None:
    """Free what was dropped on all ranks; a call for all of them."""
    if comm.size > 1:
        PETSc.garbage_cleanup(comm)


def aij(comm: Any, rows: sp.spmatrix, own_columns: int) -> Any:
    """A distributed matrix from this rank's rows.

    Args:
        comm: Communicator.
        rows: Rows of this rank, columns counted over all ranks.
        own_columns: Number of columns that this rank owns.
    """
    csr: sp.csr_matrix = sp.csr_matrix(rows)
    csr.sort_indices()
    arrays = (csr.indptr.astype(PETSc.IntType), csr.indices.astype(PETSc.IntType), csr.data)
    size = ((csr.shape[0], PETSc.DETERMINE), (own_columns, PETSc.DETERMINE))
    return PETSc.Mat().createAIJ(size=size, csr=arrays, comm=comm)


def rows_of(matrix: Any) -> sp.csr_matrix:
    """This rank's rows of a PETSc matrix, columns counted over all ranks."""
    start, columns, values = matrix.getValuesCSR()
    shape = (len(start) - 1, matrix.getSize()[1])
    return sp.csr_matrix((np.array(values), columns, start), shape=shape)
