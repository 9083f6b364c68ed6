"""Motions: free fall, momentum, vibration, rest, supports, failed steps, wrong input."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from moving_blocks import G, block, falling_on_the_floor, spin
from mpi4py import MPI
from scenes import FINITE

import tawami
from tawami.motion.dynamics import TRANSFERS


@pytest.mark.parametrize("form", FINITE)
@pytest.mark.parametrize("transfer", TRANSFERS)
def test_a_block_falls_freely(form, transfer):
    scene = block(form, tolerance=1e-12)
    scene.gravity((1.0, -G))
    start = np.array(scene.particles.x)
    motion = tawami.Dynamics(scene, velocity=(0.5, 0.0), transfer=transfer)
    motion.run(0.2, 0.01)
    assert motion.time == pytest.approx(0.2)
    assert motion.velocity == pytest.approx(np.full((64, 2), [0.7, -2.0]), abs=1e-11)
    way = np.array(scene.particles.x) - start
    assert way == pytest.approx(np.full((64, 2), [0.12, -0.2]), abs=1e-12)
    assert np.abs(scene.particles.stress).max() < 1e-6


@pytest.mark.parametrize(
    ("transfer", "loss"), [("affine_flip", 2e-4), ("apic", 2e-4), ("tpic", 2e-4), ("flip", 0.35)]
)
def test_a_spinning_block_keeps_its_momentum(transfer, loss):
    """1.6 rad in 100 steps on 4 cells; plain FLIP loses a third."""
    scene = block(tolerance=1e-12)
    motion = tawami.Dynamics(scene, velocity=spin(scene, 2.0), transfer=transfer)
    if transfer != "flip":
        motion.velocity_gradient[:] = 2.0 * np.array([[0, -1], [1, 0]])
    before, energy = motion.angular_momentum(), motion.kinetic_energy
    size = motion.mass @ np.linalg.norm(motion.velocity, axis=1)
    motion.run(0.8, 0.008)
    assert np.abs(motion.linear_momentum).max() < 1e-13 * size * motion.steps
    assert abs(motion.angular_momentum() / before - 1) < loss
    assert (abs(motion.angular_momentum() / before - 1) > 0.1) == (transfer == "flip")
    assert motion.kinetic_energy < energy * (1 + 1e-6)


def test_a_bar_vibrates_with_its_period():
    """A bar held at one end, nu = 0: after half a period 2 L / c the velocity is reversed."""
    L, E, rho, v0 = 1.0, 1e6, 1000.0, 0.1
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1 / 16, cells=(18, 2))
    body = tawami.box(grid, (0, 0), (L, 1 / 8), per_axis=2)
    scene = tawami.Scene(
        grid, body, tawami.linear_elastic(E=E, nu=0.0), form="u_epsv_finite", density=rho, alpha=0.0
    )
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y")
    shape = np.sin(np.pi * body.x[:, 0] / (2 * L))
    motion = tawami.Dynamics(scene, velocity=v0 * np.column_stack([shape, 0 * shape]))
    energy, half = motion.kinetic_energy, 2 * L / np.sqrt(E / rho)
    motion.run(half / 2, half / 100)
    assert motion.kinetic_energy < 0.01 * energy  # the energy is elastic
    motion.run(half, half / 100)
    amplitude = motion.velocity[:, 0] @ shape / (shape @ shape)
    assert amplitude == pytest.approx(-v0, rel=0.02)
    assert 0.97 * energy < motion.kinetic_energy <= 1.001 * energy


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_body_at_rest_stays_at_rest(count):
    """After a ramp and a static equilibrium on its floor; then a support is released, and it moves."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(12, 8))
    body = tawami.box(grid, (0, 0), (1, 0.75), per_axis=2)
    material = tawami.linear_elastic(E=1e5, nu=0.45)
    scene = tawami.Scene(grid, body, material, form="u_epsv_finite", density=1000.0)
    for edge, component in (("left", "x"), ("bottom", "y"), ("bottom", "x")):
        scene.fix(edge, component)
    scene.hold((0.9999, 0.5), "x")
    scene.gravity((0, -G))
    tawami.ramp(scene, 0.25)
    steps = tawami.settle(scene)
    assert steps[-1].history[0][0] < 1e-10
    motion = tawami.Dynamics(scene)
    speeds = []
    motion.run(count * 0.005, 0.005, each=lambda _: speeds.append(np.abs(motion.velocity).max()))
    assert len(speeds) == count
    assert max(speeds) < 1e-4 * np.sqrt(G * 0.75)
    place = scene.configuration.supports.all[-1].place
    scene.release(place)
    motion.run(count * 0.005 + 0.1, 0.005)
    assert np.abs(motion.velocity).max() > 1e-2


