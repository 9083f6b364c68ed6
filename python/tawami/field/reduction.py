"""Unknowns that the supports leave free: coefficients = S unknowns + offset.

With the extraction E of the layout, the degrees of freedom of the mesh are P unknowns + g, P = E S. One
matrix S contains supports, point constraints and inactive functions.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.places import Places, share_places
from tawami.base.rows import Rows
from tawami.field.constraints import Held, PointHeld
from tawami.field.elimination import eliminated, prescribed_by
from tawami.field.layout import Layout
from tawami.field.rigid import check_rigid_motions
from tawami.field.unknowns import Unknowns

#: Difference of prescribed values that counts as round-off, relative to the largest value.
ROUND_OFF = 1e-9


class Reduction(Unknowns):
    """Unknowns that the supports leave free. Making one is a collective call.

    Args:
        layout: Places of the coefficients.
        held: Prescribed coefficients, the same on every rank.
        points: Multi-point constraints, the same on every rank.
        start: Coefficients at the beginning. Values are prescribed for the sum of these and the
            increments; unknowns are increments.
        moving: Whether rigid motions may be free, because inertia holds the body.
        also: Constraints of supports that are no constraints here, but prevent rigid motions.

    Attributes:
        offset: Increments of the coefficients if all unknowns are zero.
        fixed: Whether each coefficient is prescribed by itself, along an edge.
        number_of: Number of the unknown that gives the value of each coefficient; -1 if none gives it by
            itself.
        points: The multi-point constraints.

    Raises:
        SupportError: Supports contradict each other, or leave a rigid motion free.
    """

    #: Elimination by point constraints: dependent coefficients of the whole grid, the others involved,
    #: and their weights.
    _eliminated: tuple[Indices, Indices, Array] | None = None
    #: A matrix, which of its entries couple unknowns, and their places there.
    _reduced: tuple[sp.csr_matrix, Mask, Places] | None = None

    def __init__(
        self,
        layout: Layout,
        held: Sequence[Held],
        points: Sequence[PointHeld],
        start: Array,
        *,
        moving: bool = False,
        also: Sequence[PointHeld] = (),
    ) -> None:
        self.points = points
        sizes = [float(np.abs(support.values).max(initial=0.0)) for support in held]
        sizes += [abs(point.value) for point in points]
        tolerance = ROUND_OFF * max(sizes, default=0.0)
        prescribed, values = prescribed_by(held, tolerance)
        place = layout.places(prescribed)
        inside = place >= 0
        self.fixed, total = np.zeros(layout.size, dtype=bool), np.zeros(layout.size)
        self.fixed[place[inside]], total[place[inside]] = True, values[inside]
        if not moving:
            check_rigid_motions(layout, self.fixed, [*points, *also])
        self.offset = np.where(self.fixed, total - start, 0.0)
        free = layout.active & ~self.fixed
        if points:
            involved = np.unique(np.concatenate([point.indices for point in points]))
            known = np.isin(involved, prescribed)
            total_there = np.zeros(len(involved))
            total_there[known] = values[np.searchsorted(prescribed, involved[known])]
            of_points = (involved, known, total_there, layout.at(start, involved))
            dependent, others, weights, increments = eliminated(points, *of_points, tolerance, held)
            self._eliminated = (dependent, others, weights)
            here = layout.places(dependent)
            free[here[here >= 0]] = False
            self.offset[here[here >= 0]] = increments[here >= 0]
        self._begin(layout, free)
        followers, leaders = self._tied
        self.offset[followers] = self.offset[leaders]

    @property
    def _tied(self) -> Indices:
        """Coefficients that follow others, and those that they follow."""
        tied = self.layout.tied
        return np.asarray(tied[~self.fixed[tied[:, 0]]].T)

    def _begin(self, layout: Layout, free: Mask, *, tied: bool = True) -> None:
        """Number the free coefficients, rank by rank.

        Args:
            layout: Places of the coefficients.
            free: Whether each coefficient is an unknown.
            tied: Whether tied coefficients follow others.
        """
        self.layout, comm = layout, layout.grid.comm
        unknowns = np.flatnonzero(free & layout.own)
        counts = np.array(comm.allgather(len(unknowns)))
        start = int(counts[: comm.rank].sum())
        own, size = slice(start, start + len(unknowns)), int(counts.sum())
        self.number_of = np.full(layout.size, -1)
        self.number_of[unknowns] = np.arange(own.start, own.stop)
        layout.exchange.update(self.number_of)
        others = np.flatnonzero((self.number_of >= 0) & ~layout.own)
        others = others[np.argsort(self.number_of[others])]
        place = np.concatenate([unknowns, others])
        number = self.number_of[place]
        if tied:
            followers, leaders = self._tied
            self.number_of[followers] = self.number_of[leaders]
        if self._eliminated is not None:
            dependent, involved, weights = self._eliminated
            #: Numbers of the involved coefficients.
            self._involved = layout.at(self.number_of + 1.0, involved).astype(np.int64) - 1
            if (layout.places(dependent) >= 0).any():
                far = np.setdiff1d(self._involved[(weights != 0).any(axis=0)], [*number, -1])
                number = np.concatenate([number, far])
                place = np.concatenate([place, np.full(len(far), -1)])
        self._set(layout, number, place, own, size)

    @functools.cached_property
    def of_displacement(self) -> Mask:
        """Whether each unknown of this rank belongs to the displacement."""
        return np.asarray(self.coefficients < self.layout.num_displacement)

    def of_field(self, name: str) -> Mask:
        """Whether each unknown of this rank belongs to a field."""
        return np.asarray(self.layout.fields[name].holds(self.coefficients))

    def columns(self, number: Indices) -> Indices:
        """Places of unknowns with these numbers among those that this rank knows; -1 for others."""
        if self.size == self.num_own:
            return number
        order = self._order
        if not len(order):
            return np.full(len(number), -1)
        at = np.minimum(np.searchsorted(self.number, number, sorter=order), len(order) - 1)
        found = order[at]
        return np.where((number >= 0) & (self.number[found] == number), found, -1)

    @functools.cached_property
    def _order(self) -> Indices:
        return np.argsort(self.number)

    @functools.cached_property
    def _column_of(self) -> Indices:
        """Known unknown that gives the value of each coefficient; -1 if none gives it by itself."""
        return self.columns(self.number_of)

    @functools.cached_property
    def _places(self) -> tuple[Indices, Indices] | None:
        """Row and column of each entry of S, if all entries are 1 and each row has one at most.

        This is so without point constraints. Products with S then need no sparse matrix.
        """
        if self._eliminated is not None:
            return None
        rows = np.flatnonzero(self._column_of >= 0)
        return rows, self._column_of[rows]

    @functools.cached_property
    def is_plain(self) -> bool:
        """Whether each unknown is one coefficient, on all ranks."""
        if self._eliminated is not None:
            return False
        tied = np.array([bool(self._tied.size)])
        return not ranks.any_of(self._comm, tied)[0]

    @functools.cached_property
    def selection(self) -> sp.csr_matrix:
        """S, coefficients x known unknowns."""
        shape = (self.layout.size, len(self.number))
        if self._places is not None:
            rows, columns = self._places
            start = np.zeros(shape[0] + 1, dtype=np.int32)
            np.cumsum(self._column_of >= 0, out=start[1:])
            entries = (np.ones(len(rows)), columns.astype(np.int32), start)
            return sp.csr_matrix(entries, shape=shape)
        assert self._eliminated is not None
        dependent, _, weights = self._eliminated
        here = self.layout.places(dependent)
        row, column = np.nonzero(weights * (here >= 0)[:, None])
        number = self.number_of.copy()
        followers, leaders = self._tied
        number[followers] = -1
        rows = np.flatnonzero(number >= 0)
        entries = np.concatenate([np.ones(len(rows)), -weights[row, column]])
        columns = np.concatenate([self.columns(number[rows]), self.columns(self._involved[column])])
        rows = np.concatenate([rows, here[row]])
        selection = sp.csr_matrix((entries, (rows, columns)), shape=shape)
        if not len(followers):
            return selection
        shape = (self.layout.size, self.layout.size)
        swap = sp.csr_matrix((np.ones(len(followers)), (followers, leaders)), shape=shape)
        return sp.csr_matrix(selection + swap @ selection)

    def of_constraints(self, gradients: Rows) -> Rows:
        """See `Unknowns.of_constraints`."""
        if self._comm.size > 1 or self._places is None:
            return super().of_constraints(gradients)
        column = self._column_of[gradients.column]
        known = column >= 0
        shape = (gradients.shape[0], self.size)
        return Rows.of(gradients.row[known], column[known], gradients.values[known], shape)

    @classmethod
    def of_all(cls, layout: Layout) -> Reduction:
        """The reduction whose unknowns are all coefficients, on one rank inactive ones too."""
        reduction = cls.__new__(cls)
        reduction.points = []
        reduction.fixed = np.zeros(layout.size, dtype=bool)
        # tied coefficients are unknowns as well
        reduction._begin(layout, layout.own | (layout.owner >= 0), tied=False)
        reduction.offset = np.zeros(layout.size)
        return reduction

    def expanded(self, own: Array) -> Array:
        """S x: all coefficients, from the unknowns of this rank; a collective call."""
        unknowns = self.known(own)
        if self._places is None:
            return np.asarray(self.selection @ unknowns)
        rows, columns = self._places
        coefficients = np.zeros(self.layout.size)
        coefficients[rows] = unknowns[columns]
        return coefficients

    def restricted(self, forces: Array) -> Array:
        """S^T f: forces on the unknowns of this rank, from those on all coefficients.

        A collective call.
        """
        if self.is_plain:
            return np.asarray(forces[self.coefficients])
        mine = forces if self._comm.size == 1 else np.where(self.layout.own, forces, 0.0)
        if self._places is None:
            known = np.asarray(self._transposed @ mine)
        else:
            rows, columns = self._places
            known = np.bincount(columns, mine[rows], len(self.number)).astype(float)
        return np.asarray(self.exchange.add(known)[: self.num_own])

    def reduced(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """S^T A S in the unknowns that this rank knows, A on the coefficients of the window.

        Without point constraints its entries are in places that depend on those of A only, zeros too.
        """
        if self._places is None:
            return super().reduced(matrix)
        if self._reduced is None or not share_places(self._reduced[0], matrix):
            entries = matrix.tocoo()
            row, column = self._column_of[entries.row], self._column_of[entries.col]
            mine = (row >= 0) & (column >= 0)
            places = Places(row[mine], column[mine], (len(self.number),) * 2)
            self._reduced = matrix, mine, places
        _, mine, of_rows = self._reduced
        return of_rows.matrix(matrix.data[mine])

    def diagonal(self, masses: Array) -> Array | None:
        """This rank's diagonal of S^T M S, M the diagonal matrix of masses of all coefficients.

        None if point constraints make it another matrix.
        """
        return None if self._places is None else self.restricted(masses)

    @property
    def digest(self) -> str:
        """A hash of the unknowns and S, on this rank."""
        s = self.selection
        parts = (self.coefficients, s.indptr, s.indices, s.data)
        return hashlib.sha1(b"".join(np.ascontiguousarray(a).tobytes() for a in parts)).hexdigest()

    def same_unknowns(self, other: Reduction | None) -> bool:
        """Whether another reduction has the same unknowns and S, so that matrices are alike.

        A collective call.
        """
        differs = np.array([not self._same_here(other)])
        return not ranks.any_of(self._comm, differs)[0]

    def _same_here(self, other: Reduction | None) -> bool:
        """The same on this rank."""
        if other is None or other.size != self.size or not self.layout.same_cells(other.layout):
            return False
        if self._places is not None and other._places is not None:
            return np.array_equal(self.number_of, other.number_of)
        mine, others = self.selection, other.selection
        return (
            np.array_equal(self.number, other.number)
            and np.array_equal(mine.indptr, others.indptr)
            and np.array_equal(mine.indices, others.indices)
            and np.array_equal(mine.data, others.data)
        )
