"""What several test files share: small scenes and an independent sum over particles."""

from __future__ import annotations

import contextlib
import logging
import resource
import signal
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from mpi4py import MPI

import tawami

# a shell that starts this in the background has Ctrl-C ignored, here and in the processes of the tests
signal.signal(signal.SIGINT, signal.default_int_handler)
logging.disable(logging.INFO)  # the compilation of forms is talkative
# the first example of a test may compile a form
settings.register_profile("tawami", deadline=None)
settings.load_profile("tawami")

FORMS: dict[str, dict[str, Any]] = {
    "u": {"form": "u"},
    "u_bbar": {"form": "u_bbar"},
    "u_epsv": {"form": "u_epsv", "alpha": 0.1},
    "u_epsv_alpha0": {"form": "u_epsv", "alpha": 0.0},
    "u_epsv_residual_based": {"form": "u_epsv", "alpha": 0.1, "stabilisation": "residual_based"},
    "u_epsv_projection": {"form": "u_epsv", "alpha": 0.1, "stabilisation": "projection"},
    "u_p": {"form": "u_p", "alpha": 0.1},
}
FINITE: dict[str, dict[str, Any]] = {
    "u_finite": {"form": "u_finite"},
    "u_epsv_finite": {"form": "u_epsv_finite", "alpha": 0.1},
    "u_bbar_finite": {"form": "u_bbar_finite"},
}
BASES = ("quadratic_spline", "bilinear", "biquadratic")


def grid_of(cells: tuple[int, int] = (4, 3), h: float = 0.5) -> tawami.Grid:
    """A grid away from the origin."""
    return tawami.Grid(MPI.COMM_WORLD, origin=(-1.0, 0.5), h=h, cells=cells)


@st.composite
def clouds(draw: st.DrawFn, cells: tuple[int, int], most: int) -> tuple[tawami.Grid, np.ndarray]:
    """A grid of at most so many cells, and up to `most` points on it: anywhere, on edges, on corners."""
    size = tuple(draw(st.integers(1, n)) for n in cells)
    coordinate = st.one_of(st.floats(0, 1), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
    points = draw(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=most))
    grid = grid_of(size)
    return grid, grid.origin + grid.h * np.array(size) * np.array(points)


def greville(basis: str, n: int) -> np.ndarray:
    """Coordinates, in cells, of the coefficients that reproduce x; written out once more here."""
    if basis == "quadratic_spline":
        return np.array([0.0, *(np.arange(n) + 0.5), n])
    return np.linspace(0, n, n + 1 if basis == "bilinear" else 2 * n + 1)


def linear_field(grid: tawami.Grid, basis: str, a: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Displacement coefficients of u = a + gradient (x - origin)."""
    x, y = (grid.h * greville(basis, n) for n in grid.cells)
    points = np.stack([np.tile(x, len(y)), np.repeat(y, len(x))], axis=1)
    return (a + points @ np.asarray(gradient).T).ravel()


@contextlib.contextmanager
def small_files(most: int) -> Iterator[None]:
    """Files of this process cannot grow beyond that [bytes]: a full disk, but for the error's number."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture(params=FORMS)
def form(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Each shipped form with each of its stabilisations."""
    return FORMS[request.param]


@pytest.fixture(params=BASES)
def basis(request: pytest.FixtureRequest) -> str:
    """Each basis of the displacement."""
    return str(request.param)


@pytest.fixture
def random_scene() -> Callable[..., tawami.Scene]:
    """A scene of random particles of two materials; see `make`."""

    def make(
        count: int = 60,
        seed: int = 0,
        x: np.ndarray | None = None,
        cells: tuple[int, int] = (4, 3),
        law: Callable[..., tawami.Material] = tawami.linear_elastic,
        **options: Any,
    ) -> tawami.Scene:
        random = np.random.default_rng(seed)
        grid = grid_of(cells)
        if x is None:
            size = grid.h * np.array(cells)
            x = grid.origin + size * random.random((count, 2))
        body = tawami.Body(x, random.uniform(0.01, 0.1, len(x)))
        materials = [law(E=2.0, nu=0.3), law(E=7.0, nu=0.49)]
        numbers = random.integers(0, 2, len(x))
        return tawami.Scene(grid, body, materials, material_of=numbers, **options)

    return make
