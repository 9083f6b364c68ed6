"""Unknowns that the supports leave free: coefficients = S unknowns + offset.

With the extraction E of the layout, the degrees of freedom of the mesh are P unknowns + g, P = E S. One
matrix S contains supports, point constraints and inactive functions.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import SupportError
from tawami.base.places import Places, share_places
from tawami.field.constraints import Held, PointHeld
from tawami.field.layout import Layout
from tawami.field.rigid import check_rigid_motions

#: Difference of prescribed values that counts as round-off, relative to the largest value.
ROUND_OFF = 1e-9
#: Weight of a coefficient in a point constraint below which it does not determine the coefficient.
NO_PIVOT = 1e-10


class Reduction:
    """Unknowns that the supports leave free.

    Args:
        layout: Places of the coefficients.
        held: Prescribed coefficients.
        points: Multi-point constraints.
        start: Coefficients at the beginning. Values are prescribed for the sum of these and the
            increments; unknowns are increments.
        moving: Whether rigid motions may be free, because inertia holds the body.
        also: Constraints of supports that are no constraints here, but prevent rigid motions.

    Attributes:
        size: Number of unknowns.
        unknowns: Coefficient of each unknown, sorted by the rank that owns it.
        own: Unknowns whose rows belong to this rank.
        offset: Increments of the coefficients if all unknowns are zero.
        fixed: Whether each coefficient is prescribed by itself, along an edge.
        points: The multi-point constraints.

    Raises:
        SupportError: Supports contradict each other, or leave a rigid motion free.
    """

    #: Elimination by point constraints: dependent coefficients, the others involved, and their weights.
    _eliminated: tuple[Indices, Indices, Array] | None

    #: A matrix, which of its entries are in rows of this rank, and their places there.
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
        self.layout, self.points = layout, points
        sizes = [float(np.abs(support.values).max(initial=0.0)) for support in held]
        sizes += [abs(point.value) for point in points]
        tolerance = ROUND_OFF * max(sizes, default=0.0)
        self.fixed, total = _prescribed(held, layout.size, tolerance)
        if not moving:
            check_rigid_motions(layout, self.fixed, [*points, *also])
        self.offset = np.where(self.fixed, total - start, 0.0)
        free = layout.active & ~self.fixed
        self._eliminated = None
        if points:
            dependent, involved, weights, values = _eliminate(
                points, self.fixed, total, start, tolerance, held
            )
            self._eliminated = (dependent, involved, weights)
            free[dependent] = False
            self.offset[dependent] = values
        self._number(free)
        followers, leaders = self._tied
        self.offset[followers] = self.offset[leaders]

    @property
    def _tied(self) -> Indices:
        """Coefficients that follow others, and those that they follow."""
        tied = self.layout.tied
        return np.asarray(tied[~self.fixed[tied[:, 0]]].T)

    @functools.cached_property
    def of_displacement(self) -> Mask:
        """Whether each unknown belongs to the displacement."""
        return np.asarray(self.unknowns < self.layout.num_displacement)

    def reached_by(self, cells: Any) -> Mask:
        """Whether each coefficient belongs to a function with one of these cells in its support."""
        return self.layout.reached_by(cells)

    def of_field(self, name: str) -> Mask:
        """Whether each unknown belongs to a field."""
        return np.asarray(self.layout.fields[name].holds(self.unknowns))

    @functools.cached_property
    def _number_of(self) -> Indices:
        """Unknown that gives the value of each coefficient; -1 for those that none gives by itself."""
        number = np.full(self.layout.size, -1)
        number[self.unknowns] = np.arange(self.size)
        followers, leaders = self._tied
        number[followers] = number[leaders]
        return number

    @functools.cached_property
    def _places(self) -> tuple[Indices, Indices] | None:
        """Row and column of each entry of S, if all entries are 1 and each row has one at most.

        This is so without point constraints. Products with S then need no sparse matrix.
        """
        if self._eliminated is not None:
            return None
        rows = np.flatnonzero(self._number_of >= 0)
        return rows, self._number_of[rows]

    @functools.cached_property
    def selection(self) -> sp.csr_matrix:
        """S, coefficients x unknowns."""
        shape = (self.layout.size, self.size)
        if self._places is not None:
            rows, columns = self._places
            start = np.zeros(shape[0] + 1, dtype=np.int32)
            np.cumsum(self._number_of >= 0, out=start[1:])
            entries = (np.ones(len(rows)), columns.astype(np.int32), start)
            return sp.csr_matrix(entries, shape=shape)
        assert self._eliminated is not None
        dependent, involved, weights = self._eliminated
        number, (row, column) = np.full(self.layout.size, -1), np.nonzero(weights)
        number[self.unknowns] = np.arange(self.size)
        entries = np.concatenate([np.ones(self.size), -weights[row, column]])
        rows = np.concatenate([self.unknowns, dependent[row]])
        columns = np.concatenate([np.arange(self.size), number[involved[column]]])
        selection = sp.csr_matrix((entries, (rows, columns)), shape=shape)
        followers, leaders = self._tied
        if not len(followers):
            return selection
        shape = (self.layout.size, self.layout.size)
        swap = sp.csr_matrix((np.ones(len(followers)), (followers, leaders)), shape=shape)
        return sp.csr_matrix(selection + swap @ selection)

    @classmethod
    def of_all(cls, layout: Layout) -> Reduction:
        """The reduction whose unknowns are all coefficients, inactive ones too."""
        reduction = cls.__new__(cls)
        reduction.layout, reduction.points = layout, []
        reduction.fixed = np.zeros(layout.size, dtype=bool)
        reduction._eliminated = None
        reduction._number(np.ones(layout.size, dtype=bool))
        number = np.empty(layout.size, dtype=np.int64)
        number[reduction.unknowns] = np.arange(layout.size)
        reduction._number_of = number  # tied coefficients are unknowns as well
        reduction.offset = np.zeros(layout.size)
        return reduction

    def expanded(self, unknowns: Array) -> Array:
        """S x: all coefficients, from the unknowns."""
        if self._places is None:
            return np.asarray(self.selection @ unknowns)
        rows, columns = self._places
        coefficients = np.zeros(self.layout.size)
        coefficients[rows] = unknowns[columns]
        return coefficients

    def restricted(self, forces: Array) -> Array:
        """S^T f: forces on the unknowns, from those on all coefficients."""
        if self._places is None:
            return np.asarray(self._transposed @ forces)
        rows, columns = self._places
        if len(rows) == self.size:
            return np.asarray(forces[self.unknowns])
        return np.asarray(np.bincount(columns, forces[rows], self.size), dtype=float)

    def reduced(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """This rank's rows of S^T A S, A on all coefficients.

        Without point constraints its entries are in places that depend on those of A only, zeros too.
        """
        if self._places is None:
            return (self._transposed @ matrix @ self.selection).tocsr()[self.own]
        if self._reduced is None or not share_places(self._reduced[0], matrix):
            entries = matrix.tocoo()
            row, column = self._number_of[entries.row], self._number_of[entries.col]
            mine = (row >= self.own.start) & (row < self.own.stop) & (column >= 0)
            places = row[mine] - self.own.start, column[mine]
            self._reduced = matrix, mine, Places(*places, (self.num_own, self.size))
        _, mine, of_rows = self._reduced
        return of_rows.matrix(matrix.data[mine])

    def diagonal(self, masses: Array) -> Array | None:
        """The diagonal of S^T M S, M the diagonal matrix of masses of all coefficients.

        None if point constraints make it another matrix.
        """
        return None if self._places is None else self.restricted(masses)

    @functools.cached_property
    def _transposed(self) -> sp.csc_matrix:
        return self.selection.T

    def imposed(self, values: Array, mass: Array, offset: Array) -> Array:
        """Velocities after an impulse of the supports.

        This is the field nearest to `values`, in the norm of the lumped mass, that obeys the supports.

        Args:
            values: Velocities, or other rates, of all displacement coefficients.
            mass: Mass of each [kg per metre depth].
            offset: As `offset`, for the rate.
        """
        n, g = len(values), offset[: len(values)]
        if self._places is None:
            s = self.selection[:n][:, self.of_displacement]
            weighted = s.T @ sp.diags(mass)
            return np.asarray(s @ spsolve((weighted @ s).tocsc(), weighted @ (values - g)) + g)
        rows, columns = self._places
        rows, columns = rows[: np.searchsorted(rows, n)], columns[: np.searchsorted(rows, n)]
        rates = (values - g)[rows]
        if len(self._places[0]) > self.size:  # tied coefficients share the momentum of all
            momentum = np.bincount(columns, mass[rows] * rates, minlength=self.size)
            whole = np.bincount(columns, mass[rows], minlength=self.size)
            rates = np.divide(momentum, whole, out=momentum, where=whole > 0)[columns]
        imposed = g.copy()
        imposed[rows] += rates
        return np.asarray(imposed)

    def _number(self, free: Mask) -> None:
        """Number the free coefficients, rank by rank."""
        comm, unknowns = self.layout.grid.comm, np.flatnonzero(free)
        owner = self.layout.owner[unknowns]
        self.unknowns = unknowns[np.argsort(owner, kind="stable")]
        self.size = len(unknowns)
        ends = np.cumsum(np.bincount(owner, minlength=comm.size))
        self.own = slice(int(ends[comm.rank - 1]) if comm.rank else 0, int(ends[comm.rank]))

    @property
    def num_own(self) -> int:
        """Number of unknowns whose rows belong to this rank."""
        return self.own.stop - self.own.start

    @property
    def digest(self) -> str:
        """A hash of the unknowns and S."""
        s = self.selection
        parts = (self.unknowns, s.indptr, s.indices, s.data)
        return hashlib.sha1(b"".join(np.ascontiguousarray(a).tobytes() for a in parts)).hexdigest()

    def same_unknowns(self, other: Reduction | None) -> bool:
        """Whether another reduction has the same unknowns and S, so that matrices are alike."""
        if other is None or other.size != self.size or not self.layout.same_cells(other.layout):
            return False
        if self._places is not None and other._places is not None:
            return np.array_equal(self._number_of, other._number_of)
        mine, others = self.selection, other.selection
        return (
            np.array_equal(self.unknowns, other.unknowns)
            and np.array_equal(mine.indptr, others.indptr)
            and np.array_equal(mine.indices, others.indices)
            and np.array_equal(mine.data, others.data)
        )


def _prescribed(held: Sequence[Held], size: int, tolerance: float) -> tuple[Mask, Array]:
    """Mask of the prescribed coefficients, and their values."""
    fixed, total, last = np.zeros(size, dtype=bool), np.zeros(size), np.full(size, -1)
    for number, support in enumerate(held):
        change = np.abs(total[support.indices] - support.values) * fixed[support.indices]
        worst = int(np.argmax(change)) if len(change) else 0
        if change.max(initial=0.0) > tolerance:
            other = held[last[support.indices[worst]]]
            raise SupportError(
                f"{other.where} and {support.where} prescribe displacements that differ by "
                f"{change[worst]:.3g} m where they meet (an end of an edge?): expected supports that "
                "agree there; change or release one. Profiles are projected in L2, which may miss their "
                "values at an end by the error of the projection"
            )
        total[support.indices] = support.values
        last[support.indices] = number
        fixed[support.indices] = True
    return fixed, total


def _meet(other: Held | PointHeld, point: PointHeld) -> bool:
    """Whether a support acts on coefficients of a point."""
    return bool(np.isin(other.indices, point.indices).any())


def _eliminate(
    points: Sequence[PointHeld],
    fixed: Mask,
    total: Array,
    start: Array,
    tolerance: float,
    held: Sequence[Held],
) -> tuple[Indices, Indices, Array, Array]:
    """Solve each multi-point constraint for the coefficient with the largest weight.

    Returns:
        The dependent coefficients, the others involved, and A, b with the increments
        `c[dependent] = b - A c[others]`.
    """
    all_indices = [point.indices for point in points]
    involved = np.unique(np.concatenate([*all_indices, np.empty(0, dtype=np.int64)]))
    involved = involved[~fixed[involved]]
    a = np.zeros((len(points), len(involved)))
    b = np.zeros(len(points))
    for k, point in enumerate(points):
        loose = ~fixed[point.indices]
        a[k, np.searchsorted(involved, point.indices[loose])] = point.weights[loose]
        known = np.where(loose, start[point.indices], total[point.indices])
        b[k] = point.value - point.weights @ known
    pivots: dict[int, int] = {}
    for k, point in enumerate(points):
        pivot = int(np.argmax(np.abs(a[k]))) if len(involved) else -1
        if pivot < 0 or abs(a[k, pivot]) < NO_PIVOT:
            if abs(b[k]) > tolerance:
                given: list[Held | PointHeld] = [*held, *points[:k]]
                names = ", ".join(dict.fromkeys(one.where for one in given if _meet(one, point)))
                raise SupportError(
                    f"{point.where}: {names} already give this point a displacement that differs by "
                    f"{abs(b[k]):.3g} m: expected supports that agree; change or release one"
                )
            continue
        b[k] /= a[k, pivot]
        a[k] /= a[k, pivot]
        for other in set(range(len(points))) - {k}:
            b[other] -= a[other, pivot] * b[k]
            a[other] -= a[other, pivot] * a[k]
        pivots[k] = pivot
    rows, columns = list(pivots), list(pivots.values())
    others = np.setdiff1d(np.arange(len(involved)), columns)
    return involved[columns].astype(np.int64), involved[others], a[rows][:, others], b[rows]
