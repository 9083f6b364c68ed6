"""A ring under internal pressure: Lame's and Rivlin's solutions, anywhere on the grid."""

from __future__ import annotations

from itertools import pairwise

import pytest

from cases.verification import ring


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.37, 0.61)])
@pytest.mark.parametrize("gauss", [False, True])
def test_a_ring_at_small_strain(shift, gauss):
    found = ring.small(8, shift, gauss=gauss)
    assert abs(found.radius) < 0.01
    assert found.rms < 0.08
    assert found.largest < 1.0


def test_a_ring_at_large_strain():
    found = ring.large(4, steps=5)
    assert abs(found.radius) < 0.5
    assert found.rms < 2.5
    assert found.largest < 16


@pytest.mark.slow
@pytest.mark.parametrize("shift", ring.SHIFTS)
@pytest.mark.parametrize("gauss", [False, True])
def test_rings_of_sixteen_cells_per_metre(shift, gauss):
    found = ring.small(16, shift, gauss=gauss)
    assert abs(found.radius) < 0.05
    assert found.rms < 0.05
    assert found.largest < 2.0


@pytest.mark.slow
def test_the_stress_at_large_strain_converges():
    rings = [ring.large(n) for n in (4, 8, 16)]
    assert all(abs(one.radius) < 0.5 for one in rings)
    assert all(fine.rms < 0.7 * coarse.rms for coarse, fine in pairwise(rings))
    own = ring.large(8, volumes="own")
    assert own.rms > 2 * rings[1].rms  # without fitting it does not converge


@pytest.mark.slow
@pytest.mark.parametrize("shift", ring.SHIFTS[:2])
@pytest.mark.parametrize(("volumes", "rms", "largest"), [("own", 3.5, 30.0), ("fitted", 0.6, 8.0)])
def test_rings_at_large_strain_lie_anywhere(shift, volumes, rms, largest):
    """rms 2.9 and 2.8 % with the default, own volumes, .5 and .4 % with fitted ones."""
    found = ring.large(16, shift, volumes=volumes)
    assert abs(found.radius) < 0.5
    assert found.rms < rms
    assert found.largest < largest


@pytest.mark.slow
def test_the_noise_at_large_strain_does_not_grow_with_the_steps():
    """Fitted volumes, 5 to 40 steps: 1.7 to 2.1 %. Own ones: 2.9 %, 3.9 % after 40 steps."""
    few, many = (ring.large(4, steps=steps).rms for steps in (10, 40))
    assert many < 1.2 * few
