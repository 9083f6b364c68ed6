"""The heated wall against Fourier's series, and creep against the exponential."""

from __future__ import annotations

import pytest

from cases.verification import creep, heated_wall


def test_the_heated_wall():
    for state in heated_wall.solve(n=10, steps=50):
        assert state.theta_error < 0.9
        assert state.stress_error < 0.9
        assert state.normal < 1e-5
        assert abs(state.moved_error) < 1.5


def test_creep_and_recovery():
    """Backward Euler to round-off, and an error that is linear in the step."""
    runs = [creep.solve(steps) for steps in (10, 20)]
    assert [run.from_euler for run in runs] == pytest.approx([0.0, 0.0], abs=1e-10)
    assert runs[0].error / runs[1].error == pytest.approx(2, rel=0.05)
    assert runs[1].strains[-1] == pytest.approx(creep.exact(creep.END), abs=0.02)
