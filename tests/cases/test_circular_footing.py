"""The circular footing on Tresca clay: limit pressures of Shield and of Eason and Shield."""

from __future__ import annotations

import pytest

import tawami
from cases.verification import circular_footing as case


@pytest.mark.parametrize("base", [pytest.param("smooth", marks=pytest.mark.slow), "rough"])
def test_the_pressure_reaches_a_plateau_and_converges(base):
    runs = [case.solve(base, n) for n in (2, 4)]
    assert runs[1].growth < 0.2
    assert 0 < runs[1].error < runs[0].error / 1.8
    assert runs[1].error < 4


@pytest.mark.slow
@pytest.mark.parametrize("base", case.EXACT)
def test_the_plateau_is_that_of_the_limit_theorems(base):
    """With 8 cells over the radius: 5.80 for a smooth and 6.14 for a rough base."""
    run = case.solve(base, 8)
    assert run.growth < 0.1
    assert run.last == pytest.approx(case.EXACT[base], rel=0.025)


@pytest.mark.slow
def test_displacement_alone_locks():
    with pytest.warns(tawami.LockingWarning):
        assert case.solve("rough", 2, form="u").error > 100
