"""The default number of particles per cell and axis, and what 2 instead of 3 costs in accuracy."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.body.filling import PER_AXIS


@pytest.mark.parametrize(
    "shape", [tawami.box, tawami.polygon, tawami.disc, tawami.level_set, tawami.mesh]
)
def test_every_shape_has_the_same_default(shape):
    assert PER_AXIS == 3
    assert inspect.signature(shape).parameters["per_axis"].default == PER_AXIS


def column_error(per_axis):
    """Largest error of the vertical stress at the bottom of a column under its weight [%]."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 16))
    body = tawami.box(grid, (0, 0), (1, 2), per_axis=per_axis)
    law = tawami.linear_elastic(E=1e6, nu=0.49)
    scene = tawami.Scene(grid, body, law, density=1e3)
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    scene.gravity((0.0, -10.0))
    scene.solve()
    y = scene.particles.x[:, 1]
    error = np.abs(scene.particles.stress[:, 1] + 1e4 * (2 - y))
    return 100 * error[y < 0.125].max() / 2e4


def strip_settlement(per_axis):
    """Settlement in the middle of a strip load on half of a layer."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, -2), h=1 / 8, cells=(16, 16))
    body = tawami.box(grid, (0, -2), (2, 0), per_axis=per_axis)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=100.0, nu=0.3))
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    scene.traction(lambda x, y: (y == 0) & (x < 1), (0.0, -1.0))
    return scene.solve().displacement((0.0, 0.0))[1]


def test_three_per_axis_halve_the_error_at_the_bottom_of_a_column():
    two, three = column_error(2), column_error(3)
    print(f"error at the bottom: 2 x 2 {two:.2f} %, 3 x 3 {three:.2f} %")
    assert three < 0.3
    assert two > 2 * three


def test_three_per_axis_are_three_times_as_exact_under_a_strip_load():
    exact = strip_settlement(8)  # the sums over cells are all but integrals
    two, three = (100 * (strip_settlement(n) / exact - 1) for n in (2, 3))
    print(f"error of the settlement: 2 x 2 {two:.2f} %, 3 x 3 {three:.2f} %")
    assert 0 < three < 0.5
    assert two > 2.5 * three
