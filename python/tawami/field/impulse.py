"""Velocities after an impulse of the supports."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.field.reduction import Reduction


def imposed(reduction: Reduction, values: Array, mass: Array, offset: Array) -> Array:
    """The field nearest to `values`, in the norm of the lumped mass, that obeys the supports.

    A collective call.

    Args:
        reduction: The supports.
        values: Velocities, or other rates, of all displacement coefficients.
        mass: Mass of each [kg per metre depth].
        offset: As `Reduction.offset`, for the rate.
    """
    n, g = len(values), offset[: len(values)]
    if reduction.is_plain:
        found = g.copy()
        mine = np.flatnonzero(reduction.number_of[:n] >= 0)
        found[mine] += (values - g)[mine]
        return np.asarray(found)
    size = reduction.layout.size
    momentum = reduction.restricted(np.pad(mass * (values - g), (0, size - n)))
    masses = reduction.diagonal(np.pad(mass, (0, size - n)))
    if masses is None:
        rates = _with_points(reduction, momentum, mass)
    else:  # tied coefficients share the momentum of all
        rates = np.divide(momentum, masses, out=momentum, where=masses > 0)
    return np.asarray(reduction.expanded(rates)[:n] + g)


def _with_points(reduction: Reduction, momentum: Array, mass: Array) -> Array:
    """x of S^T M S x = momentum, for the unknowns of this rank.

    S^T M S = D + R^T m R, where D is the diagonal of the coefficients that are unknowns by themselves,
    and R are the rows of S of the others.
    """
    layout, n, own = reduction.layout, len(mass), reduction.own
    comm, number_of = layout.grid.comm, reduction.number_of[: len(mass)]
    plain = layout.own[:n] & (number_of >= 0)
    known = np.zeros(len(reduction.number))
    np.add.at(known, reduction.columns(number_of[plain]), mass[plain])
    diagonal = reduction.exchange.add(known)[: reduction.num_own]
    count = np.diff(reduction.selection.indptr)[:n]
    others = np.flatnonzero(layout.own[:n] & ~plain & (count > 0))
    rows = reduction.selection[others].tocoo()
    start = sum(comm.allgather(len(others))[: comm.rank])
    row, number, weight = (
        ranks.allgathered(comm, part)
        for part in (start + rows.row.astype(np.int64), reduction.number[rows.col], rows.data)
    )
    masses = ranks.allgathered(comm, mass[others])
    some, column = np.unique(number, return_inverse=True)
    r = sp.csr_matrix((weight, (row, column)), shape=(len(masses), len(some))).toarray()
    here = (some >= own.start) & (some < own.stop)
    at = some[here] - own.start
    of_some = np.zeros((len(some), 2))
    of_some[here] = np.column_stack([diagonal[at], momentum[at]])
    d, b = ranks.sum_of(comm, of_some).T
    found = np.divide(momentum, diagonal, out=np.zeros_like(momentum), where=diagonal > 0)
    found[at] = np.linalg.solve(np.diag(d) + (r.T * masses) @ r, b)[here]
    return found
