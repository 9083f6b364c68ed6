"""PETSc objects: who frees them, and conversion between SciPy's matrices and theirs."""

from __future__ import annotations

import contextlib
import ctypes
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc

if TYPE_CHECKING:  # SciPy takes longer to import than all of this room
    import scipy.sparse as sp


#: A setting of glibc (malloc.h): the number of large arrays that may have pages of their own, and its
#: default. Libraries that come with PETSc set it to 0, after which freed arrays stay with the process.
M_MMAP_MAX, MANY = -4, 65536
with contextlib.suppress(AttributeError, OSError):  # another library for C
    ctypes.CDLL(None).mallopt(M_MMAP_MAX, MANY)


class Handles(dict[str, Any]):
    """PETSc objects by name, freed with their owner: petsc4py frees them late or never.

    Every handle of petsc4py (`getPC()`, `getFactorMatrix()`, ...) keeps its object alive.

    Args:
        owner: The handles are freed when Python frees this object.
        comm: Communicator of the objects.
    """

    def __init__(self, owner: object, comm: Any) -> None:
        super().__init__()
        weakref.finalize(owner, self._abandon, comm.size)

    def free(self, *names: str) -> None:
        """Free the objects of these names that exist; all objects if no name is given. A call for all
        ranks, which wait for each other.
        """
        for name in names or list(self):
            if name in self:
                self.pop(name).destroy()

    def _abandon(self, ranks: int) -> None:
        """Free the objects of an owner that no longer exists.

        Python frees the owners at other times on other ranks: on several ranks PETSc keeps a list of
        these objects for :func:`clean_up`.
        """
        if ranks == 1:
            self.free()
        else:
            self.clear()


#: One object on every communicator of several ranks. PETSc copies a communicator for the first object
#: on it and frees the copy with the last one; to make a copy, it waits for all ranks.
_kept: list[Any] = []


def keep_communicator(comm: Any) -> None:
    """Keep the copy that PETSc makes of a communicator; a call for all ranks."""
    _kept.append(PETSc.Vec().createMPI((1, PETSc.DETERMINE), comm=comm))


def clean_up(comm: Any) -> None:
    """Free objects that are no longer used on any rank; a call for all ranks."""
    if comm.size > 1:
        PETSc.garbage_cleanup(comm)


def aij(comm: Any, rows: sp.spmatrix, own_columns: int) -> Any:
    """A distributed matrix.

    Args:
        comm: Communicator.
        rows: Rows of this rank, with columns numbered over all ranks.
        own_columns: Number of columns that this rank owns.
    """
    csr: sp.csr_matrix = rows.tocsr()
    csr.sort_indices()
    arrays = (csr.indptr.astype(PETSc.IntType), csr.indices.astype(PETSc.IntType), csr.data)
    size = ((csr.shape[0], PETSc.DETERMINE), (own_columns, PETSc.DETERMINE))
    return PETSc.Mat().createAIJ(size=size, csr=arrays, comm=comm)


def rows_of(matrix: Any, *, copy: bool = True) -> sp.csr_matrix:
    """Rows of a PETSc matrix on this rank, with columns numbered over all ranks.

    Args:
        matrix: The matrix.
        copy: Whether the entries are a copy. Else they may be the array of the matrix itself.
    """
    from scipy.sparse import csr_matrix

    start, columns, values = matrix.getAttr("__csr__") or matrix.getValuesCSR()
    shape = (len(start) - 1, matrix.getSize()[1])
    return csr_matrix((np.array(values) if copy else values, columns, start), shape=shape)


def values_of(matrix: Any) -> Any:
    """Entries of a PETSc matrix on this rank, row by row.

    They are the array of the matrix itself if it was made of arrays of NumPy, else a copy.
    """
    arrays = matrix.getAttr("__csr__")
    return (arrays or matrix.getValuesCSR())[2]


def diagonal_of(matrix: Any) -> Any:
    """Diagonal of a PETSc matrix, the entries of this rank; a collective call."""
    vector = matrix.getDiagonal()
    entries = vector.array.copy()
    vector.destroy()
    return entries


def add_rows(matrix: Any, rows: sp.csr_matrix) -> None:
    """Add to a PETSc matrix whose pattern contains that of `rows`, the rows of this rank."""
    start, columns = (part.astype(PETSc.IntType) for part in (rows.indptr, rows.indices))
    matrix.setValuesCSR(start, columns, rows.data, addv=True)
    matrix.assemble()


def add_diagonal(matrix: Any, values: Any) -> None:
    """Add to the diagonal of a PETSc matrix whose pattern contains it, the entries of this rank."""
    vector = matrix.createVecLeft()
    vector.setArray(values)
    matrix.setDiagonal(vector, addv=True)
    vector.destroy()
