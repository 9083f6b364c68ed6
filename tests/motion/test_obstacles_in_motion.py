"""Contact with obstacles in dynamics."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from cases.verification.rolling import G, speed_of

FLOOR = (0.0, 1.0)


def scene_of(low, high, form="u", *, E=1e5, cells=(14, 12)):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.1, cells=cells)
    body = tawami.box(grid, low, high, per_axis=2)
    law = tawami.linear_elastic(E=E, nu=0.3)
    return tawami.Scene(grid, body, law, form=form, density=1000.0)


def record(motion, end, dt, *more):
    """Rows of kinetic + elastic - external, friction, impact, and other values after each step."""
    rows, iterations = [], []

    def each(solution):
        e = motion.energies
        energy = e.kinetic + e.elastic - e.external
        rows.append([energy, e.friction, e.impact, *(function(solution) for function in more)])
        iterations.append(solution.iterations)

    motion.run(end, dt, each=each)
    assert np.mean(iterations) <= 10
    assert max(iterations) <= 25
    return np.array(rows)


@pytest.mark.direct  # a gain of round-off
def test_a_bouncing_block_never_gains_energy():
    scene = scene_of((0.23, 0.32), (0.73, 0.82))
    scene.gravity((0.0, -G))
    scene.obstacle(tawami.half_plane((0.0, 0.25), (0.1, 1.0)), 0.3)
    motion = tawami.Dynamics(scene, velocity=(0.3, -0.5))
    rows = record(motion, 0.3, 0.01)
    energy, friction, impact = rows.T
    most = motion.kinetic_energy + energy[0]
    assert np.diff(energy).max() < 1e-9 * most
    assert energy[-1] < 0.9 * energy[0]
    assert np.diff(friction).min() >= 0
    assert friction[-1] > 0.01 * energy[0]
    assert np.diff(impact).min() > -1e-7 * most
    assert abs(motion.energies.integration) < 1e-6 * most


@pytest.mark.parametrize("dt", [1e-3, 1e-5])
def test_an_impact_converges_in_short_steps(dt):
    """The inertia in a step, 2 rho h / dt^2, may be far stiffer than the body."""
    scene = scene_of((0.23, 0.3), (0.53, 0.6), cells=(8, 8))
    wall = scene.obstacle(tawami.half_plane((0.0, 0.3), FLOOR))
    motion = tawami.Dynamics(scene, velocity=(0.0, -1.0))
    solution = motion.step(dt)
    assert solution.iterations <= 6
    assert solution.contact(wall).penetration < 1e-4 * dt


@pytest.mark.slow
def test_contact_never_gives_energy_to_a_block_at_finite_strain():
    scene = scene_of((0.23, 0.32), (0.73, 0.82), "u_epsv_finite", E=1e6)
    scene.obstacle(tawami.half_plane((0.0, 0.25), (0.1, 1.0)), 0.3)
    motion = tawami.Dynamics(scene, velocity=(0.3, -1.5))
    energy, friction, impact = record(motion, 0.2, 0.005).T
    start = 0.5 * 250 * (0.3**2 + 1.5**2)
    assert np.diff(friction).min() >= 0
    assert np.diff(impact).min() > -1e-4 * start
    assert energy.max() <= start * (1 + 1e-9)
    assert motion.linear_momentum[1] > 0


def test_a_free_disc_falls_on_a_block():
    scene = scene_of((0.0, 0.0), (1.0, 0.47), cells=(10, 8))
    for part, component in (("bottom", "x"), ("bottom", "y"), ("left", "x"), ("right", "x")):
        scene.fix(part, component)
    radius, mass = 0.2, 10.0
    disc = scene.obstacle(
        tawami.rigid_disc((0.45, 0.7), radius), 0.3, mass=mass, inertia=mass * radius**2 / 2,
        velocity=(0.3, -0.5, 0.0),
    )  # fmt: skip
    weight = scene.gravity((0.0, -G))
    weight.release()
    motion = tawami.Dynamics(scene)
    rows = record(motion, 0.3, 0.005, lambda s: s.contact(disc).force[1])
    energy, force = rows[:, 0], rows[:, 3]
    start = 0.5 * mass * (0.3**2 + 0.5**2)
    assert energy[0] == pytest.approx(start)
    assert np.diff(energy).max() < 1e-3 * start
    impulse = 0.005 * force.sum()
    assert disc.velocity[1] == pytest.approx(impulse / mass - 0.5, abs=1e-6)
    assert disc.velocity[1] > 0
    assert disc.velocity[0] < 0.3
    assert disc.rotation[0] < 0  # friction on its lower side turns it forwards
    assert abs(motion.energies.integration) < 1e-6 * start


def test_a_free_disc_falls_freely():
    scene = scene_of((0.0, 0.0), (1.0, 0.4), cells=(10, 8))
    scene.gravity((0.0, -G))
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    scene.solve()
    disc = scene.obstacle(
        tawami.rigid_disc((0.5, 1.0), 0.2), mass=3.0, free=("x", "y"), velocity=(1.0, 0.0)
    )
    motion = tawami.Dynamics(scene)
    motion.run(0.2, 0.05)
    assert disc.velocity == pytest.approx([1.0, -0.2 * G, 0.0])
    assert disc.x == pytest.approx([0.7, 1.0 - 0.5 * G * 0.04])
    assert motion.energies.integration == pytest.approx(0.0, abs=1e-6)


def test_the_work_of_a_moving_obstacle_is_the_energy_of_the_body():
    scene = scene_of((0.2, 0.2), (0.7, 0.6), E=1e6)
    ram = scene.obstacle(
        tawami.half_plane((0.15, 0.0), (1.0, 0.0)), velocity=(lambda t: 10 * t, 0.0)
    )
    motion = tawami.Dynamics(scene)
    energy, friction, impact = record(motion, 0.2, 0.01).T
    assert ram.x[0] == pytest.approx(0.15 + 5 * 0.2**2)
    assert speed_of(motion) == pytest.approx(10 * 0.2, rel=0.2)
    e = motion.energies
    assert e.external > 0
    assert energy[-1] + impact[-1] == pytest.approx(0.0, abs=1e-6 * e.external)
    assert not friction.any()


def test_a_free_obstacle_needs_a_mass():
    scene = scene_of((0.0, 0.0), (1.0, 0.4))
    scene.obstacle(tawami.rigid_disc((0.5, 0.7), 0.2), force=(0.0, -1.0), mass=1.0)
    with pytest.raises(tawami.InputError, match="'rotation' is free and has no mass"):
        tawami.Dynamics(scene).step(0.01)


def test_statics_does_not_follow_a_velocity():
    scene = scene_of((0.0, 0.0), (1.0, 0.4))
    scene.obstacle(tawami.rigid_disc((0.5, 0.7), 0.2), velocity=(0.0, 1.0))
    with pytest.raises(tawami.InputError, match="has a velocity, which static steps do not follow"):
        scene.solve()


def test_a_restored_motion_continues_in_the_same_way():
    def made():
        scene = scene_of((0.3, 0.0), (0.7, 0.4), "u_epsv_finite", cells=(10, 8))
        scene.fix("bottom", "y")
        disc = scene.obstacle(
            tawami.rigid_disc((0.5, 0.6), 0.19), 0.3, mass=5.0, inertia=0.1, velocity=(0.2, -1.0)
        )
        return tawami.Dynamics(scene), disc

    motion, disc = made()
    motion.run(0.03, 0.005)
    state = motion.state()
    motion.run(0.045, 0.005)
    again, other = made()
    again.restore(state)
    again.run(0.045, 0.005)
    assert other.velocity == pytest.approx(disc.velocity, rel=1e-9)
    assert other.x == pytest.approx(disc.x, rel=1e-12)
    assert again.velocity == pytest.approx(motion.velocity, rel=1e-7, abs=1e-9)
