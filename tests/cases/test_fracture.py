"""Phase-field fracture: a bar in closed form, and the fracture energy of a notched strip."""

from __future__ import annotations

import pytest

from cases.verification import fracture as case


@pytest.mark.direct  # the bar softens: round-off of an iterative solver grows to a band of damage
def test_the_bar_has_the_damage_and_the_stress_of_the_closed_form():
    """Also when it is unloaded: then d stays, and the stress is (1 - d)^2 E e."""
    for state in case.bar():
        assert state.d == pytest.approx(state.d_exact, rel=1e-6)
        assert state.stress == pytest.approx(state.stress_exact, rel=1e-6)


@pytest.mark.slow
def test_the_fracture_energy_of_a_strip():
    run = case.strip()
    assert run.fracture_energy == pytest.approx(run.expected, rel=0.05)
