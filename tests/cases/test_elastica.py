"""The elastica, and a strip bent to it across many cells."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from cases.verification.elastica import mpm, strip


@pytest.mark.parametrize(
    ("load", "x", "y"),
    [(1.0, -0.0564, -0.3017), (10.0, -0.5550, -0.8106), (0.01, -6.7e-6, -0.01 / 3)],
)
def test_the_tip_agrees_with_tables(load, x, y):
    """For a small load, the third, y = -load/3 and x = -load^2/15."""
    assert strip.tip(load) == pytest.approx([x, y], abs=5e-5)
    end = strip.curve(load, np.array([1.0]))[:, 0]
    assert end[:2] == pytest.approx(strip.tip(load) + np.array([1, 0]), abs=1e-8)
    assert end[2] == pytest.approx(strip.tip_angle(load), abs=1e-8)
    assert end[3] == pytest.approx(0.0, abs=1e-8)


def test_a_moderate_deflection_is_within_one_percent():
    assert mpm.solve(1.0, steps=5).error < 0.8


@pytest.fixture(scope="module")
def large():
    return mpm.solve(10.0)


@pytest.mark.slow
def test_a_large_deflection_is_within_two_percent_at_four_cells(large):
    assert large.accepted == 20
    assert large.iterations < 5
    assert large.crossed > 100
    assert large.error < 2.0
    assert mpm.solve(1.0).error < 0.8


@pytest.mark.slow
def test_displacement_alone_locks_near_incompressibility():
    mixed, displacement = (
        mpm.solve(1.0, form, 0.499, steps=10) for form in ("u_epsv_finite", "u_finite")
    )
    assert mixed.error < 0.8
    assert mixed.stress_error < 3.0
    assert displacement.stress_error > 5 * mixed.stress_error


@pytest.mark.slow
def test_the_error_grows_with_the_number_of_resets_of_the_grid(large):
    assert mpm.solve(10.0, steps=60).error > 1.2 * large.error


def test_without_a_ghost_penalty_a_static_beam_stops_where_particles_enter_empty_cells():
    run = mpm.solve(10.0, n=2, k=0.0)
    assert "of the load, with the smallest step" in run.stopped


def test_the_tip_under_a_small_pressure_is_that_of_a_straight_beam():
    """-1/8 of p L^3/(Ebar I), and x of second order."""
    assert strip.pressed_tip(0.01) == pytest.approx([0.0, -0.01 / 8], abs=1e-6)


def pressed(n, load):
    """A strip with a pressure on its sides. Half of it presses on the top and half pulls at the bottom,
    which leaves no moment.
    """
    D, L = strip.D, strip.SLENDER * strip.D
    h, rows = D / n, int(np.ceil(1.4 * L * n / D * 0.65))
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0, -D / 2 - rows * h), h=h, cells=(round(L / h) + 1, n + rows + 2)
    )
    body = tawami.box(grid, (0, -D / 2), (L, D / 2), per_axis=3)
    law = tawami.linear_elastic(E=strip.E, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", alpha=0.01)
    scene.fix("left", "x")
    scene.fix("left", "y")
    p = load * strip.E / (1 - 0.3**2) * D**3 / 12 / L**3
    scene.pressure("top", p / 2)
    scene.pressure("bottom", -p / 2)
    return scene


def follow_tip(scene, size, to):
    """The path on which a point at the tip goes down by lengths `to`, and its load factors."""
    steps = tawami.follow(scene, ((0.999 * strip.SLENDER * strip.D, 0.0), "y"), size=size, to=to)
    return np.array(scene.particles.displacement), steps


def test_a_path_scales_pressures_that_follow_the_sides():
    """One step is that of the pressure with the factor it finds; more agree with a fine ramp."""
    L = strip.SLENDER * strip.D
    one, steps = follow_tip(pressed(2, 6.0), 0.2 * L, -0.2 * L)
    scene = pressed(2, 6.0 * steps.loads[-1])
    scene.solve()
    assert scene.particles.displacement == pytest.approx(one, abs=1e-5 * L)
    assert steps[-1].iterations <= 8
    path, steps = follow_tip(pressed(2, 6.0), 0.2 * L, -0.4 * L)
    scene = pressed(2, 6.0 * steps.loads[-1])
    tawami.ramp(scene, 0.25)
    assert scene.particles.displacement == pytest.approx(path, abs=5e-3 * L)


@pytest.mark.parametrize(
    ("n", "steps", "most"), [(2, 5, 1.8), pytest.param(4, 10, 0.7, marks=pytest.mark.slow)]
)
def test_a_strip_bends_under_a_pressure_that_follows_its_sides(n, steps, most):
    load, L = 6.0, strip.SLENDER * strip.D
    scene = pressed(n, load)
    accepted = tawami.ramp(scene, 1 / steps)
    assert accepted[-1].end == 1.0
    assert np.mean([step.iterations for step in accepted]) < 6
    # particles on the axis, extrapolated from the last two columns to the tip
    start = scene.particles.x - scene.particles.displacement
    columns = np.unique(np.round(start[:, 0], 9))[-2:]
    of_columns = np.array(
        [scene.particles.displacement[np.abs(start[:, 0] - x) < 1e-8].mean(axis=0) for x in columns]
    )
    share = (L - columns[0]) / (columns[1] - columns[0])
    tip = of_columns[0] + share * (of_columns[1] - of_columns[0])
    softer = strip.pressed_tip(load / (1 - 1 / (3 * n) ** 2))
    error = 100 * np.linalg.norm(tip / L - softer)
    print(f"n = {n}: error of the tip {error:.2f} % of the length")
    assert error < most
