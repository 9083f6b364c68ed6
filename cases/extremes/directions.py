"""Grids far from the origin, and scenes turned by quarter turns: the solution must be the same.

The body is L-shaped, of two materials, held along an edge, and loaded on a part of another edge and by
its weight. Turned by 90 degrees it meets the axes in another order. Far from the origin its positions
have fewer digits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted

Array = npt.NDArray[np.float64]
SUBJECT = "directions and places"
N, H = 6, 0.25  # cells along a side of the grid, their size [m]
FORMS: dict[str, dict[str, Any]] = {
    "u": {"form": "u"},
    "u_bbar": {"form": "u_bbar"},
    "u_epsv": {"form": "u_epsv", "ghost_penalty": "off"},
    "u_epsv, residual_based": {
        "form": "u_epsv",
        "ghost_penalty": "off",
        "stabilisation": "residual_based",
    },
    "u_epsv, projection": {"form": "u_epsv", "ghost_penalty": "off", "stabilisation": "projection"},
    "u_epsv, ghost": {"form": "u_epsv", "ghost_penalty": "on"},
    "u_p": {"form": "u_p"},
    "u_epsv_finite": {"form": "u_epsv_finite"},
    "u_bbar_finite": {"form": "u_bbar_finite"},
}
BASES = ("quadratic_spline", "bilinear", "biquadratic")
#: Edges in the order of turns to the left.
EDGES = ("bottom", "right", "top", "left")
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
AWAY = (1e2, 1e4, 1e6, 1e8, 1e9, 1e10, 1e16)  # distances from (0, 0) in cells


def edge(name: str, turns: int) -> Any:
    """The edge that an edge becomes after quarter turns to the left."""
    return EDGES[(EDGES.index(name) + turns) % 4]


def solved(form: str, basis: Any, turns: int = 0, away: float = 0.0) -> list[Array]:
    """Displacement and stress of the particles, turned back to the original axes."""
    turn = np.linalg.matrix_power(QUARTER, turns)
    side = N * H
    origin = np.array([away, -0.7 * away]) * H
    grid = tawami.Grid(MPI.COMM_WORLD, origin=origin, h=H, cells=(N, N))
    at_home = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=H, cells=(N, N))
    corners = np.array([(0, 0), (1, 0), (1, 1.0), (2 / 3, 1.0), (0.45, 0.52), (0, 0.5)]) * side
    body = tawami.polygon(at_home, corners, per_axis=3)

    def there(at_home: Array) -> Array:
        return (at_home - side / 2) @ turn.T + side / 2 + origin

    x = there(body.x)
    laws = [tawami.linear_elastic(E=e, nu=nu) for e, nu in ((1e6, 0.3), (3e6, 0.45))]
    moved = tawami.Body(x, body.volume, border=tawami.polyline(there(corners)))
    scene = tawami.Scene(
        grid, moved, laws, material_of=(body.x[:, 0] > side / 2).astype(int), basis=basis,
        density=1e3, **FORMS[form],
    )  # fmt: skip
    for component in "xy":
        scene.fix(edge("bottom", turns), component)
    force = turn @ [2e3, -1e3]
    scene.traction(edge("top", turns), (force[0], force[1]))
    scene.gravity(turn @ [0.0, -10.0])
    scene.solve()
    s = np.array(scene.particles.stress)
    tensor = np.stack([s[:, [0, 3]], s[:, [3, 1]]], axis=1)
    back = turn.T @ tensor @ turn
    return [scene.particles.displacement @ turn, back, s[:, 2]]


def difference(form: str, basis: str, turns: int, away: float) -> float:
    """Largest change of a quantity over its largest value."""
    here, there = solved(form, basis), solved(form, basis, turns, away)
    return max(
        float(np.abs(b - a).max() / np.abs(a).max()) for a, b in zip(here, there, strict=True)
    )


def attempts(short: bool) -> Iterator[Attempt]:
    """Each form and basis turned, and three forms far from the origin.

    Turned scenes agree to round-off: 1e-16 times a condition number of at most 1e6, times 10 for
    sums. Far away, positions are off by 2e-16 of the distance in cells; the strains at the slanted
    border change by at most 100 times as much.
    """
    for basis in BASES[:1] if short else BASES:
        for form in list(FORMS)[::2] if short else FORMS:
            for turns in (1,) if short else (1, 2, 3):
                yield attempted(
                    SUBJECT,
                    f"{form}, {basis}: turned by {90 * turns} degrees",
                    1e-9,
                    lambda f=form, b=basis, t=turns: difference(f, b, t, 0.0),
                )
    for form in ("u", "u_epsv", "u_epsv_finite"):
        for away in AWAY[::3] if short else AWAY:
            yield attempted(
                SUBJECT,
                f"{form}: {away:g} cells from (0, 0)",
                100 * 2e-16 * away + 1e-10,
                lambda f=form, a=away: difference(f, "quadratic_spline", 0, a),
            )
