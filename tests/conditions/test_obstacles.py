"""Rigid obstacles in statics."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from pressed import HALF, Pressed

import tawami
from cases.costs.contact import block, dragged

E, NU, HEIGHT = 1e6, 0.3, 0.9
M = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
DOWN = (0.0, -1.0)


def column(form="u", h=0.25, **options):
    """A body 1 m wide and .9 m high that cannot expand sideways; its top cuts the cells."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=h, cells=(round(1 / h), round(1.25 / h)))
    body = tawami.box(grid, (0.0, 0.0), (1.0, HEIGHT), per_axis=3)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), form=form, **options)
    scene.fix("bottom", "y")
    scene.fix("left", "x")
    scene.fix("right", "x")
    return scene


def plate(gap=0.0):
    return tawami.half_plane((0.5, HEIGHT + gap), DOWN)


@pytest.mark.parametrize("form", ["u", "u_epsv"])
def test_a_plate_under_a_force_presses_a_column(form):
    scene, force = column(form), 1e4
    plane = scene.obstacle(plate(), force=(0.0, -force), free="y")
    solution = scene.solve()
    contact = solution.contact(plane)
    assert contact.force == pytest.approx([0.0, force], abs=1e-6 * force)
    assert contact.moment == pytest.approx([0.0], abs=1e-4 * force)
    assert solution.reaction("bottom") == pytest.approx([0.0, force], abs=1e-6 * force)
    assert solution.reaction(plane) == pytest.approx([0.0, -force], abs=1e-6 * force)
    moved = plane.x[1] - HEIGHT
    assert moved == pytest.approx(-force * HEIGHT / M, rel=1e-3)  # the top cuts cells
    assert contact.penetration < 5e-6 * 0.25 * force / (E / 2.6)
    assert solution.iterations <= 4


def test_contact_starts_when_the_gap_closes():
    scene, gap = column(), 0.01
    plane = scene.obstacle(plate(gap), displacement=(0.0, -2 * gap), name="plate")
    first = scene.solve_part(0.45)
    assert not first.contact("plate").pressure.any()
    assert first.reaction("bottom") == pytest.approx([0.0, 0.0], abs=1e-11 * M)
    last = scene.solve()
    assert last.reaction("bottom")[1] == pytest.approx(gap / HEIGHT * M, rel=1e-3)
    plane.change((0.0, 0.0))
    assert scene.solve().reaction("bottom") == pytest.approx([0.0, 0.0], abs=1e-3)


def test_an_obstacle_far_from_the_body_changes_nothing():
    scene = column()
    far = scene.obstacle(tawami.rigid_disc((0.5, HEIGHT + 3.0), 0.5))
    solution = scene.solve()
    assert not solution.contact(far).pressure.any()
    assert solution.reaction("bottom") == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("nu", [0.3, 0.4999])
@pytest.mark.parametrize(
    ("cells", "size", "error", "iterations"),
    [(4, 6, 0.03, 10), pytest.param(8, 16, 0.01, 12, marks=pytest.mark.slow)],
)
def test_pressure_of_hertz(nu, cells, size, error, iterations):
    """With 8 cells .3 and .7 %, for nu = .3 and .4999. With a ghost penalty of k = .01 it is 1.2 % for
    nu = .3.
    """
    pressed = Pressed(nu, cells, size, half=True)
    assert pressed.pressure_error() < error
    assert pressed.solution.iterations <= iterations


@pytest.mark.slow
def test_friction_of_cattaneo_and_mindlin():
    pressed = Pressed(0.4999, 8, 6, half=False)
    share, width = pressed.pulled(0.3, 0.3 / 50)
    assert width == pytest.approx(HALF * np.sqrt(1 - share), rel=0.08)
    assert 0.3 < share < 0.5
    assert pressed.solution.iterations <= 10


@pytest.mark.direct  # the iterations that just fail
@pytest.mark.filterwarnings("ignore::tawami.base.errors.SmallStrainWarning")
def test_a_drag_that_does_not_converge_at_once_does_in_the_steps_of_the_message():
    setting = ("u_epsv", "round", 1.0, 0.3, 0.25, 0.05, 0.05)
    with pytest.raises(tawami.ConvergenceError, match=r"ramp\(scene, 0.5\) moves obstacles"):
        dragged(*setting, 1.0)
    dragged(*setting, 0.5)


