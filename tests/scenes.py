"""Grids, particles and scenes that several test files build."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st
from mpi4py import MPI

import tawami

U_EPSV = {"form": "u_epsv", "alpha": 0.1, "ghost_penalty": "off"}
#: Shipped forms of small strain with their stabilisations, without the penalty of cut cells.
FORMS: dict[str, dict[str, Any]] = {
    "u": {"form": "u"},
    "u_bbar": {"form": "u_bbar"},
    "u_epsv": U_EPSV,
    "u_epsv_alpha0": U_EPSV | {"alpha": 0.0},
    "u_epsv_residual_based": U_EPSV | {"stabilisation": "residual_based"},
    "u_epsv_projection": U_EPSV | {"stabilisation": "projection"},
    "u_p": {"form": "u_p", "alpha": 0.1},
}
#: Shipped forms of finite strain.
FINITE: dict[str, dict[str, Any]] = {
    "u_finite": {"form": "u_finite"},
    "u_epsv_finite": {"form": "u_epsv_finite", "alpha": 0.1},
    "u_bbar_finite": {"form": "u_bbar_finite"},
}
#: Shipped forms that read dt or have fields of their own: a step of them needs time.
COUPLED: dict[str, dict[str, Any]] = {
    "u_epsv_pw": {"form": "u_epsv_pw", "biot": 0.8, "storage": 0.3, "mu_w": 0.7, "rho_w": 1.3},
    "u_epsv_pw_finite": {
        "form": "u_epsv_pw_finite",
        "mu_w": 0.7,
        "rho_w": 1.3,
        "m": 2.0,
        "leak": 0.2,
    },
    "u_epsv_theta": {"form": "u_epsv_theta"},
    "u_epsv_visco": {"form": "u_epsv_visco"},
    "u_epsv_damage": {"form": "u_epsv_damage"},
}
#: Bases of the displacement.
BASES = ("quadratic_spline", "bilinear", "biquadratic")


def grid_of(cells: tuple[int, int] = (4, 3), h: float = 0.5) -> tawami.Grid:
    """A grid whose lower corner is (-1, 0.5)."""
    return tawami.Grid(MPI.COMM_WORLD, origin=(-1.0, 0.5), h=h, cells=cells)


def random_scene(
    count: int = 60,
    seed: int = 0,
    x: np.ndarray | None = None,
    cells: tuple[int, int] = (4, 3),
    law: Callable[..., tawami.Material] = tawami.linear_elastic,
    **options: Any,
) -> tawami.Scene:
    """A scene of particles of two materials at random positions, or at positions x."""
    random = np.random.default_rng(seed)
    grid = grid_of(cells)
    if x is None:
        size = grid.h * np.array(cells)
        x = grid.origin + size * random.random((count, 2))
    body = tawami.Body(x, random.uniform(0.01, 0.1, len(x)))
    materials = [law(E=2.0, nu=0.3), law(E=7.0, nu=0.49)]
    numbers = random.integers(0, 2, len(x))
    return tawami.Scene(grid, body, materials, material_of=numbers, **options)


def beam(
    form: str = "u_epsv",
    basis: str = "quadratic_spline",
    cells: tuple[int, int] = (4, 3),
    **options: Any,
) -> tawami.Scene:
    """A nearly incompressible body that fills its grid, without supports and loads."""
    grid = grid_of(cells)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
    material = tawami.linear_elastic(E=3e3, nu=0.4999)
    return tawami.Scene(grid, body, material, form=form, basis=basis, **options)


@st.composite
def clouds(draw: st.DrawFn, cells: tuple[int, int], most: int) -> tuple[tawami.Grid, np.ndarray]:
    """A grid of at most `cells` cells, and up to `most` points in it, also on edges and corners."""
    size = tuple(draw(st.integers(1, n)) for n in cells)
    coordinate = st.one_of(st.floats(0, 1), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
    points = draw(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=most))
    grid = grid_of(size)
    return grid, grid.origin + grid.h * np.array(size) * np.array(points)


def greville(basis: str, n: int) -> np.ndarray:
    """Greville abscissae in cells: coefficients equal to them reproduce the function x."""
    if basis == "quadratic_spline":
        return np.array([0.0, *(np.arange(n) + 0.5), n])
    return np.linspace(0, n, n + 1 if basis == "bilinear" else 2 * n + 1)


def linear_field(grid: tawami.Grid, basis: str, a: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Displacement coefficients of u = a + gradient (x - origin)."""
    x, y = (grid.h * greville(basis, n) for n in grid.cells)
    points = np.stack([np.tile(x, len(y)), np.repeat(y, len(x))], axis=1)
    return (a + points @ np.asarray(gradient).T).ravel()
