"""The elastica, and a strip bent to it across many cells."""

from __future__ import annotations

import numpy as np
import pytest

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
