"""Prescribed coefficients, and the elimination of coefficients by point constraints.

Supports are the same on every rank, and coefficients are those of the whole grid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import SupportError
from tawami.field.constraints import Held, PointHeld

#: Weight of a coefficient in a point constraint below which it does not determine the coefficient.
NO_PIVOT = 1e-10


def prescribed_by(held: Sequence[Held], tolerance: float) -> tuple[Indices, Array]:
    """The prescribed coefficients, and their values."""
    some = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *(h.indices for h in held)]))
    fixed, total, last = np.zeros(len(some), bool), np.zeros(len(some)), np.full(len(some), -1)
    for number, support in enumerate(held):
        at = np.searchsorted(some, support.indices)
        change = np.abs(total[at] - support.values) * fixed[at]
        worst = int(np.argmax(change)) if len(change) else 0
        if change.max(initial=0.0) > tolerance:
            other = held[last[at[worst]]]
            raise SupportError(
                f"{other.where} and {support.where} prescribe displacements that differ by "
                f"{change[worst]:.3g} m where they meet (an end of an edge?): expected supports that "
                "agree there; change or release one. Profiles are projected in L2, which may miss their "
                "values at an end by the error of the projection"
            )
        total[at], last[at], fixed[at] = support.values, number, True
    return some, total


def _meet(other: Held | PointHeld, point: PointHeld) -> bool:
    """Whether a support acts on coefficients of a point."""
    return bool(np.isin(other.indices, point.indices).any())


def eliminated(
    points: Sequence[PointHeld],
    coefficients: Indices,
    fixed: Mask,
    total: Array,
    start: Array,
    tolerance: float,
    held: Sequence[Held],
) -> tuple[Indices, Indices, Array, Array]:
    """Solve each multi-point constraint for the coefficient with the largest weight.

    Args:
        points: The constraints.
        coefficients: The coefficients in them, ascending.
        fixed, total, start: Whether each is prescribed by itself, its value then, and at the beginning.
        tolerance: Difference of values that is round-off.
        held: Other supports, for messages.

    Returns:
        The dependent coefficients, the others involved, and A, b with the increments
        `c[dependent] = b - A c[others]`.
    """
    involved = coefficients[~fixed]
    a = np.zeros((len(points), len(involved)))
    b = np.zeros(len(points))
    for k, point in enumerate(points):
        at = np.searchsorted(coefficients, point.indices)
        loose = ~fixed[at]
        a[k, np.searchsorted(involved, point.indices[loose])] = point.weights[loose]
        known = np.where(loose, start[at], total[at])
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
