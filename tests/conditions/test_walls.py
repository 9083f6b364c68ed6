"""Walls with Coulomb friction: sliding, sticking, separation, impact, contradicting states."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.conditions.walls import Wall

G = 10.0


def block(*, slope=0.0, E=1e7, height=0.0, **wall):
    """A block of 0.5 m on a wall or above it, on a slope [degrees]."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(24, 10))
    body = tawami.box(grid, (0.5, height), (1.0, height + 0.5), per_axis=2)
    material = tawami.linear_elastic(E=E, nu=0.3)
    scene = tawami.Scene(grid, body, material, form="u_epsv_finite", density=1000.0)
    angle = np.radians(slope)
    scene.gravity((G * np.sin(angle), -G * np.cos(angle)))
    scene.wall("bottom", **wall)
    return scene


def speed(motion):
    return motion.linear_momentum / motion.mass.sum()


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.4])
def test_a_block_slides_down_a_slope(friction):
    """a = g (sin - mu cos), after the first shear wave."""
    motion = tawami.Dynamics(block(slope=30.0, friction=friction), gamma=0.7)
    motion.run(0.1, 1e-2)
    before = speed(motion)[0]
    motion.run(0.3, 1e-2)
    expected = G * (np.sin(np.pi / 6) - friction * np.cos(np.pi / 6))
    assert (speed(motion)[0] - before) / 0.2 == pytest.approx(expected, rel=0.02)
    assert abs(speed(motion)[1]) < 0.03
    lost = motion.energies.friction
    way = motion.scene.particles.displacement[:, 0].mean()
    normal = 250.0 * G * np.cos(np.pi / 6)
    assert lost == pytest.approx(friction * normal * way, rel=0.03, abs=1e-9)


def test_a_block_below_its_angle_of_friction_stays():
    scene = block(slope=30.0, friction=0.7)
    tawami.ramp(scene, 0.5)
    tawami.settle(scene, tolerance=1e-8)
    before = np.array(scene.particles.x)
    motion = tawami.Dynamics(scene)
    motion.run(0.2, 1e-2)
    assert np.abs(scene.particles.x - before).max() < 1e-6
    assert abs(speed(motion)[0]) < 1e-5


def test_friction_stops_a_sliding_block():
    """After a time v / (mu g), over a distance v^2 / (2 mu g)."""
    v, mu = 1.0, 0.5
    scene = block(friction=mu)
    motion = tawami.Dynamics(scene, velocity=(v, 0.0), gamma=0.6)
    motion.run(1.5 * v / (mu * G), 1e-2)
    way = scene.particles.displacement[:, 0].mean()
    assert way == pytest.approx(v**2 / (2 * mu * G), rel=0.03)
    assert abs(speed(motion)[0]) < 0.02


def test_a_block_leaves_a_wall_that_separates():
    found = {}
    for separates in (True, False):
        scene = block(friction=0.3, separates=separates)
        scene.configuration.loads.all[0].change((0.0, 0.0))
        motion = tawami.Dynamics(scene, velocity=(0.0, 0.5), gamma=0.7)
        motion.run(0.2, 0.01)
        found[separates] = speed(motion)[1], scene.particles.x[:, 1].min()
    assert found[True] == pytest.approx((0.5, 0.03125 + 0.1), abs=1e-9)
    assert found[False][0] < 0.4


def test_a_falling_block_bounces_with_a_balance_of_energy():
    scene = block(height=0.25, E=1e5, friction=0.0)
    motion = tawami.Dynamics(scene)
    heights = []
    motion.run(0.4, 4e-3, each=lambda s: heights.append(s.x[:, 1].min()))
    assert min(heights) > 0.0
    assert heights[-1] > min(heights) + 0.01
    e = motion.energies
    total = 0.0 + e.external - e.transfer - e.impact - e.integration
    assert e.kinetic + e.elastic == pytest.approx(total, rel=1e-9)
    assert e.external > 0.9 * 250 * G * 0.1
    assert -0.01 * e.external < e.integration < 0.12 * e.external


def test_the_reaction_of_a_wall_is_the_weight():
    scene = block(friction=0.3)
    scene.hold((0.75, 0.25), "x")
    solution = scene.solve()
    assert solution.reaction("bottom") == pytest.approx([0.0, 250.0 * G], abs=1e-2)


