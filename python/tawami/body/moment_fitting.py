"""Fewer points with positive weights and the same moments (Tchakaloff's theorem).

The weights are found by non-negative least squares (Piazzon, Sommariva and Vianello 2017).
"""

from __future__ import annotations

from contextlib import suppress
from functools import reduce
from itertools import product

import numpy as np

from tawami.base.arrays import Array, Mask
from tawami.base.space import PLANE
from tawami.body.points import DEGREE

#: Exponents of the monomials up to the degree of the rule, monomials x axes.
EXPONENTS = np.array([e for e in product(range(DEGREE + 1), repeat=PLANE.dim) if sum(e) <= DEGREE])
#: Largest number of points that is left: the number of moments.
MOST = len(EXPONENTS)
#: Number of points beyond which the remaining points are first searched among SOME of them.
MANY, SOME = 300, 100
#: Largest error of the moments, relative to the area.
MOMENT_ERROR = 1e-12


def fewer(x: Array, weight: Array, allowed: Mask) -> tuple[Array, Array]:
    """At most MOST of the points of a cell, with positive weights and the same moments.

    Args:
        x: Positions of the points, n x 2.
        weight: Their weights, some of which may be negative.
        allowed: Mask of the points that may be chosen.
    """
    allowed = allowed & (weight > 0)
    if allowed.all() and len(x) <= MOST:
        return x, weight
    if allowed.all() and len(x) > MANY:
        return _of_some(x, weight)
    area = weight.sum()
    allowed = allowed if allowed.any() else weight > 0
    monomials = _monomials(x)
    # Functions that are orthonormal over the points: a sliver is as well conditioned as a square.
    root = np.sqrt(weight[allowed])
    q, r = np.linalg.qr(root[:, None] * monomials[allowed])
    moments = q.T @ root
    if not allowed.all():
        others = monomials[~allowed].T @ weight[~allowed]
        moments = moments + np.linalg.lstsq(r.T, others, rcond=None)[0]
    size = np.linalg.norm(moments)
    found, error = _fitted((q / root[:, None]).T, moments, weight[allowed])
    if error > MOMENT_ERROR * size and allowed.all():
        return x, weight
    chosen = found > 0
    found = found[chosen]
    return x[allowed][chosen], found * (area / found.sum())


def _of_some(x: Array, weight: Array) -> tuple[Array, Array]:
    """As :func:`fewer`, for many points: the remaining points are first searched among some of them.

    The points of a rule on many triangles are many more than their moments need.
    """
    area, (along_x, along_y) = weight.sum(), _powers(x)
    i, j = EXPONENTS.T
    sums = ((weight * along_x) @ along_y.T)[i, j]
    so_far = np.cumsum(weight)
    for number in (SOME, 4 * SOME, len(x)):
        # points at equal shares of the area lie all over the cell
        shares = (np.arange(number) + 0.5) / number * so_far[-1]
        some = np.unique(np.searchsorted(so_far, shares)) if number < len(x) else np.arange(len(x))
        if len(some) < MOST:  # few of them have most of the area
            continue
        root = np.sqrt(weight[some])
        q, r = np.linalg.qr((root * along_x[:, some][i] * along_y[:, some][j]).T)
        moments = np.linalg.solve(r.T, sums)
        fitted = _fitted if number == len(x) else _least_squares
        found, error = fitted((q / root[:, None]).T, moments, weight[some])
        if error <= MOMENT_ERROR * np.linalg.norm(moments):
            chosen = found > 0
            return x[some][chosen], found[chosen] * (area / found.sum())
    return x, weight


def _monomials(x: Array) -> Array:
    """Monomials at points whose bounding box is scaled to [-1, 1], points x MOST."""
    powers = _scaled(x.T).T[:, :, None] ** np.arange(DEGREE + 1)
    factors = (powers[:, axis, e] for axis, e in enumerate(EXPONENTS.T))
    return np.ascontiguousarray(reduce(np.multiply, factors))


def _powers(x: Array) -> Array:
    """Powers up to the degree of each scaled coordinate, axes x (DEGREE + 1) x points."""
    t = _scaled(np.ascontiguousarray(x.T))
    powers = np.ones((len(t), DEGREE + 1, len(x)))
    for e in range(DEGREE):
        np.multiply(powers[:, e], t, out=powers[:, e + 1])
    return powers


def _scaled(x: Array) -> Array:
    """Points, axes x points, whose bounding box is scaled to [-1, 1]."""
    low, high = x.min(axis=1, keepdims=True), x.max(axis=1, keepdims=True)
    return np.asarray((2 * x - low - high) / np.maximum(high - low, np.finfo(float).tiny))


def _least_squares(functions: Array, moments: Array, weight: Array) -> tuple[Array, float]:
    """Non-negative weights next to these moments, and their error; `weight` if SciPy finds none."""
    from scipy.optimize import nnls  # imported here: a scene without cut cells does not need it

    with suppress(RuntimeError):  # too many iterations
        found = nnls(functions, moments)[0]
        return found, float(np.linalg.norm(functions @ found - moments))
    return weight, np.inf


def _fitted(functions: Array, moments: Array, weight: Array) -> tuple[Array, float]:
    """The same, where an error of SciPy shows."""
    found, error = _least_squares(functions, moments, weight)
    if error > 0.1 * MOMENT_ERROR * np.linalg.norm(moments):  # SciPy 1.12 to 1.15 may stop early
        again = _active_set(functions, moments)
        error_again = float(np.linalg.norm(functions @ again - moments))
        if error_again < error:
            return again, error_again
    return found, error


def _active_set(functions: Array, moments: Array) -> Array:
    """The same by the active-set method of Lawson and Hanson (1974), to a smaller residual."""
    n = functions.shape[1]
    found, free = np.zeros(n), np.zeros(n, dtype=bool)
    for _ in range(3 * n):
        residual = moments - functions @ found
        gain = np.where(free, -np.inf, functions.T @ residual)
        enough = np.linalg.norm(residual) <= 0.01 * MOMENT_ERROR * np.linalg.norm(moments)
        if enough or gain.max() <= 0 or free.sum() == len(moments):
            break
        free[gain.argmax()] = True
        while free.any():
            trial = np.zeros(n)
            trial[free] = np.linalg.lstsq(functions[:, free], moments, rcond=None)[0]
            negative = free & (trial <= 0)
            if not negative.any():
                found = trial
                break
            step = (found[negative] / (found[negative] - trial[negative])).min()
            found = np.where(free, found + step * (trial - found), 0.0)
            free &= found > 1e-15 * found.max(initial=0.0)
    return found
