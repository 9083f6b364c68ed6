"""The footing on clay, on a coarse grid: a plateau for the mixed form, locking without it."""

from __future__ import annotations

import numpy as np
import pytest

from cases.verification import footing


@pytest.fixture(scope="module")
def runs():
    return {form: footing.solve(form, n=2) for form in ("u_epsv", "u_bbar", "u")}


def test_the_plateau_is_prandtls(runs):
    for form in ("u_epsv", "u_bbar"):
        assert runs[form].growth < 0.1
        assert abs(runs[form].error) < 3


@pytest.mark.slow
@pytest.mark.parametrize("base", ["rough", "smooth"])
def test_a_footing_of_exact_width_reaches_the_plateau_on_tresca(base):
    """B/h = 4, 8, 16: 4.3, 3.0, 1.6 % with a rough and 2.6, 1.9, 1.0 % with a smooth base."""
    errors = [footing.solve(n=n, law="tresca", footing=base).error for n in (2, 4, 8)]
    assert errors == sorted(errors, reverse=True)
    assert 0 < errors[2] < 2.5


def test_displacement_alone_locks(runs):
    assert runs["u"].growth > 1.0
    assert runs["u"].error > 40
    bilinear = footing.solve("u", n=2, basis="bilinear")
    assert bilinear.error > 1000
    assert bilinear.growth > 25


def test_tresca_and_another_compressibility_reach_the_plateau_of_von_mises(runs):
    tresca = footing.solve(n=2, law="tresca")
    incompressible = footing.solve(n=2, nu=0.4999)
    assert tresca.last == pytest.approx(runs["u_epsv"].last, rel=0.03)
    assert incompressible.last == pytest.approx(runs["u_epsv"].last, rel=1e-3)
    assert np.diff(tresca.q).min() > -1e-3


def test_as_many_held_points_as_functions_widen_the_footing():
    points = footing.solve(n=2, footing="greville")
    assert 25 < points.error < 40
    assert points.uneven < 1e-10
    centres = footing.solve(n=2, footing="centres", step=0.1)
    assert centres.uneven > 0.5
    assert centres.last < footing.PRANDTL


def test_the_first_step_is_elastic():
    """Half the settlement of a step, half the force: nothing has yielded yet."""
    run = footing.Run("u_epsv", "von_mises", "quadratic_spline", "rough", 2, 0.499, 0.1, 2)
    forces = [footing.build(run, s).solve().reaction("top")[1] for s in (0.06, 0.12)]
    assert forces[1] == pytest.approx(2 * forces[0], rel=1e-6)
