"""Amplitudes in time of loads and prescribed displacements, in statics and in motion."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import beam

import tawami

E, H = 1e4, 0.25


def column(form="u_epsv", **options):
    """A column of 1 m on the bottom of the grid; 0.5 m of the grid are above it."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(2, 6))
    body = tawami.box(grid, (0, 0), (0.5, 1), per_axis=2)
    law = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(grid, body, law, form=form, density=1.0, **options)
    scene.fix("bottom", "y")
    for edge in ("left", "right"):
        scene.fix(edge, "x")
    return scene


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_a_ramp_follows_amplitudes(form):
    """A cycle of one load, and a new load without amplitude that grows in proportion."""
    scene, found = column(form), []
    scene.gravity((0.0, -2.0), amplitude=lambda t: np.sin(np.pi * t))
    scene.load([0], (0.0, -4.0))
    steps = tawami.ramp(
        scene, 0.25, until=2.0, each=lambda s: found.append(s.reaction("bottom")[1])
    )
    assert found == pytest.approx([1 + 1, 2 + 0, 3 - 1, 4 - 0], rel=1e-4)
    assert steps.complete
    assert scene.time == 2.0
    found.clear()
    tawami.ramp(scene, 0.5, until=3.0, each=lambda s: found.append(s.reaction("bottom")[1]))
    assert found == pytest.approx([4 + 1, 4 + 0], rel=1e-4)


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_a_prescribed_displacement_follows_its_amplitude_in_statics(form):
    scene = column(form)
    top = scene.hold((0.25, 1.0), "y", 0.02, amplitude=lambda t: t * (2 - t))
    for until, factor in ((0.5, 0.75), (1.0, 1.0), (2.0, 0.0)):
        solution = scene.solve(until=until)
        at = top.place[1] - 1.0 if scene.form.strain.finite else solution.displacement((0.25, 1))[1]
        assert at == pytest.approx(0.02 * factor, abs=1e-12)
    with pytest.raises(
        tawami.InputError, match=r"until = 1.0: expected a finite number of at least 2"
    ):
        scene.solve(until=1.0)


