"""Borders that are stretched: points are divided, and sums over the border stay."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.domain.moving_points import LONGEST, MovingPoints

H = 0.25


def grid_of(cells, **options):
    return tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=cells, **options)


def stretched(points: MovingPoints, f: np.ndarray) -> np.ndarray:
    """Move points by a homogeneous f, and divide them."""
    points.x = points.x @ f.T
    points.area = points.area @ (np.linalg.det(f) * np.linalg.inv(f))
    return points.divide()


def test_points_of_a_disc_that_is_stretched_by_four():
    """Area and centroid of the ellipse by the divergence theorem, and dead loads, stay exact."""
    grid = grid_of((40, 16))
    points = MovingPoints(tawami.disc(grid, (1, 2), 0.8).border.points(grid, 5), grid)
    before, weight = len(points), points.reference.sum()
    f = np.array([[4**0.25, 0.1], [0.0, 0.95]])
    of = np.arange(before)
    for _ in range(4):
        of = of[stretched(points, f)]
    whole = np.linalg.matrix_power(f, 4)
    assert len(points) > 1.5 * before
    assert points.length.max() <= LONGEST * H * (1 + 1e-9)
    assert np.array_equal(of, points.number)
    assert points.reference.sum() == pytest.approx(weight, rel=1e-14)
    assert np.abs(points.area.sum(axis=0)).max() < 1e-13 * points.length.sum()
    assert points.x == pytest.approx(points.made.x @ whole.T, rel=1e-13)
    area = np.pi * 0.8**2 * np.linalg.det(whole)
    assert (points.x * points.area).sum() / 2 == pytest.approx(area, rel=2e-3)
    moment = points.reference @ points.x
    assert moment == pytest.approx(weight * whole @ (1, 2), rel=1e-12)
    now = points.now
    order = np.lexsort((now.along, now.chain))
    gaps = np.linalg.norm(np.diff(now.x[order], axis=0), axis=1)
    assert gaps.max() < 1.5 * LONGEST * H


def test_points_do_not_cross_an_axis_of_rotation():
    grid = grid_of((20, 8), geometry="axisymmetric")
    points = MovingPoints(tawami.box(grid, (0, 0), (1, 1)).border.points(grid, 5), grid)
    for _ in range(3):
        stretched(points, np.diag([1.6, 1.0]))
    assert points.length.max() <= LONGEST * H * (1 + 1e-9)
    assert points.x[:, 0].min() > 0
    top = points.normal[:, 1] > 0.5
    assert points.weight[top].sum() == pytest.approx(np.pi * 1.6**6, rel=1e-3)


def pulled():
    """A block under a dead load on its top, which is pulled to twice its length."""
    grid = grid_of((10, 5))
    block = tawami.box(grid, (0, 0), (1, 1.03), per_axis=4)
    law = tawami.neo_hookean(E=1e3, nu=0.3)
    options = {"ghost_penalty": "on", "tolerance": 1e-9}  # of the pull, which is 100 times the load
    scene = tawami.Scene(grid, block, law, form="u_finite", **options)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    pull = scene.fix("right", "x", 1.0)
    scene.traction("top", (0.0, -10.0))
    return scene, pull


def test_the_resultant_of_a_dead_load_stays_where_the_border_is_divided():
    scene, pull = pulled()
    before = len(scene.border.x)
    with pytest.warns(tawami.QuadratureWarning, match="2.1 times as far as at the start"):
        tawami.ramp(scene, 0.25)
    assert len(scene.border.x) > 1.2 * before
    assert len(pull.held) == len(pull.place)
    solution = scene.solve()
    assert solution.reaction("bottom")[1] == pytest.approx(10.0, rel=1e-5)
    parts = [part for part in scene.border.all if part is not scene.border._ends]
    assert max(part.length.max() for part in parts) <= LONGEST * H * (1 + 1e-9)
    other, _ = pulled()
    other.configuration.restore(scene.configuration.state())
    for a, b in zip(scene.border.all, other.border.all, strict=True):
        assert np.array_equal(a.now.along, b.now.along)
    forces = [one.configuration.external() for one in (scene, other)]
    assert np.array_equal(*forces)
    half = scene.border.part("a new part", lambda x, y: (y > 0.5) & (x < 1.0))
    assert half.length.sum() > 1.0
