"""Dynamics: free fall, momentum, vibration, rest, failed steps, wrong input."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from conftest import FINITE
from mpi4py import MPI

import tawami
from tawami.dynamics import TRANSFERS

G = 10.0


def block(form="u_epsv_finite", *, E=1e5, nu=0.4, **options):
    """A block of 0.5 m in the middle of a grid of 2 m."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.125, cells=(16, 16))
    body = tawami.box(grid, (-0.25, -0.25), (0.25, 0.25))
    if form == "u_epsv_finite":
        options.setdefault("alpha", 0.01)
    material = tawami.linear_elastic(E=E, nu=nu)
    return tawami.Scene(grid, body, material, form=form, density=1000.0, **options)


def spin(scene, omega):
    x = scene.particles.x
    return omega * np.column_stack([-x[:, 1], x[:, 0]])


@pytest.mark.parametrize("form", FINITE)
@pytest.mark.parametrize("transfer", TRANSFERS)
def test_free_fall(form, transfer):
    scene = block(form)
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
    ("transfer", "loss"), [("affine_flip", 2e-4), ("tpic", 2e-4), ("flip", 0.35)]
)
def test_momentum_of_a_spinning_block(transfer, loss):
    """1.6 rad in 200 steps on 4 cells; plain FLIP is known to lose a third."""
    scene = block()
    motion = tawami.Dynamics(scene, velocity=spin(scene, 2.0), transfer=transfer)
    if transfer != "flip":
        motion.velocity_gradient[:] = 2.0 * np.array([[0, -1], [1, 0]])
    before, energy = motion.angular_momentum(), motion.kinetic_energy
    size = motion.mass @ np.linalg.norm(motion.velocity, axis=1)
    motion.run(0.8, 0.004)
    assert np.abs(motion.linear_momentum).max() < 1e-13 * size * motion.steps
    assert abs(motion.angular_momentum() / before - 1) < loss
    assert (abs(motion.angular_momentum() / before - 1) > 0.1) == (transfer == "flip")
    assert motion.kinetic_energy < energy * (1 + 1e-6)


def test_longitudinal_vibration():
    """A bar held at one end, nu = 0: after half a period 2 L / c the velocity has turned round."""
    L, E, rho, v0 = 1.0, 1e6, 1000.0, 0.1
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1 / 16, cells=(18, 2))
    body = tawami.box(grid, (0, 0), (L, 1 / 8))
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
    assert motion.kinetic_energy < 0.01 * energy  # all of it is elastic
    motion.run(half, half / 100)
    amplitude = motion.velocity[:, 0] @ shape / (shape @ shape)
    assert amplitude == pytest.approx(-v0, rel=0.02)
    assert 0.97 * energy < motion.kinetic_energy <= 1.001 * energy


def test_a_body_at_rest_stays_at_rest():
    """The weight is brought up slowly, then the body is let go on its floor."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 8))
    body = tawami.box(grid, (0, 0), (1, 0.75))
    material = tawami.linear_elastic(E=1e6, nu=0.45)
    scene = tawami.Scene(
        grid, body, material, form="u_epsv_finite", density=1000.0, tolerance=1e-11
    )
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    for k in range(1, 5):
        scene.gravity((0, -G * k / 4))
        scene.solve()
    for _ in range(20):  # reset and solve at full load
        scene.solve()
    motion = tawami.Dynamics(scene)
    motion.run(0.5, 0.005)
    assert np.abs(motion.velocity).max() < 1e-4 * np.sqrt(G * 0.75)


def test_a_step_that_fails_changes_nothing():
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


def test_steps_are_halved_and_grow_again():
    scene = block(max_iterations=2)
    motion = tawami.Dynamics(scene, velocity=spin(scene, 5.0))
    sizes, step = [], motion.step
    motion.step = lambda dt: (sizes.append(dt), step(dt))[1]
    motion.run(0.3, 0.1)
    assert motion.time == pytest.approx(0.3)
    assert min(sizes) < 0.1
    assert any(later > earlier for earlier, later in pairwise(sizes))


def falling_on_the_floor():
    """A block on a floor that it cannot leave or slide on, moving down at 1 m/s."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 8))
    body = tawami.box(grid, (0.25, 0.0), (0.75, 0.5))
    material = tawami.linear_elastic(E=1e5, nu=0.3)
    scene = tawami.Scene(grid, body, material, form="u_epsv_finite", density=1000.0)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def test_the_impulse_of_a_support_reaches_the_particles():
    """In no time at all: the lumped mass of the functions that the floor holds comes to rest."""
    scene = falling_on_the_floor()
    motion = tawami.Dynamics(scene, velocity=(0.0, -1.0))
    before = motion.linear_momentum[1]
    # functions of the floor: the first spline, (1 - t)^2 in the first row of cells
    t = scene.particles.x[:, 1] / scene.grid.h
    stopped = motion.mass @ np.where(t < 1, (1 - t) ** 2, 0.0)
    motion.step(1e-5)
    assert motion.linear_momentum[1] - before == pytest.approx(stopped, rel=1e-4)


