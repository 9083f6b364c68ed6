"""The balance of energy of a motion, and a warning of spurious energy."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from moving_blocks import G, block, falling_on_the_floor
from mpi4py import MPI

import tawami
from tawami.motion.energy import Energies, Growth
from tawami.motion.newmark import NewmarkStep


def test_gamma_above_one_half_dissipates_energy():
    energies = []
    for gamma in (0.5, 1.0):
        scene = falling_on_the_floor()
        motion = tawami.Dynamics(scene, velocity=(0.0, -0.05), gamma=gamma)
        motion.run(0.4, 0.01)
        energies.append(motion.kinetic_energy)
    assert energies[1] < 0.5 * energies[0]


@pytest.mark.parametrize("form", ["u", "u_epsv"])
def test_a_form_of_small_strain_conserves_energy(form):
    """The trapezoidal rule conserves it, and nothing is transferred; alpha takes a little."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 4))
    body = tawami.box(grid, (0, 0), (1, 0.5), per_axis=2)
    material = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, material, form=form, density=1000.0, tolerance=1e-10)
    scene.fix("left", "x")
    scene.fix("left", "y")
    motion = tawami.Dynamics(scene, velocity=np.column_stack([0 * body.x[:, 0], body.x[:, 0]]))
    x = np.array(scene.particles.x)
    motion.run(0.005, 0.005)
    start = motion.energies.kinetic + motion.energies.elastic
    motion.run(1.0, 0.005)
    now = motion.energies
    kept = 1e-9 if form == "u" else 0.05
    assert now.kinetic + now.elastic == pytest.approx(start, rel=kept)
    assert now.kinetic + now.elastic <= start * (1 + 1e-9)
    np.testing.assert_array_equal(x, scene.particles.x)


def test_the_energy_of_a_thrown_block_is_kinetic_and_external():
    scene = block(tolerance=1e-9)
    scene.gravity((0, -G))
    motion = tawami.Dynamics(scene, velocity=(0.0, 1.0))
    motion.run(0.2, 0.01)
    e = motion.energies
    rise = scene.particles.displacement[:, 1].mean()
    assert e.external == pytest.approx(-250 * G * rise, rel=1e-9)
    assert e.kinetic == pytest.approx(125.0 + e.external, rel=1e-9)
    assert max(map(abs, (e.elastic, e.dissipated, e.transfer, e.impact, e.integration))) < 1e-8
    assert str(e).startswith("kinetic 125, elastic")


