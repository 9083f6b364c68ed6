"""Handles of loads and supports: what changes and releases do, in statics."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import beam

import tawami
from tawami.base.errors import SupportError

G = 10.0


def block(form="u_epsv", **options):
    """A block of 1 m on the bottom of the grid, its weight 10 N/m for a gravity of 10 m/s2."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(6, 5))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    law = tawami.linear_elastic(E=1e4, nu=0.3)
    scene = tawami.Scene(grid, body, law, form=form, density=1.0, **options)
    scene.fix("bottom", "y")
    scene.fix("left", "x")
    return scene


def floor(scene):
    return scene.solve().reaction("bottom")[1]


#: Ways to load the block downwards with a force [N/m], and to change it.
LOADS = {
    "gravity": lambda s, f, **given: s.gravity((0.0, -f), **given),
    "load": lambda s, f, **given: s.load(s.particles.x[:, 1] > 0.8, (0.0, -f), **given),
}


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
@pytest.mark.parametrize("name", LOADS)
def test_loads_add_up_change_and_are_released(name, form):
    scene = block(form)
    make = LOADS[name]
    first, second = make(scene, 4.0), make(scene, 3.0)
    assert floor(scene) == pytest.approx(7.0, rel=1e-4)
    first.change((0.0, -1.0))
    assert floor(scene) == pytest.approx(4.0, rel=1e-4)
    second.release()
    assert floor(scene) == pytest.approx(1.0, rel=1e-4)
    first.change((0.0, -2.0))
    first.release()
    assert floor(scene) == pytest.approx(0.0, abs=1e-4)
    assert scene.configuration.loads.all == []


def test_tractions_add_up_change_and_are_released():
    scene = beam()
    for component in "xy":
        scene.fix("left", component)
    first = scene.traction("right", (0.0, lambda x, y: 2.0 + 0 * x))
    second = scene.traction("right", (0.0, 1.0))
    assert scene.solve().reaction("left")[1] == pytest.approx(-4.5, rel=1e-6)
    first.change((0.0, -3.0))
    assert scene.solve().reaction("left")[1] == pytest.approx(3.0, rel=1e-6)
    first.release()
    second.release()
    assert np.abs(scene.solve().u).max() < 1e-9


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_changes_and_releases_are_applied_in_shares_by_a_ramp(form):
    scene, found = block(form), []
    weight = scene.gravity((0.0, -G))
    push = scene.load([0, 1], (0.0, -2.0))
    scene.solve()
    weight.change((0.0, -2 * G))
    push.release()
    assert "force on 2 particles until it fades" in scene.header()
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("bottom")[1]))
    assert found == pytest.approx([16.0, 20.0], rel=1e-4)
    assert "force" not in scene.header()


def test_a_ramp_that_stops_keeps_what_it_reached():
    """A change by -12 that is given up at half its way, and taken back."""
    scene = block()
    weight = scene.gravity((0.0, -4.0))
    scene.solve()
    weight.change((0.0, -16.0))

    def stop(solution):
        if solution.load == 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tawami.ramp(scene, 0.5, each=stop)
    found = []
    weight.change((0.0, -4.0))
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("bottom")[1]))
    assert found == pytest.approx([7.0, 4.0], rel=1e-4)  # from the middle, 10


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_supports_change_and_are_released(form):
    scene = block(form)
    plate = scene.hold((0.5, 1.0), "y", -0.01)
    scene.solve()
    plate.change(-0.02)
    tawami.ramp(scene, 0.5)
    top = scene.particles.displacement[:, 1].min()
    place = (
        plate.place[1] - 1.0 if form == "u_epsv_finite" else scene.solve().displacement((0.5, 1))[1]
    )
    assert place == pytest.approx(-0.02, rel=1e-9)
    assert scene.solve().reaction((0.5, 1.0))[1] < 0
    plate.release()
    assert scene.solve().reaction("bottom")[1] == pytest.approx(0.0, abs=1e-3)
    assert scene.particles.displacement[:, 1].min() > 0.1 * top


def test_a_displacement_along_an_edge_changes_from_a_profile_to_a_number():
    scene = beam()
    scene.fix("left", "y")
    side = scene.fix("left", "x", lambda x, y: 1e-3 * y)
    scene.solve()
    side.change(2e-3)
    scene.solve()
    assert scene.particles.displacement == pytest.approx(np.tile([2e-3, 0.0], (108, 1)), abs=1e-12)


