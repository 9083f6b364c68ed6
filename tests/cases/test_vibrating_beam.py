"""The vibrating beam: Timoshenko's theory, finite elements, and the MPM."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from cases.verification.vibrating_beam import beam, fem, figures, mpm
from tawami.motion.dynamics import TRANSFERS


@pytest.fixture(scope="module")
def periods():
    return {nu: 2 * np.pi / fem.solve(nu, 16).omega[0] for nu in beam.NUS}


@pytest.mark.parametrize("nu", beam.NUS)
def test_the_mode_is_that_of_a_cantilever(nu):
    x = np.linspace(0, beam.L, 2001)
    w, phi, dw, dphi = beam.mode(nu, x)
    assert (w[0], phi[0], w[-1]) == pytest.approx((0, 0, 1), abs=1e-12)
    assert np.gradient(w, x, edge_order=2) == pytest.approx(dw, abs=1e-6)
    assert np.gradient(phi, x, edge_order=2) == pytest.approx(dphi, abs=1e-6)
    assert (dphi[-1], dw[-1] - phi[-1]) == pytest.approx((0, 0), abs=1e-9)  # moment and shear
    # Rayleigh's quotient, E bar and kappa G of plane strain written out independently
    K, mu = beam.lame(nu)
    bending = 4 * mu * (K + mu / 3) / (K + 4 / 3 * mu) * beam.D**3 / 12
    elastic = bending * dphi**2 + 5 / (6 - nu) * mu * beam.D * (dw - phi) ** 2
    moving = beam.RHO * beam.D * (w**2 + beam.D**2 / 12 * phi**2)
    assert np.sqrt(elastic.mean() / moving.mean()) == pytest.approx(
        beam.first_bending(nu), rel=2e-3
    )


def test_timoshenko_agrees_with_finite_elements(periods):
    for nu, tolerance in ((0.3, 0.004), (0.49, 0.015)):
        assert periods[nu] == pytest.approx(2 * np.pi / beam.first_bending(nu), rel=tolerance)
        assert fem.solve(nu, 4).share[0] > 0.9999


@pytest.fixture(scope="module")
def runs():
    return {nu: mpm.solve(nu) for nu in beam.NUS}


@pytest.mark.slow
@pytest.mark.parametrize(("nu", "tolerance"), [(0.3, 0.005), (0.49, 0.01)])
def test_the_period_agrees_with_finite_elements(runs, periods, nu, tolerance):
    """Less the known errors of rule and quadrature: half a per cent, one per cent near nu = 0.5."""
    run = runs[nu]
    error = run.period / periods[nu] - 1
    assert 0 < error - run.expected < tolerance
    assert run.period == pytest.approx(2 * np.pi / beam.first_bending(nu), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("nu", beam.NUS)
def test_affine_flip_keeps_the_energy_of_five_periods(runs, nu):
    run = runs[nu]
    assert len(run.passages) == 10
    assert run.crossed > 0.2
    assert run.energy[-1] > 0.999
    assert run.energy.max() <= 1
    # straight again, twice a period: less each time
    straight = np.interp(run.passages, run.time, run.energy)
    assert all(later < earlier for earlier, later in pairwise(straight))
    assert max(np.abs(run.deflection)) == pytest.approx(beam.AMPLITUDE, rel=0.02)


@pytest.mark.parametrize(
    ("transfer", "least", "most"),
    [("affine_flip", 0.999, 1.0), ("tpic", 0.999, 1.0), ("flip", 0.98, 0.995), ("pic", 0.8, 0.95)],
)
def test_the_energy_after_one_period(transfer, least, most):
    run = mpm.solve(0.3, transfer=transfer, steps=25, periods=1)
    assert least < run.energy[-1] < most
    assert run.energy.max() <= 1


@pytest.mark.slow
def test_the_error_of_the_period_is_of_second_order(runs, periods):
    coarse, fine = mpm.solve(0.3, n=2, periods=1), runs[0.3]
    of_rule = (2 * np.pi / 50) ** 2 / 12
    errors = [run.period / periods[0.3] - 1 - of_rule for run in (coarse, fine)]
    assert errors[1] < 0.3 * errors[0]


@pytest.mark.slow
def test_the_figure_shows_every_transfer(runs, periods, tmp_path):
    all_of_them = [replace(runs[nu], transfer=name) for nu in beam.NUS for name in TRANSFERS]
    figures.motion(all_of_them, periods, tmp_path / "motion.png")
    assert (tmp_path / "motion.png").stat().st_size > 10_000
