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
from scipy.sparse.linalg import spsolve

from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import SupportError
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

    Attributes:
        size: Number of unknowns.
        unknowns: Coefficient of each unknown, sorted by the rank that owns it.
        own: Unknowns whose rows belong to this rank.
        selection: S, coefficients x unknowns.
        offset: Increments of the coefficients if all unknowns are zero.
        fixed: Whether each coefficient is prescribed by itself, along an edge.
        points: The multi-point constraints.

    Raises:
        SupportError: Supports contradict each other, or leave a rigid motion free.
    """

    def __init__(
        self,
        layout: Layout,
        held: Sequence[Held],
        points: Sequence[PointHeld],
        start: Array,
        *,
        moving: bool = False,
    ) -> None:
        self.layout, self.points = layout, points
        sizes = [float(np.abs(support.values).max(initial=0.0)) for support in held]
        sizes += [abs(point.value) for point in points]
        tolerance = ROUND_OFF * max(sizes, default=0.0)
        self.fixed, total = _prescribed(held, layout.size, tolerance)
        if not moving:
            check_rigid_motions(layout, self.fixed, points)
        dependent, involved, weights, values = _eliminate(
            points, self.fixed, total, start, tolerance, held
        )
        free = layout.active & ~self.fixed
        free[dependent] = False
        self._number(free)
        number = np.full(layout.size, -1)
        number[self.unknowns] = np.arange(self.size)
        row, column = np.nonzero(weights)
        entries = np.concatenate([np.ones(self.size), -weights[row, column]])
        rows = np.concatenate([self.unknowns, dependent[row]])
        columns = np.concatenate([np.arange(self.size), number[involved[column]]])
        shape = (layout.size, self.size)
        self.selection = sp.csr_matrix((entries, (rows, columns)), shape=shape)
        self.offset = np.where(self.fixed, total - start, 0.0)
        self.offset[dependent] = values
        self._tie()

    def _tie(self) -> None:
        """Let the tied coefficients of the layout follow others."""
        tied = self.layout.tied
        followers, leaders = tied[~self.fixed[tied[:, 0]]].T
        if len(followers):
            shape = (self.layout.size, self.layout.size)
            swap = sp.csr_matrix((np.ones(len(followers)), (followers, leaders)), shape=shape)
            self.selection = sp.csr_matrix(self.selection + swap @ self.selection)
            self.offset[followers] = self.offset[leaders]

    @classmethod
    def of_all(cls, layout: Layout) -> Reduction:
        """The reduction whose unknowns are all coefficients, inactive ones too."""
        reduction = cls.__new__(cls)
        reduction.layout, reduction.points = layout, []
        reduction.fixed = np.zeros(layout.size, dtype=bool)
        reduction._number(np.ones(layout.size, dtype=bool))
        entries = (np.ones(layout.size), (reduction.unknowns, np.arange(layout.size)))
        reduction.selection = sp.csr_matrix(entries, shape=(layout.size, layout.size))
        reduction.offset = np.zeros(layout.size)
        return reduction

    def restricted(self, forces: Array) -> Array:
        """S^T f: forces on the unknowns, from those on all coefficients."""
        return np.asarray(self._transposed @ forces)

    @functools.cached_property
    def _transposed(self) -> sp.csc_matrix:
        return self.selection.T

    @functools.cached_property
    def _displacement(self) -> tuple[sp.csr_matrix, Indices]:
        """The part of S for the displacement, and the coefficients of its unknowns."""
        n = self.layout.num_displacement
        free = self.unknowns < n
        return self.selection[:n][:, free], self.unknowns[free]

    def imposed(self, values: Array, mass: Array, offset: Array) -> Array:
        """Velocities after an impulse of the supports.

        This is the field nearest to `values`, in the norm of the lumped mass, that obeys the supports.

        Args:
            values: Velocities, or other rates, of all displacement coefficients.
            mass: Mass of each [kg per metre depth].
            offset: As `offset`, for the rate.
        """
        (s, unknowns), g = self._displacement, offset[: len(values)]
        if not self.points and not len(self.layout.tied):
            return np.asarray(s @ (values - g)[unknowns] + g)
        weighted = s.T @ sp.diags(mass)
        return np.asarray(s @ spsolve((weighted @ s).tocsc(), weighted @ (values - g)) + g)

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
        if other is None or other.layout is not self.layout or other.size != self.size:
            return False
        mine, others = self.selection, other.selection
        return (
            np.array_equal(self.unknowns, other.unknowns)
            and np.array_equal(mine.indptr, others.indptr)
            and np.array_equal(mine.indices, others.indices)
            and np.array_equal(mine.data, others.data)
        )


def _prescribed(held: Sequence[Held], size: int, tolerance: float) -> tuple[Mask, Array]:
    """Which coefficients are prescribed, and their values."""
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
