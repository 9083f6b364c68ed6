"""Forces of contact: derivatives, Coulomb's law, balance, frames."""

from __future__ import annotations

import numpy as np
import pytest
from border.contacts import SHAPES, contact, line, rough

from tawami.border.contact import OPEN, SLIDING, STICKING, Multipliers
from tawami.border.rigid import Pose

POINTS = line((-0.7, 0.02), (0.7, 0.0), 6)


def loaded(name, friction, *, multipliers=False, sticking=False, slip=0.02):
    """A contact, and its evaluation after the points and the obstacle have moved."""
    one = contact(SHAPES[name], POINTS, friction)
    pose = Pose.at(SHAPES[name].centre).moved(np.array([0.01, 0.02, 0.05]))
    x = POINTS.x + rough(POINTS) + [slip, -0.01]
    held = Multipliers.zero(one.patches.count, 2)
    if multipliers:
        count = one.patches.count
        held = Multipliers(np.linspace(5.0, 20.0, count), np.linspace(-3.0, 4.0, count)[:, None])
    return one, x, pose, held, one.evaluate(x, pose, held, sticking=sticking)


def differences(function, size, step=1e-6):
    """Derivative of a function of a vector by central differences."""
    moves = step * np.eye(size)
    return np.stack([(function(m) - function(-m)).ravel() / (2 * step) for m in moves], axis=1)


@pytest.mark.parametrize("multipliers", [False, True])
@pytest.mark.parametrize("friction", [0.0, 0.3, np.inf])
@pytest.mark.parametrize("name", SHAPES)
def test_derivatives_are_those_of_the_forces(name, friction, multipliers):
    one, x, pose, held, now = loaded(name, friction, multipliers=multipliers, slip=0.06)
    assert (now.state == (STICKING if friction == np.inf else SLIDING)).sum() >= 2

    def at(change):
        return one.evaluate(x + change.reshape(x.shape), pose, held)

    def moved(change):
        return one.evaluate(x, pose.moved(change), held)

    scale = np.abs(now.derivative).max()
    pairs = [
        (now.derivative.toarray(), differences(lambda d: at(d).forces, x.size)),
        (now.by_motion, differences(lambda d: moved(d).forces, 3)),
        (now.resultant_by_positions, differences(lambda d: at(d).resultant, x.size)),
        (now.resultant_by_motion, differences(lambda d: moved(d).resultant, 3)),
    ]
    for exact, numeric in pairs:
        assert np.abs(exact - numeric).max() < 1e-5 * scale


@pytest.mark.parametrize("name", SHAPES)
def test_the_derivative_is_symmetric_without_friction(name):
    derivative = loaded(name, 0.0)[-1].derivative.toarray()
    assert np.abs(derivative).max() > 1
    assert derivative == pytest.approx(derivative.T, abs=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.3, 5.0, np.inf])
@pytest.mark.parametrize("name", SHAPES)
def test_friction_is_in_the_cone_and_dissipates(name, friction):
    *_, now = loaded(name, friction, multipliers=True)
    sliding = now.state == SLIDING
    size = np.abs(now.traction[:, 0])
    if friction < np.inf:
        assert (size <= friction * now.pressure * (1 + 1e-12)).all()
        assert size[sliding] == pytest.approx(friction * now.pressure[sliding])
    else:
        assert not sliding.any()
    assert (now.traction[now.state == OPEN] == 0).all()
    assert (now.dissipation >= 0).all()
    assert (now.dissipation[sliding] > 0).any() == (0 < friction < np.inf and sliding.any())


def test_sliding_works_against_the_friction():
    now = loaded("half plane", 0.3, slip=0.3)[-1]
    sliding = now.state == SLIDING
    power = now.traction[:, 0] * now.slip[:, 0]
    assert sliding.any()
    assert (power[sliding] < 0).all()


def test_all_touching_patches_stick_if_asked_to():
    assert SLIDING in loaded("half plane", 0.3, slip=0.3)[-1].state
    assert SLIDING not in loaded("half plane", 0.3, slip=0.3, sticking=True)[-1].state
    smooth = loaded("half plane", 0.0, slip=0.3, sticking=True)[-1]
    assert STICKING not in smooth.state
    assert (smooth.traction == 0).all()


def test_a_smooth_obstacle_without_slip_has_no_stiffness_along_it():
    one = contact(SHAPES["half plane"], POINTS, 0.0)
    pose = Pose.at(SHAPES["half plane"].centre)
    now = one.evaluate(POINTS.x, pose, Multipliers(np.ones(one.patches.count), np.zeros((7, 1))))
    along = np.tile(SHAPES["half plane"].normal[::-1] * [1, -1], len(POINTS))
    assert np.abs(now.derivative).max() > 1
    assert now.derivative @ along == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", SHAPES)
def test_the_obstacle_carries_the_opposite_forces(name):
    _, x, pose, _, now = loaded(name, 0.3)
    force = now.forces.sum(axis=0)
    lever = x - pose.position
    moment = np.sum(lever[:, 0] * now.forces[:, 1] - lever[:, 1] * now.forces[:, 0])
    assert np.abs(force).max() > 0.1
    assert now.resultant == pytest.approx([-force[0], -force[1], -moment])


@pytest.mark.parametrize("name", SHAPES)
def test_rigid_motions_of_both_turn_the_forces(name):
    one, x, pose, held, now = loaded(name, 0.3, multipliers=True)
    turn = Pose.at(pose.position).moved(np.array([3.0, -2.0, 1.1]))
    turned = one.evaluate(turn.to_global(x), pose.moved(turn.coordinates), held)
    assert turned.forces == pytest.approx(now.forces @ turn.rotation.T, abs=1e-7)
    assert turned.pressure == pytest.approx(now.pressure, rel=1e-6, abs=1e-7)
    assert turned.slip == pytest.approx(now.slip, abs=1e-9)
    # no slip between a body and an obstacle that move together
    rest = contact(SHAPES[name], POINTS, 0.3)
    start = Pose.at(SHAPES[name].centre)
    carried = start.moved(np.array([3.0, -2.0, 1.1]))
    together = rest.evaluate(carried.to_global(POINTS.x), carried, held)
    assert together.slip == pytest.approx(0.0, abs=1e-12)
