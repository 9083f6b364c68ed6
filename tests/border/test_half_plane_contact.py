"""A rigid disc on an elastic half-plane: Hertz (1882), Cattaneo (1938), Mindlin (1949).

The half-plane is its matrix of compliance, plane strain, from displacements under uniform tractions
(Johnson 1985, eq. 2.30). At nu = 1/2 pressure and friction do not influence each other's displacements.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tawami.border.contact import STICKING, Contact, Multipliers
from tawami.border.patches import patches
from tawami.border.points import BorderPoints
from tawami.border.rigid import Pose
from tawami.border.shapes import rigid_disc

STIFFNESS = 1 / (1 - 0.5**2)  # E / (1 - nu^2), E = 1
# a contact much smaller than the disc: both solutions neglect its slope, and its way along the surface
RADIUS, WIDTH, FRICTION = 1.0, 0.001, 0.4
LOAD = np.pi * STIFFNESS * WIDTH**2 / (4 * RADIUS)
LARGEST = 2 * LOAD / (np.pi * WIDTH)
PER_WIDTH, PER_PATCH = 20, 2
NUM = 5 * PER_WIDTH * PER_PATCH // 2
SIZE = 2.5 * WIDTH / NUM
X = WIDTH * (1.25 - 2.5 * (np.arange(NUM) + 0.5) / NUM)  # from right to left: the body is below


def surface():
    ones, zeros = np.ones(NUM), np.zeros(NUM, dtype=np.int64)
    x, normal = np.column_stack([X, 0 * X]), np.tile([0.0, 1.0], (NUM, 1))
    along = SIZE * (np.arange(NUM) + 0.5)
    return BorderPoints(x, SIZE * ones, normal, zeros, ("top",), zeros, along)


def compliance():
    """Displacement of each point by a force that is uniform over the length of another."""
    distance, half = X[:, None] - X, SIZE / 2

    def part(x):
        return x * np.log(x**2) - 2 * x

    return -(part(distance + half) - part(distance - half)) / (np.pi * STIFFNESS * SIZE)


def solve(contact, pose, u, held, load, free):
    """Displacements, pose and contact under a force on the disc along its free motions."""
    points, by_force = surface(), np.kron(compliance(), np.eye(2))
    for iteration in range(30):
        now = contact.evaluate(points.x + u, pose, held, sticking=iteration == 0)
        rest = np.concatenate(
            [u.ravel() - by_force @ now.forces.ravel(), load[free] + now.resultant[free]]
        )
        if iteration > 0 and np.abs(rest[u.size :]).max() < 1e-6 * LOAD:
            return u, pose, now, iteration
        matrix = np.block([
            [np.eye(u.size) - by_force @ now.derivative, -by_force @ now.by_motion[:, free]],
            [now.resultant_by_positions[free], now.resultant_by_motion[np.ix_(free, free)]],
        ])  # fmt: skip
        change = -np.linalg.solve(matrix, rest)
        u, motion = u + change[: u.size].reshape(u.shape), np.zeros(3)
        motion[free] = change[u.size :]
        pose = pose.moved(motion)
    raise AssertionError("Newton's method does not converge")


@cache
def pressed():
    """The disc pressed down, with one augmented pass; penalty 200 mu / h, h the length of a patch."""
    points, disc = surface(), rigid_disc((0.0, RADIUS), RADIUS)
    groups = patches(points, PER_PATCH * SIZE)
    pose, u = Pose.at(disc.centre), np.zeros_like(points.x)
    penalty = np.full(groups.count, 200 / 3 / (PER_PATCH * SIZE))
    contact = Contact(disc, groups, points.length, FRICTION, penalty, pose.to_local(points.x))
    held, load = Multipliers.zero(groups.count, 2), np.array([0.0, -LOAD, 0.0])
    most = 0
    pose = pose.moved(np.array([0.0, -(WIDTH**2) / RADIUS, 0.0]))  # to touch
    for _ in range(2):
        u, pose, now, iterations = solve(contact, pose, u, held, load, [1])
        held, most = now.multipliers, max(most, iterations)
    return contact, u, pose, now, most


def test_pressure_of_hertz():
    contact, _, _, now, iterations = pressed()
    x = contact.patches.means(contact.weights, X)
    inside = np.abs(x) < 0.8 * WIDTH
    exact = LARGEST * np.sqrt(1 - (x[inside] / WIDTH) ** 2)
    assert now.pressure[inside] == pytest.approx(exact, rel=0.01)
    half_width = np.count_nonzero(now.pressure) * PER_PATCH * SIZE / 2
    assert half_width == pytest.approx(WIDTH, abs=PER_PATCH * SIZE)
    assert contact.weights @ now.pressure[contact.patches.number] == pytest.approx(LOAD, rel=1e-4)
    assert now.penetration < 1e-4 * WIDTH**2 / RADIUS
    assert iterations <= 8


@pytest.mark.parametrize("share", [0.46, 0.8])
def test_friction_of_cattaneo_and_mindlin(share):
    before, u, pose, pressed_down, _ = pressed()
    start = pose.to_local(surface().x + u)
    contact = Contact(before.shape, before.patches, before.weights, FRICTION, before.penalty, start)
    load = np.array([share * FRICTION * LOAD, -LOAD, 0.0])
    held = Multipliers(pressed_down.pressure, 0 * pressed_down.traction)
    *_, now, iterations = solve(contact, pose, u, held, load, [0, 1])
    stick = WIDTH * np.sqrt(1 - share)
    width = np.count_nonzero(now.state == STICKING) * PER_PATCH * SIZE / 2
    assert width == pytest.approx(stick, abs=PER_PATCH * SIZE)
    x = contact.patches.means(contact.weights, X)
    inside = np.abs(x) < 0.9 * WIDTH
    root = [np.sqrt(np.maximum(1 - (x[inside] / a) ** 2, 0)) for a in (WIDTH, stick)]
    exact = FRICTION * LARGEST * (root[0] - stick / WIDTH * root[1])
    error = (np.abs(now.traction[inside, 0]) - exact) / (FRICTION * LARGEST)
    assert (
        np.abs(error).max() < 0.05
    )  # in the patch where sticking ends, where the slope is infinite
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert now.resultant == pytest.approx([-load[0], LOAD, now.resultant[2]])
    assert iterations <= 8
