"""Long rotation: no energy from nothing, and a warning where a stiff body turns too far in a step."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import tawami
from cases.extremes.rotation import SPIN, turning

FORM = "u_epsv_finite"


def turned(motion, turns, steps):
    for _ in range(round(turns * steps)):
        motion.step(2 * np.pi / SPIN / steps)
    return motion


@pytest.mark.parametrize(("nu", "steps"), [(0.3, 40), (0.45, 40), (0.49, 80), (0.4999, 80)])
def test_a_turning_block_gains_no_energy(nu, steps):
    motion = turning(FORM, nu)
    start = motion.kinetic_energy
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("default", tawami.SolverWarning)
        turned(motion, 2, steps)
    assert motion.elastic_energy < 5e-4 * start
    assert motion.kinetic_energy < start
    # what the projection of the mean stress takes is booked
    assert abs(motion.energies.integration) < 0.02 * start


def test_a_stiff_block_warns_once_of_long_steps_and_the_advice_works():
    motion = turning(FORM, 0.49)
    with pytest.warns(tawami.RotationWarning, match=r"turns by 0\.16 rad in a step") as caught:
        turned(motion, 0.1, 40)
    assert len([w for w in caught if w.category is tawami.RotationWarning]) == 1
    message = str(caught[0].message)
    dt = float(message.split("dt = ")[1].split(" s")[0])
    motion = turning(FORM, 0.49)
    start = motion.kinetic_energy
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        turned(motion, 2, int(np.ceil(2 * np.pi / SPIN / dt)))
    assert motion.elastic_energy < 5e-4 * start


def test_without_the_advice_the_block_gains_energy():
    motion = turning(FORM, 0.49)
    start = motion.kinetic_energy
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(tawami.ConvergenceError):
            turned(motion, 2, 40)
    assert motion.kinetic_energy + motion.elastic_energy > 1.1 * start


@pytest.mark.slow
@pytest.mark.parametrize(("per_axis", "bound"), [(2, 3e-3), (3, 1.5e-3)])
def test_a_hundred_turns(per_axis, bound):
    """Elastic energy at the end: physical is 4.5e-4 of the initial kinetic energy."""
    motion = turning(FORM, 0.3, per_axis)
    start = motion.kinetic_energy
    turned(motion, 100, 40)
    print(
        f"{per_axis} x {per_axis} particles: elastic / kinetic {motion.elastic_energy / start:.2e}"
    )
    assert motion.elastic_energy < bound * start