def test_a_failed_step_changes_nothing():
    scene = block(max_iterations=1, tolerance=1e-12)
    scene.gravity((0, -G))
    motion = tawami.Dynamics(scene, velocity=spin(scene, 5.0))

    def state():
        arrays = (scene.particles.x, scene.particles.stress, motion.velocity, motion.acceleration)
        return [np.array(a) for a in (*arrays, motion.velocity_gradient)]

    before = state()
    with pytest.raises(tawami.ConvergenceError):
        motion.step(0.02)
    with pytest.raises(tawami.ConvergenceError) as error:
        motion.run(0.02, 0.02, smallest=0.015)
    assert "at 0 s, with the smallest step of 0.02 s" in error.value.__notes__[0]
    assert len(error.value.history) == 2
    for a, b in zip(before, state(), strict=True):
        np.testing.assert_array_equal(a, b)
    assert motion.steps == 0


def test_steps_are_halved_and_grow_again(monkeypatch):
    scene = block(max_iterations=2)
    motion = tawami.Dynamics(scene, velocity=spin(scene, 5.0))
    sizes, step = [], tawami.Dynamics.step
    monkeypatch.setattr(
        tawami.Dynamics, "step", lambda motion, dt: (sizes.append(dt), step(motion, dt))[1]
    )
    motion.run(0.3, 0.1)
    assert motion.time == pytest.approx(0.3)
    assert min(sizes) < 0.1
    assert any(later > earlier for earlier, later in pairwise(sizes))


def test_the_impulse_of_a_support_reaches_the_particles():
    """In a very short step the lumped mass of the held functions comes to rest."""
    scene = falling_on_the_floor()
    motion = tawami.Dynamics(scene, velocity=(0.0, -1.0))
    before = motion.linear_momentum[1]
    # functions of the floor: the first spline, (1 - t)^2 in the first row of cells
    t = scene.particles.x[:, 1] / scene.grid.h
    stopped = motion.mass @ np.where(t < 1, (1 - t) ** 2, 0.0)
    motion.step(1e-5)
    assert motion.linear_momentum[1] - before == pytest.approx(stopped, rel=1e-4)


def test_damping_is_a_rate():
    """The velocity lies between those of FLIP and of PIC, at exp(-dt/damping)."""
    found = {}
    for name, options in (
        ("flip", {}), ("pic", {"transfer": "tpic"}), ("damped", {"damping": 0.02}),
    ):  # fmt: skip
        scene = falling_on_the_floor()
        rough = 0.3 * np.random.default_rng(0).standard_normal((64, 2))
        motion = tawami.Dynamics(scene, velocity=rough, **options)
        motion.step(0.01)
        found[name] = motion.velocity
    expected = found["pic"] + np.exp(-0.5) * (found["flip"] - found["pic"])
    assert found["damped"] == pytest.approx(expected, abs=1e-9)
    assert np.abs(found["flip"] - found["pic"]).max() > 0.01


def test_a_particle_that_would_leave_the_grid_stops_the_run():
    scene = block()
    motion = tawami.Dynamics(scene, velocity=(10.0, 0.0))
    before = np.array(scene.particles.x)
    motion.run(0.07, 0.07)
    words = r"particle 7 would leave the grid at 0.08 s, at \(1.01875, -0.21875\) m, and 7 others"
    with pytest.raises(tawami.InputError, match=words):
        motion.run(1.0, 0.01)
    assert motion.time == pytest.approx(0.07)
    assert scene.particles.x == pytest.approx(before + np.array([0.7, 0.0]))


