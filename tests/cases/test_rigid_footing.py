"""A rigid footing under a force, and pushed sideways."""

from __future__ import annotations

import numpy as np
import pytest

from cases.verification import rigid_footing

pytestmark = [
    pytest.mark.filterwarnings("ignore::tawami.base.errors.IncompleteWarning"),
    pytest.mark.filterwarnings("ignore::tawami.base.errors.SmallStrainWarning"),
    # the last steps before the limit load move the footing by metres
    pytest.mark.filterwarnings("ignore::tawami.base.errors.SupportWarning"),
]


def test_greens_forces_end_at_those_of_prandtl_and_of_sliding():
    assert rigid_footing.greens(2 + np.pi) == pytest.approx(0.0, abs=1e-6)
    assert rigid_footing.greens(1 + np.pi / 2) == pytest.approx(1.0)


@pytest.mark.parametrize("base", ["rough", "smooth"])
def test_a_force_beyond_the_limit_load_is_not_reached(base):
    run = rigid_footing.pressed(base, 4)
    assert 0 < run.error < 6


@pytest.mark.slow
@pytest.mark.parametrize("base", ["rough", "smooth"])
def test_the_limit_load_of_a_footing_under_a_force(base):
    run = rigid_footing.pressed(base, 16)
    assert 0 < run.error < 2.5


@pytest.mark.slow
def test_a_footing_that_is_pushed_sideways_gives_way_at_the_force_of_green():
    """Errors at B/h = 4, 8, 16: 47, 29 and 17 %, which is of first order; 5 % extrapolated."""
    coarse, fine, finest = (rigid_footing.pushed(cells) for cells in (4, 8, 16))
    assert coarse.error > fine.error > finest.error > 0
    assert finest.error < 20
    exact = finest.exact
    assert rigid_footing.extrapolated(fine, finest) == pytest.approx(exact, rel=0.06)
