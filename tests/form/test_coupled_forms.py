"""Shipped forms with fields of their own: tangents, and closed forms of small problems."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import COUPLED

import tawami

GEOMETRIES = ("plane_strain", "axisymmetric")


def random_scene(geometry: str, **options) -> tawami.Scene:
    """Particles of two materials at random, with the data of the form and old fields that vary."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 3), geometry=geometry)
    random = np.random.default_rng(0)
    body = tawami.Body(random.random((60, 2)) * (2, 1.5), random.uniform(0.01, 0.1, 60))
    laws = [tawami.linear_elastic(E=2.0, nu=0.3), tawami.linear_elastic(E=7.0, nu=0.49)]
    numbers = random.integers(0, 2, 60)
    scene = tawami.Scene(grid, body, laws, material_of=numbers, density=1.0, **options)
    scene.gravity((0.0, -0.2))
    for name in scene.form.data:
        scene.data(name, lambda x, y: 1.0 + 0.1 * x)
    for name in scene.form.own_fields:
        scene.initial(name, lambda x, y: 0.2 + 0.1 * x * y)
    return scene


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("name", COUPLED)
def test_the_tangent_is_the_difference_of_residuals(name, geometry):
    scene = random_scene(geometry, **COUPLED[name])
    random = np.random.default_rng(1)
    c, d = 0.02 * random.standard_normal((2, scene.num_coefficients))
    step = 1e-4
    ends = [scene.residual(c + sign * step * d, dt=0.3) for sign in (1, -1)]
    difference = (ends[0] - ends[1]) / (2 * step)
    predicted = scene.tangent(c, dt=0.3) @ d
    assert np.abs(difference - predicted).max() < 1e-7 * np.abs(predicted).max()
