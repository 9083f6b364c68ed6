"""A pile with a round tip in clay and in sand: the mixed form does not lock."""

from __future__ import annotations

import numpy as np
import pytest

from cases.verification import penetration


def test_the_pressure_of_a_cavity_without_friction_is_that_of_clay():
    """p - p0 = s_u (1 + ln(mu/s_u)) at constant volume: Hill (1950)."""
    p = penetration.cavity(1e-6, 0.0, 1.0, 100.0, 0.499999, 0.0)
    assert p == pytest.approx(1 + np.log(100.0), rel=1e-3)


@pytest.mark.slow
def test_displacement_alone_locks_in_clay():
    """Mixed, B-bar and displacement alone: 8.5, 1.1 and 51 % above the cylinder at w = B/4."""
    errors = {form: penetration.solve("clay", form, w=0.26).smooth for form in penetration.FORMS}
    assert abs(errors["u_epsv_finite"]) < 10
    assert abs(errors["u_bbar_finite"]) < 10
    assert errors["u_finite"] > 40


def test_the_mixed_form_comes_near_the_force_of_a_cylinder():
    run = penetration.solve("clay", "u_epsv_finite", w=0.12, step=0.04)
    assert not run.stopped
    assert run.force[-1] == pytest.approx(penetration.cylinder(run.depth), rel=0.1)
    assert run.penetration < 1e-6


def test_the_force_in_sand_is_between_those_of_a_cavity_and_of_a_footing():
    run = penetration.solve("sand", "u_epsv_finite", w=0.12, step=0.04)
    assert not run.stopped
    low, high = (exact(run.depth, "sand") for exact in (penetration.smooth, penetration.footing))
    assert low < run.force[-1] < high


@pytest.mark.slow
def test_a_pile_goes_as_deep_into_clay_as_it_is_wide():
    run = penetration.solve("clay", "u_epsv_finite")
    assert not run.stopped
    assert run.penetration < 0.01
    deep = run.w > 0.2
    assert run.force[deep] == pytest.approx(penetration.cylinder(run.w[deep]), rel=0.2)


@pytest.mark.slow
def test_a_pile_goes_as_deep_into_sand_as_it_is_wide():
    """All forms, with four cells over B: they agree within 6 %, as sand does not lock at nu = 0.3."""
    runs = {form: penetration.solve("sand", form) for form in penetration.FORMS}
    for run in runs.values():
        assert not run.stopped
        assert run.penetration < 0.01
        deep = run.w > 0.1
        assert (run.force[deep] > penetration.smooth(run.w[deep], "sand")).all()
        assert (run.force[deep] < penetration.footing(run.w[deep], "sand")).all()
        assert run.q == pytest.approx(runs["u_epsv_finite"].q, rel=0.08)
