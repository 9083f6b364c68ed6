"""One field by itself: its unknowns, matrices on them, and their prolongation from coarser grids."""

from __future__ import annotations

from functools import reduce
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array, Mask
from tawami.base.petsc import aij
from tawami.field.attachment import Attachment
from tawami.field.kernels import assembler_of
from tawami.field.layout import Place
from tawami.field.matrix import ReducedMatrix
from tawami.field.reduction import Reduction
from tawami.grid.basis import refinement

#: Number of unknowns from which there is no coarser grid.
COARSEST = 300
#: Share of a coarse function on held functions from which the function is held.
HELD = 0.5


class Block:
    """One field of a reduction.

    The unknowns of a rank follow those of the rank before, in the order that they have in the reduction.

    Args:
        attachment: The form and the active cells.
        reduction: Unknowns of all fields.
        place: Place of the field.

    Attributes:
        selection: Coefficients of the field x unknowns, as `Reduction.selection`.
        unknowns: Number of the coefficient, in the field, of each unknown.
        mine: Whether each of this rank's unknowns in the reduction belongs to the field.
    """

    def __init__(self, attachment: Attachment, reduction: Reduction, place: Place) -> None:
        self._attachment, self._place = attachment, place
        self._layout, self._comm = reduction.layout, attachment.grid.comm
        of_field = place.holds(reduction.unknowns)
        self.selection = reduction.selection[place.slice][:, of_field].tocsr()
        self.unknowns = reduction.unknowns[of_field] - place.start
        self.mine: Mask = of_field[reduction.own]
        self.size, start = len(self.unknowns), int(of_field[: reduction.own.start].sum())
        self.own = slice(start, start + int(self.mine.sum()))
        self._held = reduction.fixed[place.slice]
        self._matrices: list[ReducedMatrix] = []

    @property
    def num_own(self) -> int:
        """Number of unknowns whose rows belong to this rank."""
        return self.own.stop - self.own.start

    def reached_by(self, cells: Any) -> Mask:
        """Whether each coefficient belongs to a function with one of these cells in its support."""
        return self._layout.reached_by(cells)[self._place.slice]

    def same_unknowns(self, other: object) -> bool:
        """Whether a matrix on other unknowns serves; it never does."""
        return False

    def assembled(self, kernel: Literal["elasticity", "mass"], data: Array) -> Any:
        """A matrix of sums over the particles, which lives as long as this block.

        Args:
            kernel: 'elasticity' for 2 mu eps(u) : eps(w) + lambda tr eps(u) tr eps(w), or 'mass' for
                c q p of a scalar field.
            data: mu and lambda, or c, of each particle, particles x 2 or 1 [Pa].
        """
        attachment, place = self._attachment, self._place
        fields = [(place.basis, place.components, place.degree)]
        assembler = assembler_of(attachment.grid, attachment.location, fields)
        if kernel == "elasticity":
            kernels = _rust.Kernels.elasticity(assembler, attachment.grid.geometry)
        else:
            kernels = _rust.Kernels.mass(assembler)
        matrix = ReducedMatrix(self._comm)
        self._matrices.append(matrix)
        matrix.fit(assembler, attachment, self)
        nothing, zero = _rust.Kernels(assembler, 1, []), np.zeros(self.selection.shape[0])
        assembler.matrix(
            kernels, nothing, [data], attachment.volume, zero, matrix.pattern, matrix.values
        )
        matrix.written()
        return matrix.summed()

    def reduced(self, matrix: sp.csr_matrix) -> Any:
        """S^T A S of a matrix A on all coefficients of all fields."""
        mine = matrix[self._place.slice][:, self._place.slice]
        rows = (self.selection.T @ mine @ self.selection).tocsr()[self.own]
        return aij(self._comm, rows, self.num_own)

    def prolongations(self) -> list[Any]:
        """Matrices from the unknowns of a coarser grid to those of the next finer one, the finest first.

        A coarse cell is 2 x 2 fine ones; at the upper ends of a grid of odd size it may reach beyond.
        Every basis contains that of the coarser grid (two-scale relation). Of a coarse function the part
        on functions with particles counts. It is held if more than half of it is on held functions.
        """
        cells: tuple[int, ...] = self._attachment.grid.cells
        components = self._place.components
        basis, unknowns, held = self._place.basis, self.unknowns, self._held
        owner, matrices = self._layout.owner[self._place.slice][unknowns], []
        while len(unknowns) > COARSEST and max(cells) > 1:
            along = [refinement(basis, n) for n in cells]
            whole = reduce(lambda inner, outer: sp.kron(outer, inner, format="csr"), along)
            whole = sp.kron(whole, sp.eye(components), format="csr")
            of_held = whole.T @ held.astype(float)
            held = of_held >= HELD * np.asarray(whole.sum(axis=0)).ravel()
            rows = whole[unknowns].tocsc()
            used = np.flatnonzero((np.diff(rows.indptr) > 0) & ~held)
            # a coarse unknown belongs to a rank of its part
            first = rows.indices[rows.indptr[used]]
            order = np.argsort(owner[first], kind="stable")
            used, mine = used[order], np.flatnonzero(owner == self._comm.rank)
            if len(used) >= len(unknowns):
                break
            coarse = owner[first][order]
            part = rows[:, used].tocsr()[mine]
            matrices.append(aij(self._comm, part, int((coarse == self._comm.rank).sum())))
            unknowns, owner, cells = used, coarse, tuple((n + 1) // 2 for n in cells)
        return matrices
