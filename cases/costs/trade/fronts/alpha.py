"""The stabilisation alpha: constants, and values that differ from place to place.

inside      smaller in cells that are two cells or more away from the ends and sides
gradient    solves twice: smaller where the mean stress of the first solution is steep, at most the
            median slope over that of the place, where the error of the stabilisation is large
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

import tawami
from cases.costs.trade.fronts import volumes
from cases.costs.trade.fronts.measure import Row, compared
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import D, L

Array = npt.NDArray[np.float64]
ALPHA, SMALL = 0.01, 0.001
NUS = (0.3, 0.49, 0.4999)


def error(n: float, nu: float, alpha: str | float) -> float:
    """Error of the mean stress of the cantilever with the support `exact`."""
    h = D / n

    def solve(given: Any) -> tawami.Solution:
        scene = mpm.build("u_epsv", "exact", round(n), nu=nu, per_axis=3, alpha=given)
        return scene.solve()

    def inside(x: Array, y: Array) -> Array:
        inner = (x > 2 * h) & (x < L - 2 * h) & (np.abs(y) < D / 2 - 2 * h)
        return np.where(inner, SMALL, ALPHA)

    if alpha == "inside":
        return mpm.mean_stress_error(solve(inside), nu)
    if alpha == "gradient":
        return mpm.mean_stress_error(solve(by_gradient(solve(ALPHA))), nu)
    return mpm.mean_stress_error(solve(alpha), nu)


def by_gradient(solution: tawami.Solution) -> Array:
    """alpha of each particle, from the slope of the mean stress over the nearest particles."""
    near = cKDTree(solution.x).query(solution.x, k=9)[1]
    x, p = solution.x[near], solution.mean_stress[near]
    x, p = x - x.mean(axis=1, keepdims=True), p - p.mean(axis=1, keepdims=True)
    square, right = np.einsum("pni,pnj->pij", x, x), np.einsum("pni,pn->pi", x, p)
    slope = np.linalg.norm(np.linalg.solve(square, right[..., None])[..., 0], axis=1)
    return np.asarray(ALPHA * np.clip(np.median(slope) / slope, SMALL / ALPHA, 1.0))


def rows() -> list[Row]:
    """All comparisons: the mean stress of the cantilever and of the ring, the deflection of Cook's
    membrane.
    """
    constants = (ALPHA, 0.1, 0.03, 0.003, SMALL)
    found = []
    for nu in NUS:
        ways = {str(a): {"nu": nu, "alpha": a} for a in (*constants, "inside", "gradient")}
        found += compared(f"cantilever, nu = {nu:g}", ways, (8, 16, 32), error)
    ways = {str(a): {"alpha": a} for a in constants}
    found += compared("Cook", ways, (8, 16, 32), volumes.cook)
    return found + compared("ring", ways, (4, 8, 16), volumes.small_ring)
