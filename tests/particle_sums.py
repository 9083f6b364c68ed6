"""The tangent of linear elasticity as a sum over particles, which shares no code with the package."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline

import tawami

UNIT = np.array([1.0, 1.0, 1.0, 0.0])
#: Work-conjugate metric: the fourth strain is gamma = 2 eps_xy.
ISOTROPIC = np.diag([2.0, 2.0, 2.0, 1.0])
DEV = np.eye(4) - np.outer(UNIT, UNIT) / 3


#: mu, K of E = 2, nu = 0.3 and of E = 7, nu = 0.49.
TWO_MATERIALS = ((2 / 2.6, 2 / 1.2), (7 / 2.98, 7 / 0.06))


@functools.cache
def functions_1d(basis: str, n: int, s: float, cell: int) -> np.ndarray:
    """Values, first and second derivatives (3 x functions) at s, in cells; `cell` picks the side."""
    if basis == "quadratic_spline":
        knots = np.array([0, 0, *range(n + 1), n, n], dtype=float)
        return np.array([
            [BSpline(knots, np.eye(n + 2)[i], 2).derivative(d)(s) if d < 2 else
             BSpline(knots, np.eye(n + 2)[i], 2).derivative(2)(cell + 0.5) for i in range(n + 2)]
            for d in range(3)
        ])  # fmt: skip
    degree = 1 if basis == "bilinear" else 2
    nodes = np.linspace(0, 1, degree + 1)
    out = np.zeros((3, degree * n + 1))
    for a in range(degree + 1):
        others = np.delete(nodes, a)
        polynomial = np.poly1d(others, r=True) / np.prod(nodes[a] - others)
        for d in range(3):
            out[d, degree * cell + a] = (polynomial.deriv(d) if d else polynomial)(s - cell)
    return out


def cells_of(s: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Cell of each particle: the upper one at an edge, but not if only its border holds any."""
    cell = np.minimum(np.floor(s + 1e-12), cells - 1)
    for axis in range(2):
        for c in np.unique(cell, axis=0):
            mine = (cell == c).all(axis=1)
            if c[axis] > 0 and (s[mine, axis] - c[axis] < 1e-9).all():
                cell[mine, axis] -= 1
    return cell


class Sum:
    """The bilinear form of elasticity, particle by particle.

    Args:
        scene: Gives positions, volumes and numbers of the materials, the grid and the basis.
        options: Those of its form.
        moduli: mu and K of each material [Pa].
    """

    def __init__(
        self,
        scene: tawami.Scene,
        options: dict[str, object],
        moduli: Sequence[tuple[float, float]] = TWO_MATERIALS,
    ) -> None:
        self.scene, self.options, self.moduli = scene, options, moduli
        grid, self.h = scene.grid, scene.grid.h
        self.cells = cells_of((scene.particles.x - grid.origin) / grid.h, np.array(grid.cells))

    def at(self, basis: str, s: np.ndarray, cell: np.ndarray) -> list[list[np.ndarray]]:
        """Table [dx][dy] of the derivatives (per metre) of all products, x fastest."""
        fx, fy = (
            functions_1d(basis, self.scene.grid.cells[a], s[a], int(cell[a])) for a in range(2)
        )
        return [
            [np.outer(fy[b], fx[a]).ravel() / self.h ** (a + b) for b in range(3)] for a in range(3)
        ]

    def matrix(self) -> np.ndarray:
        """Tangent at zero: derivatives of the weak form, without supports."""
        form, alpha = self.options["form"], float(self.options.get("alpha", 0.0))
        grid, particles = self.scene.grid, self.scene.particles
        total = None
        mean_ratio = {}
        for p, cell in enumerate(self.cells):
            mu, bulk = self.moduli[particles.material[p]]
            entry = mean_ratio.setdefault(tuple(cell), [0.0, 0.0])
            entry[0] += particles.volume[p]
            entry[1] += particles.volume[p] * bulk**2 / mu
        for p, cell in enumerate(self.cells):
            mu, bulk = self.moduli[particles.material[p]]
            s = (particles.x[p] - grid.origin) / self.h
            n = self.at(self.scene.basis, s, cell)
            centre = self.at(self.scene.basis, cell + 0.5, cell)
            m = self.at("bilinear", s, cell)
            size_u, size_v = 2 * len(n[0][0]), len(m[0][0])
            strain = np.zeros((4, size_u))
            strain[0, 0::2], strain[1, 1::2] = n[1][0], n[0][1]
            strain[3, 0::2], strain[3, 1::2] = n[0][1], n[1][0]
            div = UNIT @ strain
            div_centre = np.zeros(size_u)
            div_centre[0::2], div_centre[1::2] = centre[1][0], centre[0][1]
            deviatoric = mu * (DEV @ strain).T @ ISOTROPIC @ (DEV @ strain)
            if total is None:
                total = np.zeros(
                    (size_u + size_v,) * 2 if form in ("u_epsv", "u_p") else (size_u,) * 2
                )
            volume = particles.volume[p]
            uu = deviatoric.copy()
            if form == "u":
                uu += bulk * np.outer(div, div)
            if form == "u_bbar":
                uu += bulk * np.outer(div_centre, div_centre)
            total[:size_u, :size_u] += volume * uu
            if form not in ("u_epsv", "u_p"):
                continue
            weight, mass = (bulk, bulk) if form == "u_epsv" else (1.0, 1 / bulk)
            value, gradient = m[0][0], np.array([m[1][0], m[0][1]])
            total[:size_u, size_u:] += volume * weight * np.outer(div, value)
            total[size_u:, :size_u] += volume * weight * np.outer(value, div)
            total[size_u:, size_u:] -= volume * mass * np.outer(value, value)
            factor = bulk**2 / mu if form == "u_epsv" else 1 / mu
            kind = self.options.get("stabilisation", "laplacian")
            if kind != "projection":
                total[size_u:, size_u:] -= (
                    volume * alpha * self.h**2 * factor * gradient.T @ gradient
                )
            if kind == "residual_based":
                div_s = np.zeros((2, size_u))  # div(2 dev sym grad u), in the plane
                div_s[0, 0::2] = 2 * n[2][0] + n[0][2] - 2 / 3 * n[2][0]
                div_s[0, 1::2] = n[1][1] - 2 / 3 * n[1][1]
                div_s[1, 1::2] = 2 * n[0][2] + n[2][0] - 2 / 3 * n[0][2]
                div_s[1, 0::2] = n[1][1] - 2 / 3 * n[1][1]
                total[size_u:, :size_u] -= volume * bulk * alpha * self.h**2 * gradient.T @ div_s
        if self.options.get("stabilisation") == "projection":
            points, weights = np.polynomial.legendre.leggauss(3)
            for cell, (volume, ratio) in mean_ratio.items():
                middle = self.at("bilinear", np.array(cell) + 0.5, np.array(cell))[0][0]
                for a, wa in zip(points, weights, strict=True):
                    for b, wb in zip(points, weights, strict=True):
                        s = np.array(cell) + 0.5 + 0.5 * np.array([a, b])
                        part = self.at("bilinear", s, np.array(cell))[0][0] - middle
                        area = wa * wb / 4 * self.h**2
                        total[size_u:, size_u:] -= (
                            alpha * ratio / volume * area * np.outer(part, part)
                        )
        return total
