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


def _monomials(x: Array) -> Array:
    """Monomials at points whose bounding box is scaled to [-1, 1], points x MOST."""
    low, high = x.min(axis=0), x.max(axis=0)
    t = (2 * x - low - high) / np.maximum(high - low, np.finfo(float).tiny)
    powers = t[:, :, None] ** np.arange(DEGREE + 1)
    factors = (powers[:, axis, e] for axis, e in enumerate(EXPONENTS.T))
    return np.ascontiguousarray(reduce(np.multiply, factors))


def _fitted(functions: Array, moments: Array, weight: Array) -> tuple[Array, float]:
    """Non-negative weights with these moments, and their error; `weight` if none are found."""
    from scipy.optimize import nnls  # imported here: a scene without cut cells does not need it

    found, error = weight, np.inf
    with suppress(RuntimeError):  # too many iterations
        found = nnls(functions, moments)[0]
        error = float(np.linalg.norm(functions @ found - moments))
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