@pytest.mark.parametrize(
    ("form", "nu", "h", "base", "radius", "mu", "move"),
    [
        ("u_epsv", 0.3, 0.125, 0.37, 1.0, 0.0, 0.05),
        ("u_epsv", 0.4999, 0.25, 0.37, 0.3, 0.3, 0.05),
        ("u_epsv_finite", 0.4999, 0.25, 0.0, 0.3, 0.3, 0.05),
        ("u_epsv_finite", 0.3, 0.125, 0.37, 4.0, 0.0, 0.05),
        ("u_epsv_finite", 0.3, 0.25, 0.37, 1.0, 0.0, 0.01),  # does not reach a patch
    ],
)
@pytest.mark.filterwarnings("ignore::tawami.base.errors.SmallStrainWarning")
def test_newton_finds_contact_in_large_steps(form, nu, h, base, radius, mu, move):
    """Pressed by up to .4 h at once, and then by as much again."""
    scene = block(form, nu, h, base)
    shape = tawami.rigid_disc((1.0 + 0.4 * h * (move > 0.01), HEIGHT + radius), radius)
    disc = scene.obstacle(shape, mu, displacement=(0.0, -move))
    first = scene.solve()
    disc.change((0.0, -2 * move))
    last = scene.solve()
    assert last.reaction("bottom") == pytest.approx(-last.reaction(disc), abs=1e-5 * E)
    assert max(first.iterations, last.iterations) <= 20
    if not mu and "finite" not in form:  # one step leads to the same place
        scene = block(form, nu, h, base)
        disc = scene.obstacle(shape, mu, displacement=(0.0, -2 * move))
        at_once = scene.solve().reaction(disc)
        assert at_once == pytest.approx(last.reaction(disc), rel=1e-3, abs=1e-3 * abs(at_once[1]))


def test_a_free_obstacle_follows_a_force_that_falls():
    """To a thirtieth: Newton's method would lose the body without the forces that pull it back."""
    scene = block("u_epsv", 0.3, 0.25, 0.0)
    plane = scene.obstacle(tawami.half_plane((1.0, HEIGHT), DOWN), force=(0.0, -3e4), free="y")
    deep = scene.solve()
    plane.change((0.0, -1e3))
    last = scene.solve()
    assert last.reaction("bottom")[1] == pytest.approx(1e3, rel=1e-5)
    assert last.iterations <= deep.iterations + 2
    plane.change((0.0, 1e3))
    with pytest.raises(tawami.SupportError, match="does not touch the body"):
        scene.solve()


def test_a_distance_function_gives_the_contact_of_its_shape():
    forces = []
    for shape in (
        tawami.rigid_disc((0.4, HEIGHT + 2.0), 2.0),
        lambda x, y: np.hypot(x - 0.4, y - HEIGHT - 2.0) - 2.0,
    ):
        scene = column("u_epsv", h=0.125)
        disc = scene.obstacle(shape, 0.2, displacement=(0.002, -0.02))
        contact = scene.solve().contact(disc)
        forces.append(contact.force)
        assert contact.force[1] > 0
        assert abs(contact.force[0]) <= 0.21 * contact.force[1]
    assert forces[1] == pytest.approx(forces[0], rel=1e-4)


def test_a_body_may_rest_on_an_obstacle_alone():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(6, 6))
    body = tawami.box(grid, (0.1, 0.1), (1.1, 0.6), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), density=1000.0)
    scene.gravity((1.0, -10.0))
    floor = scene.obstacle(tawami.half_plane((0.0, 0.1), (0.0, 1.0)), 0.5)
    contact = scene.solve().contact(floor)
    assert contact.force == pytest.approx([500.0, -5000.0], rel=1e-5)


