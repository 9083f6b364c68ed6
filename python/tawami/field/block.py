"""One field by itself: its unknowns, matrices on them, and their prolongation from coarser grids."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.field.attachment import Attachment
from tawami.field.coefficients import Place
from tawami.field.kernels import assembler_of
from tawami.field.matrix import ReducedMatrix
from tawami.field.prolongation import GridUnknowns, prolongations
from tawami.field.reduction import Reduction
from tawami.field.unknowns import Unknowns


class Block(Unknowns):
    """One field of a reduction. Making one is a collective call.

    The unknowns of a rank follow those of the rank before, in the order that they have in the reduction.

    Args:
        attachment: The form and the active cells.
        reduction: Unknowns of all fields.
        place: Place of the field.

    Attributes:
        selection: Coefficients of the field x unknowns, as `Reduction.selection`.
        mine: Whether each of this rank's unknowns in the reduction belongs to the field.
    """

    def __init__(self, attachment: Attachment, reduction: Reduction, place: Place) -> None:
        self._attachment, self._place, self._first = attachment, place, place.start
        comm = attachment.grid.comm
        # unknowns outside the window are those of points, of the displacement
        of_field = place.holds(np.maximum(reduction.place, 0))
        self.mine: Mask = of_field[: reduction.num_own]
        counts = np.array(comm.allgather(int(self.mine.sum())))
        start = int(counts[: comm.rank].sum())
        number = np.full(len(of_field), -1)
        number[: len(self.mine)][self.mine] = np.arange(start, start + counts[comm.rank])
        reduction.exchange.update(number)
        self.selection = reduction.selection[place.slice][:, of_field].tocsr()
        places = np.where(reduction.place < 0, -1, reduction.place - place.start)[of_field]
        own = slice(start, start + int(counts[comm.rank]))
        self._set(reduction.layout, number[of_field], places, own, int(counts.sum()))
        self._matrices: list[ReducedMatrix] = []
        self._held = np.flatnonzero((reduction.fixed & reduction.layout.own)[place.slice])

    def _places_of(self, in_grid: Indices) -> Indices:
        """See `Unknowns`."""
        return np.maximum(self.layout.places(in_grid) - self._first, -1)

    def reached_by(self, cells: Any) -> Mask:
        """Whether each coefficient belongs to a function with one of these cells in its support."""
        return self.layout.reached_by(cells)[self._place.slice]

    def assembled(self, kernel: Literal["elasticity", "mass"], data: Array) -> Any:
        """A matrix of sums over the particles, which lives as long as this block.

        Args:
            kernel: 'elasticity' for 2 mu eps(u) : eps(w) + lambda tr eps(u) tr eps(w), or 'mass' for
                c q p of a scalar field.
            data: mu and lambda, or c, of each particle, particles x 2 or 1 [Pa].
        """
        attachment, place = self._attachment, self._place
        fields = [(place.basis, place.components, place.degree)]
        assembler = assembler_of(attachment.location, fields)
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

    def of_window(self, matrix: sp.csr_matrix, far: Indices | None = None) -> sp.csr_matrix:
        """See `Unknowns`; A is on the coefficients of all fields, and those far are of this one."""
        mine = np.r_[self._place.slice, self.layout.size : matrix.shape[0]]
        return super().of_window(matrix[mine][:, mine], far)

    def prolongations(self) -> list[Any]:
        """Matrices from the unknowns of a coarser grid to those of the next finer one, the finest first.

        A collective call; see `tawami.field.prolongation`.
        """
        place, layout = self._place, self.layout
        there = next(
            of for name, of in layout.of_grid.items() if layout.fields[name] is self._place
        )

        def in_field(coefficients: Indices) -> Indices:
            return np.asarray(layout.in_grid[place.start + coefficients] - there.start)

        cells = self._attachment.grid.cells
        unknowns = in_field(self.coefficients)
        if place.start == 0:  # parts are those of the displacement
            unknowns = unknowns + layout.parts[1][self.coefficients] * (there.stop - there.start)
        level = GridUnknowns(cells, unknowns, in_field(self._held))
        comm = self._attachment.grid.comm
        return list(prolongations(comm, place.basis, place.components, level))
