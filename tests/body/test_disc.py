"""Discs and rings have the moments of circles, whichever cells the arcs cut."""

from __future__ import annotations

import moments
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from profiles import examples
from scenes import grid_of, linear_field

import tawami
from tawami import _rust

MOST = 28  # particles in a cut cell


def most_in_a_cell(grid, body):
    cell = np.floor((body.x - grid.origin) / grid.h).astype(int)
    return np.unique(cell, axis=0, return_counts=True)[1].max()


@settings(max_examples=examples(40))
@given(
    place=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    size=st.floats(1e-3, 1.0),
    hole=st.one_of(st.just(0.0), st.floats(0.0, 0.999)),
    per_axis=st.integers(2, 3),
)
def test_area_centroid_and_second_moments(place, size, hole, per_axis):
    grid = grid_of((5, 4))
    radius = 0.5 * size * min(5, 4) * grid.h
    room = np.array(grid.upper) - grid.origin - 2 * radius
    centre = np.array(grid.origin) + radius + np.array(place) * room
    body = tawami.disc(grid, centre, radius, inner=hole * radius, per_axis=per_axis, gauss=True)
    exact = moments.of_ring(centre, radius, hole * radius)
    assert moments.of_particles(body) == pytest.approx(exact, rel=1e-11, abs=1e-11 * exact[0])
    assert (body.volume > 0).all()
    r = np.hypot(*(body.x - centre).T)
    assert r.max() <= radius * (1 + 1e-9)
    assert r.min() >= hole * radius * (1 - 1e-9)
    assert most_in_a_cell(grid, body) <= MOST
    even = tawami.disc(grid, centre, radius, inner=hole * radius, per_axis=per_axis)
    assert moments.of_particles(even)[:3] == pytest.approx(
        exact[:3], rel=1e-11, abs=1e-11 * exact[0]
    )


@pytest.mark.parametrize(("inner", "cells"), [(0.0, 8), (0.25, 8), (0.5, 8), (0.5, 24), (0.999, 8)])
def test_circles_that_touch_lines_and_edges_of_the_grid(inner, cells):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=2 / cells, cells=(cells, cells))
    body = tawami.disc(grid, (0, 0), 1.0, inner=inner, gauss=True, per_axis=2)
    exact = moments.of_ring((0, 0), 1.0, inner)
    assert moments.of_particles(body) == pytest.approx(exact, abs=1e-12)
    assert (np.abs(body.x) < 1).all()


@pytest.mark.parametrize("per_axis", [1, 2, 3])
def test_error_of_second_moments_with_evenly_spaced_particles(per_axis):
    """It is h^2 / (12 per_axis^2) times the area of the full cells."""
    for n in (8, 16, 32):
        grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=2 / n, cells=(n, n))
        body = tawami.disc(grid, (0.03, 0.01), 0.9, per_axis=per_axis)
        lines = np.linspace(-1, 1, n + 1)
        # the corner of each cell that is farthest from the centre
        far = np.maximum(*(abs(part - [[0.03], [0.01]]) for part in (lines[:-1], lines[1:])))
        x, y = np.meshgrid(*far)
        full = np.count_nonzero(np.hypot(x, y) <= 0.9) * grid.h**2
        missing = (moments.of_ring((0.03, 0.01), 0.9, 0.0) - moments.of_particles(body))[3:]
        expected = full * grid.h**2 / (12 * per_axis**2)
        assert missing == pytest.approx([expected, expected, 0.0], abs=1e-13)


def test_forces_of_a_constant_stress_act_on_the_circle_only():
    """sum_p V_p grad N_i = int over the circle of N_i n."""
    grid, centre, radius = grid_of((8, 7), h=0.25), np.array([-0.05, 1.3]), 0.6
    body = tawami.disc(grid, centre, radius, gauss=True, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=3.0, nu=0.0), form="u")
    gradient = np.array([[1.0, 0.3], [0.3, -0.5]])  # nu = 0: sigma = 3 gradient
    forces = scene.residual(linear_field(grid, "quadratic_spline", np.zeros(2), gradient))
    angle = 2 * np.pi * (np.arange(40000) + 0.5) / 40000
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    location = grid.rust.locate(centre + radius * normal)
    length = np.full(len(angle), 2 * np.pi * radius / len(angle))
    expected = _rust.nodal_sums(location, length, normal @ (3 * gradient), "quadratic_spline")
    assert np.abs(forces - np.asarray(expected).ravel()).max() < 1e-8
    assert np.abs(forces).max() > 0.1


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_disc_that_touches_the_edges_up_to_rounding(scale):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.05 * scale, cells=(40, 40))
    body = tawami.disc(grid, (scale, scale), 1.000001 * scale)
    assert body.volume.sum() == pytest.approx(np.pi * scale**2, rel=1e-5)
    assert (body.x >= 0).all()
    assert (body.x <= 2 * scale).all()
    with pytest.raises(tawami.InputError, match="leaves the grid"):
        tawami.disc(grid, (scale, scale), 1.00001 * scale)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"radius": -1.0}, "radius = -1.0: expected a finite number above 0"),
        ({"radius": np.nan}, "radius = nan: expected a finite number"),
        ({"radius": 0.3, "inner": 0.3}, "inner = 0.3 m: expected less than the radius, 0.3 m"),
        ({"radius": 0.9}, r"circle around \(0, 1\) m with a radius of 0.9 m leaves the grid, \[-1, 1\]"),
        ({"radius": 0.3, "centre": 3}, "centre = 3: expected two numbers"),
        ({"radius": 0.3, "per_axis": 0}, "per_axis = 0: expected a whole number"),
    ],
)  # fmt: skip
def test_error_messages(options, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.disc(grid_of(), **{"centre": (0, 1)} | options)