def test_contradicting_states_are_changed():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1.0, cells=(3, 2))
    wall = Wall(grid, "bilinear", "bottom", 0.5, True)
    active, alone = np.ones(4, dtype=bool), np.zeros((4, 2), dtype=bool)
    gap, forces, u = np.zeros((3, 4, 2))
    forces[0] = [0.4, 1.0]  # within the cone
    forces[1] = [-0.6, 1.0]  # beyond it
    forces[2] = [0.0, -1.0]  # pulls
    forces[3] = [0.5, 1.0]
    assert wall.adapt(forces, u, gap, active, alone)
    assert wall.state.touching.tolist() == [True, True, False, True]
    assert wall.state.slip.tolist() == [0, -1, 0, 0]
    assert wall.friction_of(forces, alone)[1] == pytest.approx([-0.5, 0.0])
    u[1, 0], u[2, 1] = -1.0, -1.0  # back the way friction points, and into the wall
    forces[1, 0] = -0.5
    forces[2] = 0.0
    gap[2, 1] = 1.5
    assert wall.adapt(forces, u, gap, active, alone)
    assert wall.state.touching.tolist() == [True, True, False, True]  # it is above it still
    gap[2, 1] = 0.0
    assert wall.adapt(forces, u, gap, active, alone)
    assert wall.state.touching.all()
    assert wall.state.slip.tolist() == [0, 0, 0, 0]


def test_wrong_walls_are_rejected():
    scene = block(friction=0.1)
    with pytest.raises(tawami.InputError, match="there is one already"):
        scene.wall("bottom")
    with pytest.raises(
        tawami.InputError, match="friction = -1: expected a number of at least 0, or numpy.inf"
    ):
        scene.wall("top", -1)
    with pytest.raises(tawami.InputError, match="edge 'floor': expected 'left'"):
        scene.wall("floor")
    with pytest.raises(tawami.InputError, match=r"release\('top'\): no such support.*bottom"):
        scene.release("top")
    scene.release("bottom")
    assert not scene.configuration.supports.walls


def test_a_function_that_keeps_coming_back_is_released():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1.0, cells=(3, 2))
    wall = Wall(grid, "bilinear", "bottom", 0.0, True)
    active, zero, alone = np.ones(4, dtype=bool), np.zeros((4, 2)), np.zeros((4, 2), dtype=bool)

    def changes_by(forces, u):
        return wall.adapt(forces, u, zero, active, alone)

    pulls, falls = zero.copy(), zero.copy()
    pulls[1, 1], falls[1, 1] = -1.0, -1.0
    changes = 0
    while changes_by(pulls, zero) or changes_by(zero, falls):
        changes += 1
        assert changes < 10
    assert not wall.state.touching[1]
    wall.begin()
    assert changes_by(zero, falls)


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_walls_in_a_corner_carry_the_load_once(form):
    """A block pressed into a corner."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 8))
    body = tawami.box(grid, (0, 0), (0.5, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form=form, density=1000.0)
    scene.gravity((-6.0, -G))
    wall = scene.wall("bottom", 0.2)
    scene.wall("left", 0.2)
    solution = scene.solve()
    np.testing.assert_array_equal(solution.reaction(wall), solution.reaction("bottom"))
    total = solution.reaction("bottom") + solution.reaction("left")
    assert total == pytest.approx([1500.0, 250 * G], rel=1e-4)
    assert solution.on_edges.sum(axis=0) == pytest.approx(total, rel=1e-9)
    before = solution.reaction("bottom")
    scene.release("bottom")
    np.testing.assert_array_equal(solution.reaction("bottom"), before)


def test_a_wall_knows_the_gap_in_small_strain():
    """Lifted by 1 mm and lowered by half of it, a block is still above the wall."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 8))
    body = tawami.box(grid, (0, 0), (0.5, 0.5), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e6, nu=0.3), form="u_epsv")
    scene.wall("bottom", 0.3)
    points = [(x, 0.45) for x in (0.05, 0.45)]
    for y, expected in ((1e-3, 0.0), (0.5e-3, 0.0), (-1e-4, 1.0)):
        scene.configuration.supports.all.clear()
        for point in points:
            scene.hold(point, "y", y)
        scene.hold(points[0], "x")
        push = scene.solve().reaction("bottom")[1]
        assert (push > 1.0) == bool(expected)
        assert push == pytest.approx(0.0, abs=1e-6) or expected


def test_a_piston_slides_along_a_rough_floor():
    """The moving edge prescribes the corner; the floor gives friction elsewhere."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(8, 6))
    body = tawami.box(grid, (0, 0), (0.5, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1000.0)
    scene.gravity((0.0, -G))
    scene.wall("bottom", 0.3)
    scene.fix("left", "x", velocity=0.1)
    motion = tawami.Dynamics(scene, velocity=(0.1, 0.0), gamma=0.7)
    pushes = []
    motion.run(0.3, 5e-3, each=lambda s: pushes.append(s.reaction("left")[0]))
    assert np.mean(pushes[30:]) == pytest.approx(0.3 * 250 * G, rel=0.15)