def test_without_until_amplitudes_have_their_value_at_the_time_of_the_scene():
    """So a motion begins in equilibrium with what acts at its start."""
    scene = column()
    weight = scene.gravity((0.0, -2.0), amplitude=lambda t: 1 + np.sin(np.pi * t))
    found = []
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("bottom")[1]))
    assert found == pytest.approx([0.5, 1.0], rel=1e-4)
    motion = tawami.Dynamics(scene)
    motion.step(1e-6)
    assert np.abs(motion.velocity).max() < 1e-8
    assert motion.time == scene.time == 1e-6
    weight.change(amplitude=0.5)
    assert scene.solve().reaction("bottom")[1] == pytest.approx(0.5, rel=1e-4)


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
@pytest.mark.parametrize("name", ["gravity", "load"])
def test_momentum_is_the_integral_of_the_load(form, name):
    """A free block under f(t) = sin(pi t): the trapezoidal rule of the momentum, to round-off."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=H, cells=(8, 8))
    body = tawami.box(grid, (-0.5, -0.5), (0.5, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=E, nu=0.3)
    scene = tawami.Scene(grid, body, law, form=form, density=2.0)

    def f(t):
        return np.sin(np.pi * t)

    everywhere = np.arange(len(body.volume))
    if name == "gravity":
        scene.gravity((3.0, 0.0), amplitude=f)
    else:
        scene.load(everywhere, (6.0, 0.0), amplitude=f)
    motion, dt = tawami.Dynamics(scene), 0.02
    motion.run(0.2, dt)
    times = np.linspace(0, 0.2, 11)
    momentum = (
        np.trapezoid(6 * f(times), times)
        if hasattr(np, "trapezoid")
        else np.trapz(6 * f(times), times)
    )
    assert motion.linear_momentum == pytest.approx([momentum, 0.0], rel=1e-10, abs=1e-10)
    # a rigid motion: all of the work is kinetic energy
    energies = motion.energies
    assert energies.kinetic == pytest.approx(momentum**2 / 4, rel=1e-8)
    assert energies.external == pytest.approx(energies.kinetic, rel=1e-8)
    assert abs(energies.integration) < 1e-9 * energies.kinetic


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
@pytest.mark.parametrize("given", ["amplitude", "velocity"])
def test_a_support_moves_by_its_amplitude_as_by_its_velocity(form, given):
    """Both are exact for a parabola, and the point is where the integral says."""
    scene = column(form)
    if given == "amplitude":
        top = scene.hold((0.25, 0.9), "y", 0.5, amplitude=lambda t: -(t**2))
    else:
        top = scene.hold((0.25, 0.9), "y", velocity=lambda t: -t)
    motion = tawami.Dynamics(scene, gamma=0.6)
    motion.run(0.1, 0.01)
    if form == "u_epsv_finite":
        assert top.place[1] == pytest.approx(0.9 - 0.5 * 0.1**2, rel=1e-12)
    v, _ = motion.on_grid or (None, None)
    if v is not None:
        solution = motion.step(1e-3)
        assert solution.displacement((0.25, 0.9))[1] == pytest.approx(-0.5 * 0.101**2, rel=1e-9)
    assert top.moves


def test_a_motion_needs_displacements_that_the_body_has():
    scene = column()
    top = scene.hold((0.25, 1.0), "y", 0.01, amplitude=lambda t: 1 + t)
    motion = tawami.Dynamics(scene)
    with pytest.raises(
        tawami.InputError, match="prescribes a displacement that the body does not have"
    ):
        motion.step(1e-3)
    tawami.ramp(scene, 0.5)  # as the message advises
    motion = tawami.Dynamics(scene)
    motion.step(1e-3)
    top.change(0.02)
    with pytest.raises(
        tawami.InputError, match="prescribes a displacement that the body does not have"
    ):
        motion.step(1e-3)
    top.release()
    motion.step(1e-3)


def test_a_velocity_changes_and_stays_one():
    scene = column()
    top = scene.hold((0.25, 1.0), "y", velocity=0.1)
    motion = tawami.Dynamics(scene)
    motion.step(1e-2)
    top.change(velocity=lambda t: -0.1)
    assert motion.step(1e-2).displacement((0.25, 1.0))[1] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(tawami.InputError, match="it was made with a velocity: expected a velocity"):
        top.change(0.0)
    with pytest.raises(tawami.InputError, match="velocity, which static steps do not follow"):
        scene.solve()


def test_a_released_load_leaves_a_motion_at_once():
    scene = column()
    weight = scene.gravity((0.0, -2.0))
    motion = tawami.Dynamics(scene)
    motion.run(0.02, 0.01)
    external = motion.energies.external
    weight.release()
    motion.run(0.04, 0.01)
    assert motion.energies.external == pytest.approx(external, rel=1e-12)  # no work any more
    assert scene.configuration.loads.all == []


@pytest.mark.parametrize(
    ("give", "words"),
    [
        (lambda s, f: s.traction("right", (1.0, 0.0), amplitude=f), "traction.*: amplitude"),
        (lambda s, f: s.load([0], (1.0, 0.0), amplitude=f), "load.*: amplitude"),
        (lambda s, f: s.gravity((1.0, 0.0), amplitude=f), "gravity.*: amplitude"),
        (lambda s, f: s.fix("left", "x", amplitude=f), "fix.*: amplitude"),
        (lambda s, f: s.hold((0.0, 1.0), "x", amplitude=f), "hold.*: amplitude"),
        (lambda s, f: s.hold((0.0, 1.0), "x", velocity=f), "hold.*: velocity"),
    ],
)
@pytest.mark.parametrize("value", [1j, np.complex128(1.0), np.nan, "1", np.ones(1), None])
def test_functions_of_time_give_real_numbers(give, words, value):
    """When they are given, and in the step that first meets another value."""
    scene = beam(density=1.0)
    for component in "xy":
        scene.fix("left", component)
    with pytest.raises(tawami.InputError, match=words):
        give(scene, lambda t: value)
    assert len(scene.configuration.supports.all) == 2
    give(scene, lambda t: value if t > 0 else 0.0)
    motion = tawami.Dynamics(scene)
    with pytest.raises(tawami.InputError, match=words):
        motion.step(1e-3)
    assert motion.time == 0.0


@pytest.mark.parametrize("values", [lambda x: 1j * x, lambda x: x + 0j])
def test_functions_of_position_give_real_numbers(values):
    """NumPy would drop the imaginary part with no more than a warning."""
    scene = beam(density=1.0)
    scene.fix("left", "y")
    side = scene.fix("left", "x", lambda x, y: values(x))
    with pytest.raises(tawami.InputError, match=r"fix\('left'\).*complex"):
        scene.solve()
    side.change(0.0)
    pull = scene.traction("right", (lambda x, y: values(x), 0.0))
    with pytest.raises(tawami.InputError, match=r"traction\('right'\).*complex"):
        scene.solve()
    pull.release()
    for function in (
        lambda x, y: (values(x), values(y)),
        lambda x, y: np.stack([values(x)] * 2, 1),
    ):
        with pytest.raises(tawami.InputError, match="velocity.*complex"):
            tawami.Dynamics(scene, velocity=function)
    with pytest.raises(tawami.InputError, match="velocity has complex numbers"):
        tawami.Dynamics(scene, velocity=values(np.ones(2)))
    with pytest.raises(tawami.InputError, match="stress.*complex"):
        scene.initial("stress", lambda x, y: (values(x), x, x, x))
    with pytest.raises(tawami.InputError, match="level_set.*complex"):
        tawami.level_set(scene.grid, lambda x, y: values(x))
    scene.solve()


def test_an_amplitude_is_continued_by_another_one_during_a_motion():
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=0.5, cells=(2, 2))
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, tawami.box(grid, (0, 0), (1, 1)), law, density=1e3)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    pull = scene.fix("right", "x", 1e-2, amplitude=np.sin)
    motion = tawami.Dynamics(scene)
    motion.run(0.1, 0.05)
    start = motion.time
    pull.change(amplitude=lambda t: np.sin(start) + (t - start))
    motion.step(0.05)
    edge = motion.step(0.05).displacement((1.0, 0.5))[0]
    assert edge == pytest.approx(1e-2 * (np.sin(start) + 0.1), rel=1e-9)