def test_particles_that_leave_the_grid_can_be_removed():
    scene = block(leaving="remove")
    motion = tawami.Dynamics(scene, velocity=(10.0, 0.0))
    numbers = []
    motion.run(0.1, 0.01, each=lambda solution: numbers.append(len(solution.number)))
    assert len(scene.particles) == 64 - len(scene.left) == 32
    assert numbers[6:9] == [64, 64, 56]  # a solution has the particles of its step
    number, x, time = scene.left[0]
    assert (number, time) == (7, pytest.approx(0.08))
    assert x == pytest.approx((1.01875, -0.21875))
    assert motion.velocity == pytest.approx(np.full((32, 2), [10.0, 0.0]), abs=1e-9)
    with pytest.raises(tawami.InputError, match="the last particle would leave the grid"):
        motion.run(0.2, 0.05)
    with pytest.raises(tawami.InputError, match="leaving = 'ignore': expected 'stop' or 'remove'"):
        block(leaving="ignore")


def test_a_pendulum_has_the_period_of_a_rigid_body():
    """Held at a point. The lumped mass adds about M h^2/2 to its moment of inertia."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1.5), h=0.125, cells=(16, 16))
    body = tawami.box(grid, (-0.125, -1.0), (0.125, 0.0), per_axis=2)
    material = tawami.linear_elastic(E=1e7, nu=0.3)
    scene = tawami.Scene(grid, body, material, form="u_epsv_finite", density=1000.0)
    scene.gravity((0, -G))
    scene.hold((0, -0.125), "x")
    scene.hold((0, -0.125), "y")
    pivot, omega = np.array([0, -0.125]), 0.3
    x = body.x - pivot
    motion = tawami.Dynamics(scene, velocity=omega * np.column_stack([-x[:, 1], x[:, 0]]))
    motion.velocity_gradient[:] = omega * np.array([[0, -1], [1, 0]])
    inertia = 250 * ((0.25**2 + 1) / 12 + 0.375**2 + grid.h**2 / 2)
    period = 2 * np.pi * np.sqrt(inertia / (250 * G * 0.375))
    way, time = [], []
    motion.run(
        1.2 * period, 0.02, each=lambda s: (way.append(s.x[:, 0].mean()), time.append(motion.time))
    )
    turns = np.flatnonzero(np.diff(np.sign(way)))
    zeros = [time[k] - way[k] * (time[k + 1] - time[k]) / (way[k + 1] - way[k]) for k in turns]
    assert np.diff(zeros)[0] == pytest.approx(period / 2, rel=0.01)
    assert np.abs(np.array(scene.configuration.supports.all[0].place) - pivot).max() < 1e-9


def test_the_impulse_of_a_moving_support_is_the_momentum():
    """Sum of its reactions over the steps, compared with the momentum of the body."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(16, 6))
    body = tawami.box(grid, (0, 0.125), (0.5, 0.5), per_axis=2)
    material = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, material, form="u_epsv_finite", density=1000.0)
    scene.fix("left", "x", velocity=lambda t: 0.1 * np.sin(20 * t))
    motion, dt, reactions = tawami.Dynamics(scene), 1e-3, [0.0]
    motion.run(0.2, dt, each=lambda s: reactions.append(s.reaction("left")[0]))
    impulse = dt * (np.sum(reactions) - reactions[-1] / 2)
    assert motion.linear_momentum[0] == pytest.approx(impulse, rel=0.01)
    edge = scene.particles.displacement[scene.particles.number % 8 == 0, 0]
    assert edge.mean() == pytest.approx(0.1 / 20 * (1 - np.cos(4.0)), rel=0.05)


def test_loads_on_particles_move_with_them():
    """The body moves as a point mass does."""
    scene = block(tolerance=1e-12)
    scene.load(scene.particles.x[:, 1] > 0.2, (50.0, 0.0))
    scene.load(np.flatnonzero(scene.particles.x[:, 1] < -0.2), (50.0, 0.0))
    motion = tawami.Dynamics(scene)
    motion.run(0.5, 0.01)
    assert motion.linear_momentum == pytest.approx([100 * 0.5, 0.0], rel=1e-9, abs=1e-9)
    assert motion.energies.external == pytest.approx(0.5 * 50**2 / 250, rel=0.02)


