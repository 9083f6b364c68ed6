"""A pile with a round tip in clay: the mixed form does not lock."""

from __future__ import annotations

import pytest

from cases.verification import penetration


@pytest.mark.slow
def test_displacement_alone_locks():
    """Mixed, B-bar and displacement alone: 8.5, 1.1 and 51 % above the cylinder at w = B/4."""
    errors = {form: penetration.solve(form, w=0.26).error for form in penetration.FORMS}
    assert abs(errors["u_epsv_finite"]) < 10
    assert abs(errors["u_bbar_finite"]) < 10
    assert errors["u_finite"] > 40


def test_the_mixed_form_comes_near_the_force_of_a_cylinder():
    run = penetration.solve("u_epsv_finite", w=0.12, step=0.04)
    assert not run.stopped
    assert run.force[-1] == pytest.approx(penetration.cylinder(run.depth), rel=0.1)
    assert run.penetration < 1e-6


@pytest.mark.slow
def test_a_pile_goes_as_deep_as_it_is_wide():
    run = penetration.solve("u_epsv_finite", w=1.0)
    assert not run.stopped
    assert run.penetration < 0.01
    deep = run.w > 0.2
    assert run.force[deep] == pytest.approx(penetration.cylinder(run.w[deep]), rel=0.2)
