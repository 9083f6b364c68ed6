"""The circular footing on Tresca clay: limit pressures of Shield and of Eason and Shield."""

from __future__ import annotations

import pytest

import tawami
from cases.verification import circular_footing as case


@pytest.mark.parametrize("base", [pytest.param("smooth", marks=pytest.mark.slow), "rough"])
def test_the_pressure_reaches_a_plateau_and_converges(base):
    runs = [case.solve(base, n) for n in (2, 4)]
    case.extrapolate(runs)
    assert runs[1].growth < 0.2
    assert runs[1].error == pytest.approx(runs[0].error / 2, rel=0.2)
    assert runs[1].extrapolated == pytest.approx(case.EXACT[base], rel=0.07)


@pytest.mark.slow
@pytest.mark.parametrize("base", case.EXACT)
def test_the_plateau_is_that_of_the_limit_theorems(base):
    """5.68 for a smooth and 6.06 for a rough base."""
    runs = [case.solve(base, n) for n in (4, 8)]
    case.extrapolate(runs)
    assert runs[1].growth < 0.1
    assert runs[1].extrapolated == pytest.approx(case.EXACT[base], rel=0.005)


@pytest.mark.slow
def test_displacement_alone_locks():
    with pytest.warns(tawami.LockingWarning):
        assert case.solve("rough", 2, form="u").error > 200
