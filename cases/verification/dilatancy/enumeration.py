"""All active sets of the rate problem of a patch, with the total and with the elastic eps_v as field.

    2 x 2 cells of side h = 1, base held, 3 x 3 particles a cell; clamped quadratic splines for u,
    bilinear functions for eps_v. All 36 particles are at yield. 27 flow; nine, chosen at random, are
    candidates: they flow or unload. The directions of shear differ by up to 36 degrees in Mohr's plane.
    The loads on the functions of u are random.

Drucker-Prager, F = sqrt(J2) + A m - c B, with associated flow. At a particle at yield,
n = s / (2 sqrt(J2)) is the direction of its deviator s. The rates of deviator and mean stress and the
multiplier g are

    s = 2 mu (dev eps - g n),
    total:    m = K (eps_v - A g),  R_q = sum V K { q (div u - eps_v) - S }
    elastic:  m = K eps_v,          R_q = sum V K { q (div u - eps_v - A g) - S }
    g >= 0,  y = -(n : s + A m) >= 0,  g y = 0,

and R_u = sum V (s + m I) : grad w - load in both. u and eps_v are linear in g and the load. Without them
and the multipliers of the particles that flow, this is a linear complementarity problem for nine
multipliers:

    y = b + M g.

An active set is solved by g = -M^-1 b on the set. It is consistent if g > 0 there and y > 0 elsewhere.
The determinant of its tangent over that of the empty set is a principal minor of M, up to a positive
factor. There is exactly one consistent set for every b if and only if all principal minors are positive
(Samelson, Thrall and Wesler 1958). The program uses NumPy alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

CELLS, PER_AXIS, MU, ALPHA = 2, 3, 1.0, 0.01
SLOPE = (
    3 * np.tan(np.pi / 9) / np.sqrt(9 + 12 * np.tan(np.pi / 9) ** 2)
)  # A, phi = psi = 20 degrees
CANDIDATES, SPREAD = 9, np.pi / 5
NU, STATES = (0.3, 0.45, 0.49, 0.4999), 40
UNIT = np.array([1.0, 1.0, 1.0, 0.0])
DEVIATOR = np.diag([1.0, 1.0, 1.0, 0.5]) - np.outer(UNIT, UNIT) / 3
COLUMNS = ("form", "nu", "states", "none", "one", "more", "negative")


@dataclass
class Counts:
    """Consistent sets of random states.

    Attributes:
        form: Meaning of the field, total or elastic.
        nu: Poisson's ratio.
        states: Number of states.
        none, one, more: Numbers of states with no, one or more consistent sets.
        negative: Share of active sets whose determinant has another sign than that of the empty set.
    """

    form: str
    nu: float
    states: int = 0
    none: int = 0
    one: int = 0
    more: int = 0
    negative: float = 0.0


def splines(x: Array, degree: int) -> tuple[Array, Array]:
    """Values and derivatives of clamped B-splines on cells of side 1 (particles x functions)."""
    knots = np.concatenate([np.zeros(degree), np.arange(CELLS + 1.0), np.full(degree, 1.0 * CELLS)])
    values = np.array([(a <= x) & (x < b) for a, b in pairwise(knots)], float)
    slopes = np.zeros_like(values)
    for d in range(1, degree + 1):
        n = len(knots) - d - 1
        width = knots[d:] - knots[:-d]
        inverse = np.divide(1.0, width, out=np.zeros_like(width), where=width > 0)[:, None]
        left, right = inverse[:n] * values[:n], inverse[1 : n + 1] * values[1 : n + 1]
        slopes = d * (left - right)
        values = (x - knots[:n, None]) * left + (knots[d + 1 : d + 1 + n, None] - x) * right
    return values.T, slopes.T


def product(a: Array, b: Array) -> Array:
    """Products of functions of x and of y (particles x all pairs)."""
    return np.einsum("pi,pj->pij", a, b).reshape(len(a), -1)


class Patch:
    """The patch: strains of its particles as linear maps of the unknowns, and its elastic tangent."""

    def __init__(self, nu: float) -> None:
        self.K = 2 * MU * (1 + nu) / (3 * (1 - 2 * nu))
        line = (np.arange(CELLS * PER_AXIS) + 0.5) / PER_AXIS
        x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
        self.volume = 1 / PER_AXIS**2
        (a, da), (b, db) = splines(x, 2), splines(y, 2)
        free = np.tile(np.arange(CELLS + 2) > 0, CELLS + 2)  # without the base
        dx, dy = product(da, b)[:, free], product(a, db)[:, free]
        zero = np.zeros_like(dx)
        self.strain = np.stack(
            [np.hstack(rows) for rows in ((dx, zero), (zero, dy), (zero, zero), (dy, dx))], axis=1
        )
        (a, da), (b, db) = splines(x, 1), splines(y, 1)
        self.q = product(a, b)
        gradient = np.stack([product(da, b), product(a, db)])
        V, K = self.volume, self.K
        self.div = np.einsum("i,pij->pj", UNIT, self.strain)
        uu = np.einsum("pia,ij,pjb->ab", self.strain, 2 * MU * V * DEVIATOR, self.strain)
        uq = K * V * self.div.T @ self.q
        qq = -K * V * self.q.T @ self.q
        qq -= K * V * ALPHA * K / MU * np.einsum("apm,apn->mn", gradient, gradient)
        self.tangent = np.block([[uu, uq], [uq.T, qq]])

    def complementarity(self, form: str, n: Array, load: Array) -> tuple[Array, Array]:
        """M and b of all particles for their directions n (particles x 4) and the load on u."""
        V, K = self.volume, self.K
        shear = np.einsum("pi,pij->pj", 2 * MU * n, self.strain)  # n holds xy once
        slope = np.hstack([shear, SLOPE * K * self.q])
        if form == "total":
            flow = np.hstack([shear + SLOPE * K * self.div, 0 * self.q])
            hardening = MU + K * SLOPE**2
        else:
            flow, hardening = slope, MU
        right = np.vstack([V * flow, np.concatenate([load, np.zeros(self.q.shape[1])])])
        x = slope @ np.linalg.solve(self.tangent, right.T)
        return hardening * np.eye(len(n)) - x[:, :-1], -x[:, -1]


def enumerate_sets(M: Array, b: Array) -> tuple[int, float]:
    """Number of consistent active sets, and share of the sets with a negative determinant."""
    consistent, negative = 0, 0
    for number in range(2 ** len(b)):
        on = np.array([number >> i & 1 for i in range(len(b))], dtype=bool)
        g = np.zeros_like(b)
        if on.any():
            part = M[np.ix_(on, on)]
            negative += np.linalg.det(part) < 0
            g[on] = np.linalg.solve(part, -b[on])
        y = b + M @ g
        consistent += bool((g[on] > 0).all() and (y[~on] > 0).all())
    return consistent, negative / 2 ** len(b)


def state(seed: int, patch: Patch) -> tuple[Array, Array, Array]:
    """Directions n, a load on u, and which particles are candidates; the same for every form and nu."""
    rng = np.random.default_rng(seed)
    particles = len(patch.q)
    angle = rng.uniform(-SPREAD, SPREAD, particles)
    n = np.stack([np.cos(angle), -np.cos(angle), 0 * angle, np.sin(angle)], axis=1) / 2
    load = rng.standard_normal(patch.strain.shape[2])
    return n, load, np.isin(np.arange(particles), rng.permutation(particles)[:CANDIDATES])


def without(M: Array, b: Array, flow: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """M and b of the other particles, where those of `flow` have y = 0."""
    x = np.linalg.solve(M[np.ix_(flow, flow)], np.column_stack([M[np.ix_(flow, ~flow)], b[flow]]))
    across = M[np.ix_(~flow, flow)]
    return M[np.ix_(~flow, ~flow)] - across @ x[:, :-1], b[~flow] - across @ x[:, -1]


def count(form: str, nu: float, states: int = STATES) -> Counts:
    """Enumerate all active sets of random states."""
    counts, patch = Counts(form, nu, states), Patch(nu)
    for seed in range(states):
        n, load, candidate = state(seed, patch)
        M, b = without(*patch.complementarity(form, n, load), ~candidate)
        consistent, negative = enumerate_sets(M, b)
        counts.none += consistent == 0
        counts.one += consistent == 1
        counts.more += consistent > 1
        counts.negative += negative / states
    return counts


def study() -> list[Counts]:
    """Both forms at all Poisson's ratios."""
    return [count(form, nu) for form in ("total", "elastic") for nu in NU]
