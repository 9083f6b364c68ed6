"""The footing on clay, on a coarse grid: a plateau for the mixed form, locking without it."""

from __future__ import annotations

import numpy as np
import pytest

from cases.verification import footing


@pytest.fixture(scope="module")
def runs():
    return {form: footing.solve(form, n=2) for form in ("u_epsv", "u_bbar", "u")}


def test_the_mixed_form_reaches_a_plateau_above_prandtl(runs):
    for form in ("u_epsv", "u_bbar"):
        assert runs[form].growth < 0.1
        # the footing is wider than meant by part of a cell, and has two cells
        assert 25 < runs[form].error < 40


@pytest.mark.slow
def test_the_error_of_the_plateau_is_linear_in_the_size_of_the_cells(runs):
    finer = footing.solve(n=4)
    assert finer.stopped == ""
    assert finer.growth < 0.1
    assert finer.error == pytest.approx(runs["u_epsv"].error / 2, rel=0.1)


def test_displacement_alone_locks(runs):
    assert runs["u"].growth > 1.0
    assert runs["u"].error > 3 * runs["u_epsv"].error
    bilinear = footing.solve("u", n=2, basis="bilinear")
    assert bilinear.error > 1000
    assert bilinear.growth > 25


def test_tresca_and_another_compressibility_reach_the_plateau_of_von_mises(runs):
    tresca = footing.solve(n=2, law="tresca")
    incompressible = footing.solve(n=2, nu=0.4999)
    assert tresca.last == pytest.approx(runs["u_epsv"].last, rel=0.02)
    assert incompressible.last == pytest.approx(runs["u_epsv"].last, rel=1e-3)
    assert np.diff(tresca.q).min() > -1e-3


def test_as_many_held_points_as_functions_equal_a_held_edge(runs):
    points = footing.solve(n=2, footing="greville")
    assert points.q == pytest.approx(runs["u_epsv"].q, rel=1e-6)
    assert points.uneven < 1e-10
    centres = footing.solve(n=2, footing="centres", step=0.1)
    assert centres.uneven > 0.5
    assert centres.last < footing.PRANDTL


def test_the_first_step_is_elastic():
    """Half the settlement of a step, half the force: nothing has yielded yet."""
    run = footing.Run("u_epsv", "von_mises", "quadratic_spline", "edge", 2, 0.499, 0.1, 2)
    forces = [footing.build(run, s).solve().reaction("top")[1] for s in (0.06, 0.12)]
    assert forces[1] == pytest.approx(2 * forces[0], rel=1e-6)