@pytest.mark.parametrize("basis", ["quadratic_spline", "bilinear"])
def test_apic_works_where_particles_have_no_inertia_about_a_node(basis):
    """A particle in the corner of the grid, particles on grid lines."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(8, 8))
    x = np.array([[i / 8, j / 8] for i in range(5) for j in range(5)])
    law = tawami.linear_elastic(E=1e4, nu=0.3)
    body = tawami.Body(x, np.full(25, 1 / 64))
    scene = tawami.Scene(grid, body, law, form="u_finite", density=1000.0, basis=basis)
    motion = tawami.Dynamics(scene, velocity=(0.2, 0.1), transfer="apic")
    motion.run(0.1, 0.01)
    assert motion.velocity == pytest.approx(np.tile([0.2, 0.1], (25, 1)), abs=1e-9)


def test_gravity_acts_from_the_step_in_which_it_is_set():
    scene = block()
    motion = tawami.Dynamics(scene)
    motion.step(0.01)
    scene.gravity((0, -G))
    motion.run(0.06, 0.01)
    assert motion.velocity[:, 1] == pytest.approx(np.full(64, -0.5), abs=1e-9)


def test_velocities_may_be_written_during_a_run():
    scene = block("u")
    motion = tawami.Dynamics(scene)
    motion.step(0.01)
    motion.velocity[:] = (0.3, 0.0)
    motion.step(0.01)
    assert motion.linear_momentum == pytest.approx([75.0, 0.0], abs=1e-9)


def test_wrong_input_is_rejected(random_scene):
    with pytest.raises(tawami.InputError, match=r"Dynamics needs Scene\(..., density=...\)"):
        tawami.Dynamics(random_scene())
    scene = block()
    for options, words in (
        ({"transfer": "mpm"}, "transfer = 'mpm': expected one of affine_flip, flip"),
        ({"damping": 0.0}, "damping = 0.0: expected a time in s"),
        ({"gamma": 0.2}, "gamma = 0.2: expected a finite number of at least 0.5 and at most 1"),
        ({"velocity": np.zeros((3, 2))}, r"velocity has shape \(3, 2\): expected two numbers"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            tawami.Dynamics(scene, **options)
    with pytest.raises(tawami.InputError, match="damping = 1 s relaxes the velocities of FLIP"):
        tawami.Dynamics(scene, damping=1.0, transfer="apic")
    with pytest.raises(tawami.InputError, match="damping = 'a': expected a time"):
        tawami.Dynamics(scene, damping="a")
    with pytest.raises(tawami.InputError, match="its lumped masses are not all positive"):
        tawami.Dynamics(block(basis="biquadratic"))
    other = falling_on_the_floor()
    other.fix("bottom", "y", 1e-3)
    with pytest.raises(tawami.InputError, match=r"fix\('bottom'\) prescribes a displacement that"):
        tawami.Dynamics(other).step(0.01)
    for velocity, words in (
        (lambda t: "fast", "velocity at 0 s = 'fast': expected a number"),
        (lambda t: 1 / t, r"velocity\(0\) gave ZeroDivisionError"),
        (np.nan, "velocity at 0 s = nan: expected a finite number"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            other.fix("left", "x", velocity=velocity)
    with pytest.raises(tawami.InputError, match="expected a value or a velocity, not both"):
        other.fix("left", "x", 1.0, velocity=1.0)
    for particles, words in (
        ([1, 2, 64], "expected a mask of the 64 particles of the body, or their numbers"),
        ([0.5], "expected a mask of the 64 particles"),
        (np.zeros(64, dtype=bool), "no particle was chosen"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            other.load(particles, (1.0, 0.0))
    motion = tawami.Dynamics(scene)
    for dt in (0.0, -1.0, np.nan):
        with pytest.raises(tawami.InputError, match="dt = "):
            motion.step(dt)
    with pytest.raises(tawami.InputError, match="dt = 2 s is longer than the 1 s until end"):
        motion.run(1.0, 2.0)
    motion.velocity_gradient[3] = np.nan
    with pytest.raises(
        tawami.InputError, match="velocity_gradient: 4 entries are not finite.*at particle 3"
    ):
        motion.step(0.01)
    motion.velocity_gradient[3] = 0.0
    motion.velocity[5] = np.nan
    with pytest.raises(
        tawami.InputError, match="velocity: 2 entries are not finite.*at particle 5"
    ):
        motion.step(0.01)
