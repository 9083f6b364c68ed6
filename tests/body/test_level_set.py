"""Bodies of level sets have the right area, within the tolerance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from profiles import examples
from scenes import grid_of

import tawami
from tawami.body.border_squares import merged
from tawami.body.moment_fitting import fewer


def square_grid(n=16):
    return tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=2 / n, cells=(n, n))


def ellipse(centre, axes, turn):
    def f(x, y):
        u, v = turned(x - centre[0], y - centre[1], turn)
        return np.hypot(u / axes[0], v / axes[1]) - 1

    return f


def turned(x, y, angle):
    c, s = np.cos(angle), np.sin(angle)
    return c * x + s * y, c * y - s * x


def square(side, angle):
    def f(x, y):
        u, v = turned(x, y, angle)
        return np.maximum(abs(u), abs(v)) - side / 2

    return f


@settings(max_examples=examples(8))
@given(
    centre=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    axes=st.tuples(st.floats(0.1, 0.8), st.floats(0.1, 0.8)),
    turn=st.floats(0, 3),
    tolerance=st.sampled_from([1e-3, 1e-5, 1e-6]),
)
def test_area_and_centroid_of_ellipses(centre, axes, turn, tolerance):
    grid = square_grid()
    body = tawami.level_set(grid, ellipse(centre, axes, turn), tolerance=tolerance, per_axis=2)
    area = np.pi * axes[0] * axes[1]
    assert body.volume.sum() == pytest.approx(area, rel=tolerance)
    assert body.volume @ body.x / area == pytest.approx(centre, abs=tolerance * max(axes))
    assert (body.volume > 0).all()
    assert (np.abs(body.x) < 1).all()
    cell = np.floor((body.x + 1) / grid.h)
    assert np.unique(cell, axis=0, return_counts=True)[1].max() <= 28


@pytest.mark.parametrize("sign", [1, -1])
def test_area_of_curved_borders(sign):
    """Chords between samples at a distance of h/4 would change the area by h^2/(16 * 12 R^2) of it.

    The error, without any division, is less than a hundredth of that.
    """
    grid, R = square_grid(16), 0.7
    body = tawami.level_set(
        grid,
        lambda x, y: sign * (np.hypot(x - 0.01, y - 0.02) - R),
        samples=4,
        tolerance=0.1,
        ends=() if sign > 0 else ("left", "right", "bottom", "top"),
        per_axis=2,
    )
    area = np.pi * R**2
    chords = area * (grid.h / 4) ** 2 / (12 * R**2)
    error = body.volume.sum() - (area if sign > 0 else 4 - area)
    assert chords > 1e-5
    assert abs(error) < 0.01 * chords


@pytest.mark.parametrize("angle", [0.0, 0.1, np.pi / 4])
def test_corners(angle):
    for tolerance in (1e-4, 1e-6, 1e-7):
        body = tawami.level_set(
            square_grid(), square(1.03, angle), tolerance=tolerance, gauss=True, per_axis=2
        )
        area = 1.03**2
        assert body.volume.sum() == pytest.approx(area, rel=tolerance)
        second = (body.volume[:, None] * body.x**2).sum(axis=0)
        assert second == pytest.approx(2 * [area**2 / 12], rel=10 * tolerance)


def test_sides_on_lines_of_the_grid_make_a_box():
    grid = square_grid()
    body = tawami.level_set(grid, square(1.0, 0.0), per_axis=3)
    box = tawami.box(grid, (-0.5, -0.5), (0.5, 0.5), per_axis=3)
    order, order_of_box = (np.lexsort(np.round(b.x, 9).T) for b in (body, box))
    assert body.x[order] == pytest.approx(box.x[order_of_box])
    assert body.volume[order] == pytest.approx(box.volume[order_of_box])


def test_only_the_sign_of_the_function_is_used():
    f = ellipse((0.0, 0.1), (0.6, 0.3), 0.5)
    one, other = (
        tawami.level_set(square_grid(), g, per_axis=2)
        for g in (f, lambda x, y: np.where(f(x, y) < 0, -3e9, 0))
    )
    assert np.array_equal(one.x, other.x)
    assert np.array_equal(one.volume, other.volume)


def test_thin_parts_need_more_samples():
    def strip(x, y):
        return np.maximum(np.abs(x - 0.49) - 0.002, np.abs(y) - 0.5)

    grid = square_grid()
    with pytest.raises(tawami.InputError, match="not negative at any of the 16641 samples"):
        tawami.level_set(grid, strip, per_axis=2)
    body = tawami.level_set(grid, strip, samples=32, per_axis=2)
    assert body.volume.sum() == pytest.approx(0.004, rel=1e-6)


def test_bodies_that_end_at_edges_of_the_grid():
    grid = grid_of()
    slope = tawami.level_set(
        grid, lambda x, y: y - 1.2 - 0.1 * x, ends=("bottom", "left", "right"), per_axis=2
    )
    assert slope.volume.sum() == pytest.approx(2 * 0.7, rel=1e-12)
    with pytest.raises(tawami.InputError, match=r"negative on the edge 'left'.*ends=\('left',\)"):
        tawami.level_set(grid, lambda x, y: y - 1.2 - 0.1 * x, ends=("bottom", "right"), per_axis=2)
    full = tawami.level_set(
        grid, lambda x, y: -1.0, ends=("bottom", "left", "right", "top"), per_axis=2
    )
    box = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    assert set(map(tuple, full.x)) == set(map(tuple, box.x))


@pytest.mark.parametrize(
    ("f", "options", "message"),
    [
        (1.0, {}, "f = 1.0: expected a function f"),
        (lambda x, y: x * 0 + 1, {}, "f is not negative at any of the 825 samples.*change its sign"),
        (lambda x, y: np.where(x > 0, np.nan, 1), {}, r"f is NaN at 459 points, the first is \(0.0625"),
        (lambda x, y: -1.0 if x < 0 else 1.0, {}, "f failed on arrays .*np.where"),
        (lambda x, y: x[:3], {}, r"f returned an array of shape \(3,\): expected \(972,\)"),
        (lambda x, y: x, {"tolerance": 0}, "tolerance = 0: expected a finite number of at least 1e-13"),
        (lambda x, y: x, {"samples": 1}, "samples = 1: expected a whole number, at least 2"),
        (lambda x, y: x, {"ends": ("front",)}, "front"),
        (
            lambda x, y: np.where(np.random.default_rng(0).random(len(x)) < 0.5, -1, 1),
            {"ends": ("left", "right", "bottom", "top")},
            "tolerance = 1e-06 of the area was not reached",
        ),
    ],
)  # fmt: skip
def test_error_messages(f, options, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.level_set(grid_of(), f, **options)


def test_many_points_are_thinned_to_the_same_moments():
    rng = np.random.default_rng(0)
    x, weight = rng.random((2000, 2)) * [1.0, 0.3], rng.random(2000)
    found, volume = fewer(x, weight, np.ones(2000, dtype=bool))
    assert len(found) <= 28
    assert (volume > 0).all()
    for i in range(7):
        for j in range(7 - i):
            moments = (
                weight @ (x[:, 0] ** i * x[:, 1] ** j),
                volume @ (found[:, 0] ** i * found[:, 1] ** j),
            )
            assert moments[1] == pytest.approx(moments[0], rel=1e-11)


def test_squares_are_merged_to_boxes_within_their_cells():
    corner = 0.25 * np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [4, 0], [0, 2]])
    cell = np.array([0, 0, 0, 0, 0, 0, 1, 0])
    lower, upper = merged(corner, 0.25, cell)
    boxes = {tuple(box) for box in np.hstack([lower, upper])}
    assert boxes == {(0, 0, 0.75, 0.5), (0, 0.5, 0.25, 0.75), (1, 0, 1.25, 0.25)}