def test_the_dissipation_is_the_work_on_plastic_strains():
    """Displacement only, slow uniform shortening: sigma_y times plastic strain."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 4))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=3, gauss=True)
    law = tawami.von_mises(tawami.linear_elastic(E=1e6, nu=0.3), yield_stress=1e3)
    scene = tawami.Scene(grid, body, law, form="u_finite", density=1e-6)
    for edge, component in (("left", "x"), ("bottom", "y"), ("top", "y")):
        scene.fix(edge, component)
    scene.fix("right", "x", velocity=-0.1)
    motion = tawami.Dynamics(scene)
    motion.run(0.1, 0.02)
    work = 1e3 * scene.particles.volume @ scene.particles.history("plastic_strain")
    assert work > 1.0
    assert motion.energies.dissipated == pytest.approx(work, rel=1e-9)


def test_the_impact_of_a_support_that_starts_suddenly_is_known():
    """An edge that moves at once: 1/2 m (v - v0)^2 of its functions."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 4))
    body = tawami.box(grid, (0, 0), (1, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u", density=1000.0, tolerance=1e-10)
    scene.fix("left", "x", velocity=0.1)
    motion = tawami.Dynamics(scene)
    motion.step(1e-5)
    t = scene.particles.x[:, 0] / grid.h
    mass = motion.mass @ np.where(t < 1, (1 - t) ** 2, 0.0)
    assert motion.energies.impact == pytest.approx(0.5 * mass * 0.1**2, rel=1e-9)
    assert motion.energies.external == pytest.approx(mass * 0.1**2, rel=0.05)


@pytest.mark.parametrize(("form", "bound"), [("u", 1e-9), ("u_finite", 1.5e-3)])
def test_the_work_of_a_support_that_moves_off_the_lines_of_the_grid_is_known(form, bound):
    """A block is compressed by 8 %: round-off at small strain, 2 % before where particles move."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-0.3, -0.375), h=0.125, cells=(13, 10))
    body = tawami.box(grid, (0, 0), (1, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    options = {} if form == "u" else {"ghost_penalty": "on"}
    scene = tawami.Scene(grid, body, law, form=form, density=1e3, tolerance=1e-10, **options)
    scene.fix("left", "x", velocity=lambda t: 0.5 * min(t / 0.02, 1.0))
    scene.fix("right", "x")
    motion = tawami.Dynamics(scene)
    motion.run(0.17, 0.005)
    assert abs(motion.energies.integration) < bound * motion.energies.external


def test_the_energy_of_removed_particles_is_counted():
    scene = block(leaving="remove")
    motion = tawami.Dynamics(scene, velocity=(10.0, 0.0))
    motion.run(0.1, 0.01)
    e = motion.energies
    assert e.left == pytest.approx(0.5 * 250 * 100 * len(scene.left) / 64, rel=1e-6)
    assert abs(e.transfer) + abs(e.integration) < 1e-6 * e.kinetic


@pytest.mark.parametrize("form", ["u", "u_epsv_finite"])
def test_what_the_script_removes_takes_its_mass_momentum_and_energy(form):
    """A block in flight: the rest flies on as before, and the balance has no other term."""
    scene = block(form, tolerance=1e-9)
    scene.gravity((0, -G))
    motion = tawami.Dynamics(scene, velocity=(2.0, 1.0))
    motion.run(0.05, 0.01)
    before, momentum = motion.energies, motion.linear_momentum
    removed = scene.remove(lambda x, y: y > scene_middle(scene))
    assert removed.mass == pytest.approx(125.0, rel=1e-9)
    speed = np.array([2.0, 1.0 - 0.05 * G])
    assert removed.momentum == pytest.approx(125.0 * speed, rel=1e-6)
    assert motion.linear_momentum == pytest.approx(momentum - removed.momentum, rel=1e-9)
    assert removed.kinetic == pytest.approx(0.5 * before.kinetic, rel=1e-6)
    assert scene.left[0][2] == pytest.approx(0.05)
    motion.run(0.1, 0.01)
    e = motion.energies
    assert e.left == pytest.approx(removed.kinetic, rel=1e-6)
    speed[1] -= 0.05 * G
    assert motion.linear_momentum == pytest.approx(125.0 * speed, rel=1e-6)
    assert e.kinetic == pytest.approx(62.5 * speed @ speed, rel=1e-6)
    assert abs(e.transfer) + abs(e.integration) + abs(e.impact) + e.elastic < 1e-6 * e.kinetic


def scene_middle(scene):
    return scene.particles.x[:, 1].mean() if scene.form.strain.finite else 0.0


def test_a_removal_and_a_new_law_at_rest_leave_no_energy_error():
    """A loaded block loses its upper half and gets another law: the oscillation keeps its balance."""
    scene = falling_on_the_floor()
    scene.gravity((0.0, -G))
    tawami.settle(scene)
    motion = tawami.Dynamics(scene)
    motion.run(0.002, 0.001)
    before = motion.energies
    removed = scene.remove(lambda x, y: y > 0.25)
    elastic = motion.elastic_energy
    assert before.elastic - elastic == pytest.approx(removed.elastic, rel=1e-9)
    scene.change_material(lambda x, y: y > -1, tawami.linear_elastic(E=5e4, nu=0.3))
    assert motion.elastic_energy == pytest.approx(2 * elastic, rel=1e-6)
    motion.run(0.004, 0.001)
    e = motion.energies
    assert e.left == pytest.approx(removed.elastic + removed.kinetic, rel=1e-9)
    assert e.kinetic > 5e-3 * elastic  # it rebounds
    assert abs(e.integration) < 1e-3 * elastic
    gained = e.kinetic + e.elastic + e.left - before.kinetic - before.elastic
    lost = sum(
        getattr(e, name) - getattr(before, name) for name in ("transfer", "impact", "integration")
    )
    assert gained + lost == pytest.approx(e.external - before.external, rel=1e-9)


def test_spurious_energy_gives_one_warning():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        growth = Growth(1.0)
        for has in (1.0, 1.04, 1.2, 1.3):
            growth.check(Energies(kinetic=has), 3, 0.1)
        given = Growth(1.0)
        given.add(0.3)
        given.check(Energies(kinetic=1.2, elastic=0.5, external=0.4), 3, 0.1)
    assert [w.category for w in caught] == [tawami.EnergyWarning]
    assert "after 3 steps, at 0.1 s, the body has 0.2 J/m more energy" in str(caught[0].message)


def test_static_steps_between_those_of_a_motion_are_counted():
    """A load that is released in statics leaves no spurious energy; then the block stays at rest."""
    scene = falling_on_the_floor()
    push = scene.load(scene.particles.x[:, 1] > 0.4, (0.0, -100.0))
    motion = tawami.Dynamics(scene)
    tawami.settle(scene)
    motion.run(0.01, 0.005)
    begin = motion.energies
    assert begin.external == pytest.approx(begin.elastic, rel=1e-6)
    push.change((0.0, -300.0))
    tawami.settle(scene)
    motion.run(0.02, 0.005)
    end = motion.energies
    assert end.elastic == pytest.approx(9 * begin.elastic, rel=0.05)
    assert end.external == pytest.approx(end.elastic, rel=1e-6)
    assert abs(end.integration) + end.kinetic < 1e-6 * end.elastic


def shaken(form: str, support: str, dt: float, cells: int = 4) -> tuple[Energies, int]:
    """The balance of a block that its support shakes, and the number of warnings."""
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0, 0), h=0.5 / cells, cells=(2 * cells, 3 * cells // 2)
    )
    body = tawami.box(grid, (0.0, 0.0), (0.5, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e5, nu=0.3)
    scene = tawami.Scene(grid, body, law, form=form, density=1000.0, tolerance=1e-10)

    def speed(t):
        return 0.02 * np.sin(40 * t) ** 2

    if support == "point":
        scene.hold((0.25, 0.25), "x", velocity=speed)
        scene.hold((0.25, 0.25), "y")
        scene.hold((0.3, 0.05), "y")
    else:
        scene.fix("left", "x", velocity=speed)
        if support == "edge and wall":
            scene.wall("bottom", separates=False)
            scene.gravity((3.0, -5.0), amplitude=lambda t: np.sin(30 * t))
        else:
            scene.fix("left", "y")
    motion = tawami.Dynamics(scene)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        motion.run(0.2, dt)
    return motion.energies, len(caught)


@pytest.mark.parametrize("support", ["edge", "point", "edge and wall"])
def test_the_work_of_moving_supports_is_that_of_their_mean_force(support):
    """At small strain the trapezoidal rule conserves energy exactly, whatever the step."""
    energies, warned = shaken("u", support, 0.01)
    assert energies.external > 0.01
    assert abs(energies.integration) < 1e-9 * energies.external
    assert not warned


@pytest.mark.parametrize("cells", [4, *(pytest.param(n, marks=pytest.mark.slow) for n in (8, 16))])
def test_the_remainder_at_finite_strain_is_an_independent_sum(cells, monkeypatch):
    """1/2 sum (f0 - m a) u of all steps, a mapped from the particles to a grid that was reset: the
    supports cannot exert what of f0 - m a is no combination of their means. The rest falls with dt^2.
    """
    lost, accept = [], NewmarkStep.accept

    def counted(step, accepted):
        u = accepted.u.ravel()
        missing = step._first[: u.size] - step._internal[: u.size]
        missing -= step._masses * step._start.a.ravel()
        missing[accepted.problem.reduction.fixed[: u.size]] = 0.0
        lost.append(0.5 * (missing @ u - step._start.impulses.work(missing, u)))
        return accept(step, accepted)

    monkeypatch.setattr(NewmarkStep, "accept", counted)
    energies, _ = shaken("u_finite", "edge", 0.005, cells)
    print(f"{cells} cells: {energies}")
    assert energies.integration == pytest.approx(sum(lost), abs=1e-4 * energies.external)
    assert energies.integration > 1e-3 * energies.external
