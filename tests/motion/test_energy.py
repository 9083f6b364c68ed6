"""A warning of spurious energy."""

from __future__ import annotations

import warnings

import tawami
from tawami.motion.energy import Energies, Growth


def test_spurious_energy_gives_one_warning():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        growth = Growth(1.0)
        for has in (1.0, 1.04, 1.2, 1.3):
            growth.check(Energies(kinetic=has), 3, 0.1)
        given = Growth(1.0)
        given.add(0.3)
        given.check(Energies(kinetic=1.2, elastic=0.5, external=0.4), 3, 0.1)
    assert [w.category for w in caught] == [tawami.EnergyWarning]
    assert "after 3 steps, at 0.1 s, the body has 0.2 J/m more energy" in str(caught[0].message)
