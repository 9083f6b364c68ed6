"""The collapse of the pile: its start, and its first tenth of a second."""

from __future__ import annotations

import numpy as np
import pytest

from cases.showcase.collapse import pile, runout


@pytest.fixture(scope="module")
def runs():
    return {form: pile.solve(form, end=0.1) for form in pile.FORMS}


def test_the_first_steps_converge_at_their_first_size():
    run = pile.solve("u_epsv_finite", end=0.02)
    assert run.dt == pytest.approx([1e-3] * 20)
    assert max(run.iterations) <= 5


@pytest.mark.slow
def test_every_step_converges_at_its_first_size(runs):
    run = runs["u_epsv_finite"]
    assert len(run.dt) == 100
    assert run.dt == pytest.approx([1e-3] * 100)
    assert np.mean(run.iterations) <= 3.5
    assert max(run.iterations) <= 5


@pytest.mark.slow
def test_the_mean_stress_is_smoother_than_that_of_displacement_alone(runs):
    mixed, displacement = (
        np.median(runs[form].roughness[1:]) for form in ("u_epsv_finite", "u_finite")
    )
    assert 2 * mixed < displacement


@pytest.mark.slow
def test_energy_is_dissipated_and_the_pile_runs_out(runs):
    for run in runs.values():
        lost = [e.dissipated + e.transfer + e.impact + e.integration for e in run.energies]
        assert (np.diff(lost) > 0).all()
        e = run.energies[-1]
        assert e.external == pytest.approx(
            -2040 * 9.81 * run.volume @ (run.x[-1] - run.x[0])[:, 1], rel=1e-6
        )
        assert e.dissipated > 0.5 * (e.external - e.kinetic)
        assert (np.diff(run.runout) > 0).all()
        # the code's own number, the same for both forms
        assert run.runout[-1] == pytest.approx(0.224, abs=0.003)


@pytest.mark.slow
def test_the_runout_depends_little_on_the_step_size(runs):
    fine = pile.solve("u_epsv_finite", end=0.1, dt=5e-4, every=40)
    assert fine.runout[-1] == pytest.approx(runs["u_epsv_finite"].runout[-1], rel=0.02)


def test_the_initial_state_is_that_of_the_pile():
    motion = pile.build("u_epsv_finite")
    scene = motion.scene
    assert len(scene.particles) == 800
    assert motion.mass.sum() == pytest.approx(2040 * 0.2 * 0.1)
    stress, y = scene.particles.stress, scene.particles.x[:, 1]
    assert stress[:, 1] == pytest.approx(-2040 * 9.81 * (0.1 - y))
    assert stress[:, 0] == pytest.approx(0.5 * stress[:, 1])
    assert stress[:, 2] == pytest.approx(0.75 * stress[:, 1])


def test_a_chequerboard_is_rough_and_a_plane_is_not():
    x = np.stack(np.meshgrid(np.arange(20), np.arange(20)), axis=-1).reshape(-1, 2) * 0.5
    assert pile.roughness(x, 3.0 + x @ [1.0, -2.0], 1.0) < 1e-12
    board = (-1.0) ** (2 * x).sum(axis=1)
    assert pile.roughness(x, board, 1.0) > 0.5


@pytest.mark.slow
def test_a_higher_pile_runs_out_farther():
    """On a coarse grid: nearly in proportion to height over length where that is small."""
    piles = [runout.runout(a, 8, end=3.0) for a in (0.5, 1.0)]
    slope = np.log(piles[1].spread / piles[0].spread) / np.log(2)
    assert 0.8 < slope < 1.8
    low, high = runout.exponents([runout.Runout(a, 2 * a**0.9) for a in (0.5, 1.5, 4.0)])
    assert (low, high) == pytest.approx((0.9, 0.9))


@pytest.mark.parametrize("end", [0.01, pytest.param(0.1, marks=pytest.mark.slow)])
def test_a_dilatant_and_nearly_incompressible_pile_collapses(end):
    run = pile.solve("u_epsv_finite", end=end, nu=0.4999, psi=5.0)
    assert run.time[-1] == pytest.approx(end)
    assert np.mean(run.iterations) < 12
