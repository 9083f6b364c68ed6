"""Self-weight consolidation at finite strain: Gibson's equation, closed forms, balance of water."""

from __future__ import annotations

import numpy as np
import pytest

from cases.verification import soft_clay as case
from tawami.domain import own_fields


@pytest.fixture(scope="module")
def run():
    return case.solve(10, first=5e-3, growth=0.3, most=0.15)


def test_the_equation_of_gibson_ends_at_the_closed_form():
    _, Z, J = case.gibson(n=100)
    np.testing.assert_allclose(J[:, -1], case.final_J(Z), atol=1e-3)


def test_the_equation_of_gibson_has_the_series_of_small_strain_as_limit():
    small = 1e-4 * case.WEIGHT
    times, _, J = case.gibson(small, n=100)
    s = case.H * (1 - J).mean(axis=0)
    np.testing.assert_allclose(s, case.small_strain(times, small), rtol=0.02, atol=1e-3 * s[-1])


def test_the_layer_settles_as_far_as_the_closed_form(run):
    assert run.settlement[-1] == pytest.approx(case.final_settlement(), rel=0.015)
    _, Z, _, J = run.profiles[2.0]
    assert np.sqrt(np.mean((J - case.final_J(Z)) ** 2)) < 0.01


def test_without_projections_of_the_pressure_the_layer_stops_early(run, monkeypatch):
    """Differences of p_w within a cell, which the functions of the grid do not see, carry its weight."""
    monkeypatch.setattr(own_fields, "project", lambda domain: None)
    other = case.solve(10, first=5e-3, growth=0.3, most=0.15)
    assert other.settlement[-1] < 0.95 * run.settlement[-1]


def test_the_water_that_leaves_is_the_settlement(run):
    np.testing.assert_allclose(run.water, run.settlement, rtol=0.01)


def test_pressures_follow_the_equation_of_gibson(run):
    for row in case.rows(run)[1:]:
        assert row.pressure < 2
        assert abs(row.error) < 6


@pytest.mark.slow
def test_finer_steps_and_cells():
    for row in case.rows(case.solve())[2:]:
        assert row.pressure < 0.7
        assert abs(row.error) < 0.8
        assert abs(row.lost) < 0.6


def test_small_strain_is_the_limit():
    small = 1e-3 * case.WEIGHT
    run = case.solve(10, first=5e-3, growth=0.3, most=0.1, last=0.6, weight=small)
    chosen = np.array(run.T) > 0.2
    exact = case.small_strain(np.array(run.T), small)
    np.testing.assert_allclose(np.array(run.settlement)[chosen], exact[chosen], rtol=0.04)