def test_a_restored_scene_continues_in_the_same_way():
    def made():
        scene = column("u_epsv_finite")
        return scene, scene.obstacle(plate(), 0.3, displacement=(0.01, -0.02))

    scene, plane = made()
    scene.solve_part(0.5)
    state = scene.state()
    expected = scene.solve().contact(plane)
    again, other = made()
    again.restore(state)
    found = again.solve().contact(other)
    assert found.force == pytest.approx(expected.force, rel=1e-9)
    assert found.pressure == pytest.approx(expected.pressure, rel=1e-9)
    assert other.x == pytest.approx(plane.x)
    one, another = made(), made()
    assert one[0].identity() == another[0].identity()
    another[1].change(friction=0.4)
    assert one[0].identity() != another[0].identity()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"friction": -0.1}, "friction"),
        ({"mass": 0.0}, "mass"),
        ({"free": "z"}, "free"),
        ({"force": (0.0, 1.0), "free": ()}, "is prescribed: expected free="),
        ({"displacement": (0.0, 1.0), "free": "y"}, "which is free: expected a force"),
        ({"displacement": (1.0,)}, "expected 2 or 3 numbers"),
        ({"velocity": 1.0}, "expected 2 or 3 numbers or functions"),
        ({"where": "middle"}, "no part 'middle'"),
        ({"name": ""}, "expected a text that no other obstacle has"),
    ],
)
def test_wrong_arguments_are_rejected(arguments, message):
    scene = column()
    with pytest.raises(tawami.InputError, match=message):
        scene.obstacle(plate(), **arguments)
    assert not scene.configuration.obstacles.all


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (plate(-0.05), "the body is 0.05 m inside it at"),
        (lambda x, y: 1.0, r"array of shape \(\): expected"),
        (lambda x, y: 3 * (HEIGHT + 1e-3 - y), "expected a signed distance"),
        ("plane", "expected tawami.half_plane"),
    ],
)
def test_wrong_shapes_are_rejected(shape, message):
    with pytest.raises(tawami.InputError, match=message):
        column().obstacle(shape)


def test_a_free_obstacle_must_be_held_by_contact():
    scene = column()
    scene.obstacle(plate(0.1), force=(0.0, -1.0), free="y", name="plate")
    with pytest.raises(
        tawami.SupportError, match="nothing holds its motion 'y', as it does not touch"
    ):
        scene.solve()
    scene = column()
    scene.obstacle(plate(), force=(1.0, -1.0), free=("x", "y"), name="plate")
    with pytest.raises(tawami.SupportError, match="motion 'x', as it slides freely"):
        scene.solve()


def test_an_obstacle_in_axisymmetry_moves_along_the_axis():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 4), geometry="axisymmetric")
    body = tawami.box(grid, (0.0, 0.0), (0.5, 0.9), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=0.0))
    scene.fix("bottom", "y")
    with pytest.raises(tawami.InputError, match="moves along the axis only"):
        scene.obstacle(plate(), displacement=(0.1, 0.0))
    plane = scene.obstacle(plate(), force=(0.0, -1e4))
    contact = scene.solve().contact(plane)
    assert contact.force[1] == pytest.approx(1e4, rel=1e-6)
    pressure = contact.pressure[contact.pressure > 0]
    assert pressure == pytest.approx(1e4 / (np.pi * 0.5**2), rel=0.05)


def test_the_header_names_obstacles():
    scene = column()
    scene.obstacle(plate(), 0.3, name="plate", force=DOWN, free="y")
    assert "obstacle 'plate' (halfplane) on the border, friction 0.3, free in 'y'" in scene.header()


@pytest.mark.slow
def test_a_block_between_rough_plates_is_pressed_to_half_its_height():
    """Its free sides bulge across the cells and roll onto the upper plate.

    Between smooth plates they would wrinkle: Biot (1965) finds the border of an incompressible
    half-space unstable at a compression of 46 % in plane strain.
    """
    forces = []
    for h in (0.25, 0.125, 0.0625):
        grid = tawami.Grid(
            MPI.COMM_WORLD, origin=(-1.0, 0.0), h=h, cells=(round(4 / h), round(1.25 / h))
        )
        body = tawami.box(grid, (0.0, 0.0), (2.0, 1.0), per_axis=2)
        law = tawami.linear_elastic(E=E, nu=NU)
        scene = tawami.Scene(grid, body, law, form="u_epsv_finite")
        scene.fix("bottom", "x")
        scene.fix("bottom", "y")
        top = tawami.half_plane((1.0, 1.0), DOWN)
        plate = scene.obstacle(top, np.inf, displacement=(0.0, -0.5))
        found = []
        steps = tawami.ramp(scene, 0.05, each=found.append)
        assert steps[-1].end == 1.0
        assert np.mean([step.iterations for step in steps]) < 10
        forces.append(found[-1].contact(plate).force[1])
    first, second = np.abs(np.diff(forces)) / forces[-1]
    print(
        f"force over E: {np.array(forces) / E}; differences {100 * first:.2f} and {100 * second:.2f} %"
    )
    assert max(first, second) < 0.02
