"""Bodies on an inclined plane with friction, compared with rigid bodies."""

from __future__ import annotations

import numpy as np
import pytest

from cases.verification import rolling


def test_a_disc_rolls_down_a_plane():
    run = rolling.solve("rolls", 5)
    assert abs(run.error) < 3
    assert run.growth < 0.1
    assert run.iterations <= 10


@pytest.mark.slow
def test_a_fine_disc_rolls_down_a_plane():
    runs = [rolling.solve("rolls", n) for n in (10, 20)]
    assert max(abs(run.error) for run in runs) < 1
    assert max(run.growth for run in runs) < 0.1


def test_a_block_slides_down_a_plane():
    run = rolling.solve("slides", 2, 0.2)
    assert abs(run.error) < 0.5
    assert run.growth == 0


def test_a_block_sticks_to_a_plane():
    scene, plane = rolling.block_on_incline(np.radians(25.0), 0.7)
    rolling.tawami.Dynamics(scene).run(0.06, 0.02)
    assert not np.any(plane.velocity)
    assert abs(rolling.solve("sticks", 2).error) < 0.5