def test_a_wall_changes_its_friction():
    scene = block()
    scene.release("bottom")
    scene.release("left")
    wall = scene.wall("bottom", 0.0)
    scene.hold((0.0, 0.5), "x")
    scene.gravity((0.0, -G))
    push = scene.load(scene.particles.x[:, 1] < 0.2, (2.0, 0.0))
    assert scene.solve().reaction("bottom") == pytest.approx([0.0, 10.0], abs=1e-4)
    wall.change(0.5)
    push.change((4.0, 0.0))
    assert scene.solve().reaction("bottom")[0] < -0.1
    wall.release()
    assert scene.configuration.supports.walls == []
    with pytest.raises(tawami.InputError, match="was called after its release"):
        wall.change(0.1)


@pytest.mark.parametrize("where", ["edge", "point"])
def test_contradicting_supports_are_named(where):
    scene = block()
    if where == "edge":
        scene.fix("left", "x", 1e-3)
        words = r"fix\('left'\) x and fix\('left'\) x = 0.001 m prescribe .* by 0.001 m"
    else:
        scene.hold((0.5, 1.0), "y")
        scene.hold((0.5, 1.0), "y", 1e-3)
        words = (
            r"hold\(point=\(0.5, 1\)\): hold\(point=\(0.5, 1\)\) already give this point .* 0.001 m"
        )
    with pytest.raises(SupportError, match=words):
        scene.solve()
    scene.configuration.supports.all[-1].change(0.0)  # as the message advises
    scene.solve()
    scene.configuration.supports.all[-1].release()
    scene.solve()


def test_a_change_that_fails_has_changed_nothing():
    scene = block()
    weight, side = scene.gravity((0.0, -G)), scene.fix("left", "x")
    identity = scene.identity()
    for call, words in (
        (lambda: weight.change(), r"gravity \(0, -10\) m/s2.change\(\): expected a value, an amp"),
        (lambda: weight.change(3.0), "expected two numbers"),
        (lambda: weight.change((0.0, np.nan)), "expected a finite number"),
        (lambda: weight.change(amplitude=lambda t: 1j), "amplitude at 0 s = 1j: expected a number"),
        (lambda: side.change("held"), "expected a number or a function"),
        (lambda: side.change(velocity=1.0), "it was made with a value: expected a value; release it"),
        (lambda: scene.fix("left", "x", amplitude=1.0, velocity=1.0), "amplitude or a velocity, not"),
        (lambda: scene.gravity((0.0, 1.0), amplitude="slow"), "at 0 s = 'slow': expected a number"),
    ):  # fmt: skip
        with pytest.raises(tawami.InputError, match=words):
            call()
    assert scene.identity() == identity
    weight.release()
    for call in (weight.release, lambda: weight.change((0.0, 1.0))):
        with pytest.raises(tawami.InputError, match="was called after its release: expected a new"):
            call()
    with pytest.raises(AttributeError):
        weight.value = (0.0, 1.0)


def test_functions_of_position_are_part_of_the_identity():
    """So a run is not resumed with another profile; the same one in another object is the same."""

    def identity(slope):
        scene = beam()
        scene.traction("right", (0.0, lambda x, y: slope * y), amplitude=lambda t: slope * t)
        scene.fix("left", "x", lambda x, y: slope * y)
        facts = scene.identity()
        return facts["loads"], facts["supports"]

    assert identity(1.0) == identity(1.0)
    for one, other in zip(identity(1.0), identity(2.0), strict=True):
        assert one != other


def test_versions_tell_that_handles_have_changed():
    """Data that others keep for a set of loads or supports is valid while these numbers stay."""
    scene = block()
    loads, supports = scene.configuration.loads, scene.configuration.supports
    weight, side, wall = scene.gravity((0.0, -G)), scene.fix("left", "x"), scene.wall("bottom")
    seen = [(loads.version, supports.version)]
    for act in (
        lambda: weight.change((0.0, 0.0)),
        weight.release,
        lambda: side.change(0.1),
        side.release,
        lambda: wall.change(0.1),
        wall.release,
    ):
        act()
        seen.append((loads.version, supports.version))
    assert len(set(seen)) == len(seen)


def test_a_load_is_shared_by_volume():
    """A force on a whole disc equals its weight, in cut cells too, whose particles are smaller."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.25, cells=(8, 8))
    body = tawami.disc(grid, (0, 0), 0.9)
    assert body.volume.max() > 2 * body.volume.min()
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e7, nu=0.3), density=2.0)
    scene.load(np.ones(len(body.volume), dtype=bool), (3.0 * body.volume.sum(), 0.0))
    forces = scene.configuration.external()
    (load,) = scene.configuration.loads.all
    load.release()
    scene.gravity((1.5, 0.0))  # the same force on each volume
    np.testing.assert_allclose(forces, scene.configuration.external(), rtol=0, atol=1e-12)
