"""Particles in any number and at any place: a patch test that does not depend on quadrature.

The body starts with the stress -C : eps, and its border is displaced by u = eps x. Then no stress
remains anywhere, and the internal forces vanish for every arrangement of particles. Whether a
loaded body is also right depends on how well the particles integrate: this is tried in plain
tension.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted
from cases.extremes.forms import BASES, FORMS

Array = npt.NDArray[np.float64]
SUBJECT = "particles per cell"
CELLS, H = (4, 3), 0.5
E, NU, PULL = 3e6, 0.45, 1e3  # [Pa], [-], [Pa]
K, MU = E / (3 * (1 - 2 * NU)), E / (2 * (1 + NU))
GRADIENT = np.array([[2e-3, -1e-3], [4e-4, -1.5e-3]])


def even(per_axis: int) -> Array:
    """Evenly spaced positions in a unit cell."""
    t = (np.arange(per_axis) + 0.5) / per_axis
    return np.column_stack([np.tile(t, per_axis), np.repeat(t, per_axis)])


def edges() -> Array:
    """Positions on corners and middles of edges; neighbouring cells share them."""
    return np.array([(a, b) for a in (0, 0.5, 1) for b in (0, 0.5, 1) if (a, b) != (0.5, 0.5)])


def in_cells(of_cell: Callable[[int], Array]) -> tawami.Body:
    """A body with the particles `of_cell(number)` in each cell."""
    nx, ny = CELLS
    x = [(of_cell(c) + np.array([c % nx, c // nx])) * H for c in range(nx * ny)]
    volume = [np.full(len(part), H * H / len(part)) for part in x]
    return tawami.Body(np.concatenate(x), np.concatenate(volume))


def arrangements() -> dict[str, tawami.Body]:
    """The same rectangle with different particles, by name."""
    random = np.random.default_rng(0)
    bodies = {f"{k * k} in each cell": in_cells(lambda c, k=k: even(k)) for k in range(1, 9)}
    bodies["9 within 1/10 of a corner"] = in_cells(lambda c: 0.1 * even(3))
    bodies["9 within 1/1000 of a corner"] = in_cells(lambda c: 1e-3 * even(3))
    bodies["64 within 1/10 of a corner"] = in_cells(lambda c: 0.1 * even(8))
    bodies["on corners and edges of cells"] = in_cells(lambda c: edges())
    bodies["on corners of cells"] = in_cells(lambda c: edges()[[0, 2, 5, 7]])
    bodies["one in each cell, at random"] = in_cells(lambda c: random.random((1, 2)))
    bodies["4 in each cell, at random"] = in_cells(lambda c: random.random((4, 2)))
    bodies["9 in each cell, at random"] = in_cells(lambda c: random.random((9, 2)))
    return bodies


def scene_of(body: tawami.Body, form: str, basis: Any) -> tawami.Scene:
    """The rectangle as a scene without supports."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=H, cells=CELLS)
    law = tawami.linear_elastic(E=E, nu=NU)
    return tawami.Scene(grid, body, law, basis=basis, **FORMS[form])


def patch(body: tawami.Body, form: str, basis: str) -> tuple[float, str]:
    """The larger of the remaining stress and the displacement error, relative; a remark."""
    scene = scene_of(body, form, basis)
    div = np.trace(GRADIENT)
    strain = np.array([GRADIENT[0, 0], GRADIENT[1, 1], 0.0]) - div / 3
    stress = np.append(K * div + 2 * MU * strain, MU * (GRADIENT[0, 1] + GRADIENT[1, 0]))
    scene.particles.stress[:] = -stress
    for edge in ("left", "right", "bottom", "top"):
        for k, c in enumerate("xy"):
            scene.fix(edge, c, lambda x, y, k=k: GRADIENT[k, 0] * x + GRADIENT[k, 1] * y)
    solution = scene.solve()
    exact = body.x @ GRADIENT.T
    displaced = np.abs(scene.particles.displacement - exact).max() / np.abs(exact).max()
    left = np.abs(scene.particles.stress).max() / np.abs(stress).max()
    return float(max(displaced, left)), f"condition {solution.condition:.0e}"


def tension(body: tawami.Body, form: str, basis: str) -> float:
    """L2 error of the stress in plain tension."""
    width, height = H * CELLS[0], H * CELLS[1]
    # three sides: particles crowded in a corner of their cells do not fit a closed border
    corners = [(0.0, height), (0.0, 0.0), (width, 0.0), (width, height)]
    border = tawami.polyline(corners, names=["left", "bottom", "right"], closed=False)
    scene = scene_of(replace(body, border=border), form, basis)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (PULL, 0.0))
    scene.solve()
    exact = PULL * np.tile([1, 0, NU, 0], (len(body.x), 1))
    return float(np.linalg.norm(scene.particles.stress - exact) / np.linalg.norm(exact))


def midpoint(body: tawami.Body, form: str, basis: str) -> float:
    """Bound in tension: the error of the midpoint rule for the last function at a border.

    With k points along an axis the integral of (1 - s)^2 (splines) is too small by 1/(4 k^2), that of
    (1 - s)(1 - 2 s) (biquadratic) by 1/k^2; bilinear functions are integrated exactly. B-bar is off by
    0.22 and 0.42 with any rule (`tests/field/test_patch.py`).
    """
    k = np.sqrt(len(body.x) / (CELLS[0] * CELLS[1]))
    of_rule = {"quadratic_spline": 1 / (4 * k**2), "biquadratic": 1 / k**2, "bilinear": 1e-9}
    misses = {"quadratic_spline": 0.22, "biquadratic": 0.42, "bilinear": 0.0}
    return float(of_rule[basis] + (misses[basis] if form == "u_bbar" else 0.0))


def attempts(short: bool) -> Iterator[Attempt]:
    """Each arrangement, basis and form.

    The bound of the patch test is Newton's tolerance; most errors are at round-off.
    """
    for name, body in list(arrangements().items())[:: 4 if short else 1]:
        for basis in BASES:
            for form in list(FORMS)[:: 2 if short else 1]:
                setting = f"{name}: {form}, {basis}"
                yield attempted(
                    SUBJECT, setting, 1e-6, lambda o=body, f=form, b=basis: patch(o, f, b)
                )
                yield attempted(
                    SUBJECT,
                    f"{setting}: tension",
                    midpoint(body, form, basis),
                    lambda o=body, f=form, b=basis: tension(o, f, b),
                )