def test_damping_is_a_rate():
    """The velocity lies between those of FLIP and of PIC, exp(-dt/damping) of the way."""
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


def test_gamma_above_one_half_damps():
    energies = []
    for gamma in (0.5, 1.0):
        scene = falling_on_the_floor()
        motion = tawami.Dynamics(scene, velocity=(0.0, -0.05), gamma=gamma)
        motion.run(0.4, 0.01)
        energies.append(motion.kinetic_energy)
    assert energies[1] < 0.5 * energies[0]


def test_a_particle_that_would_leave_stops_the_run():
    scene = block()
    motion = tawami.Dynamics(scene, velocity=(10.0, 0.0))
    with pytest.raises(
        tawami.InputError, match="64 of 64 particles lie outside|lie outside the grid"
    ):
        motion.run(1.0, 0.01)
    assert motion.time < 0.1
    assert scene.particles.x[:, 0].max() <= 1.0


def test_wrong_input_gets_a_sentence(random_scene):
    with pytest.raises(tawami.InputError, match="Dynamics needs a form of finite strain"):
        tawami.Dynamics(random_scene())
    scene = block()
    for options, words in (
        ({"transfer": "apic"}, "transfer = 'apic': expected one of affine_flip, flip"),
        ({"damping": 0.0}, "damping = 0.0: expected a time in s"),
        ({"gamma": 0.2}, "gamma = 0.2: expected a finite number from 0.5 to 1"),
        ({"velocity": np.zeros((3, 2))}, r"velocity has shape \(3, 2\): expected two numbers"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            tawami.Dynamics(scene, **options)
    with pytest.raises(tawami.InputError, match="damping = 'a': expected a time"):
        tawami.Dynamics(scene, damping="a")
    with pytest.raises(tawami.InputError, match="its lumped masses are not all positive"):
        tawami.Dynamics(block(basis="biquadratic"))
    for change, words in (
        (lambda s: s.hold((0, 0), "x"), "expected a scene without"),
        (lambda s: s.traction("left", (1.0, 0.0)), "expected a scene without"),
        (lambda s: (s._edges.clear(), s.fix("bottom", "y", 1e-3)), "Dynamics holds edges at zero"),
    ):
        other = falling_on_the_floor()
        change(other)
        with pytest.raises(tawami.InputError, match=words):
            tawami.Dynamics(other).step(0.01)
    motion = tawami.Dynamics(scene)
    for dt in (0.0, -1.0, np.nan):
        with pytest.raises(tawami.InputError, match="dt = "):
            motion.step(dt)
    with pytest.raises(tawami.InputError, match="dt = 2 s is longer than the 1 s until end"):
        motion.run(1.0, 2.0)
    motion.velocity_gradient[3] = np.nan
    with pytest.raises(tawami.InputError, match="velocity_gradient of 1 particles is not finite"):
        motion.step(0.01)
    motion.velocity_gradient[3] = 0.0
    motion.velocity[5] = np.nan
    with pytest.raises(
        tawami.InputError, match="velocity of 1 particles is not finite, the first is 5"
    ):
        motion.step(0.01)
