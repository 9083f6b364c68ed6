"""The spinning disc on a coarse grid: what is conserved."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import tawami
from cases.verification.spinning_disc import disc
from cases.verification.spinning_disc.disc import KINDS, OMEGA, RHO, R

AFFINE_FLIP, TPIC, DISPLACEMENT, FLIP = KINDS


def test_the_rings_have_volume_and_moments_of_the_disc():
    body = disc.rings(7)
    assert len(body.x) == 3 * 7**2
    assert body.volume == pytest.approx(np.full(147, np.pi * R**2 / 147))
    assert np.abs(body.volume @ body.x).max() < 1e-14
    moments = np.einsum("p,pi,pj->ij", body.volume, body.x, body.x)
    assert moments == pytest.approx(np.pi * R**4 / 4 * np.eye(2), abs=1e-14)


def test_the_closed_form_obeys_the_virial_theorem():
    """The integral of sigma_r + sigma_t is that of rho omega^2 r^2, for every nu."""
    r = np.linspace(0, R, 2001)
    for nu in (0.0, 0.3, 0.499):
        stress = 3 / (1 + nu) * disc.mean_stress(r, nu)
        integral = np.trapezoid if hasattr(np, "trapezoid") else np.trapz
        assert integral(2 * np.pi * r * stress, r) == pytest.approx(
            np.pi / 2 * RHO * OMEGA**2 * R**4, rel=1e-6
        )


@pytest.mark.direct  # round-off
@pytest.mark.parametrize(
    ("kind", "nu"),
    [
        (AFFINE_FLIP, 0.49),
        pytest.param(AFFINE_FLIP, 0.499, marks=pytest.mark.slow),
        pytest.param(TPIC, 0.49, marks=pytest.mark.slow),
        pytest.param(DISPLACEMENT, 0.49, marks=pytest.mark.slow),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_momentum_energy_and_shape_are_conserved(kind, nu):
    run = disc.solve(kind, n=4, turns=1, nu=nu)
    assert max(run.linear) < 1e-13
    assert run.drift < 1e-3
    assert run.drift_of_transfer < 1e-4
    assert min(run.energy) > 0.995
    assert max(run.energy) < 1 + 1e-9
    assert max(run.roundness) < 2e-4


@pytest.mark.slow
def test_plain_flip_loses_angular_momentum():
    run = disc.solve(FLIP, n=4, turns=1)
    assert max(run.linear) < 1e-13
    assert run.angular[-1] < 0.95


@pytest.fixture(scope="module")
def coarse_steps():
    with warnings.catch_warnings():  # as much as the disc turns in a step
        warnings.simplefilter("ignore", tawami.RotationWarning)
        return disc.solve(n=4, turns=1, steps=60)


def test_the_loss_of_the_trapezoidal_rule_is_known(coarse_steps):
    """Up to twice (omega dt)^2/4 while the disc pulsates; the transfer takes little."""
    taken = (2 * np.pi / 60) ** 2 / 4
    assert 1.7 * taken < coarse_steps.drift < 2 * taken
    assert coarse_steps.drift_of_transfer < 0.05 * taken


def test_the_mean_stress_averaged_over_a_turn_is_accurate(coarse_steps):
    assert coarse_steps.stress_error[0] < 0.08


@pytest.mark.slow
def test_the_mean_stress_stays_accurate_for_ten_turns():
    """Measured: 2.4 to 2.8 %; without the projection of the mean stress 11 % in the tenth turn."""
    assert max(disc.solve(turns=10).stress_error) < 0.035
