"""The border where particles are removed: what remains of loads, supports and obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

WIDTH, H, PUSH = 2.0, 0.25, 1e3


def ground(form="u_epsv", per_axis=2, at=0.0, E=1e9, **options):
    """A ground of 2 m x 1 m, whose sides lie anywhere in the cells, on a rough base."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-at, 0), h=H, cells=(9, 6))
    body = tawami.box(grid, (0, 0), (WIDTH, 1), per_axis=per_axis)
    law = tawami.linear_elastic(E=E, nu=0.3)
    scene = tawami.Scene(grid, body, law, form=form, **options)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def middles(scene, axis=0):
    """Half way between neighbours along the top, or for axis = 1 along the right side."""
    x = np.asarray(scene.particles.x)
    near = x[:, 1] > 1 - H if axis == 0 else x[:, 0] > WIDTH - H / 4
    along = np.unique(x[near, axis].round(12))
    return (along[1:] + along[:-1]) / 2


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
@pytest.mark.parametrize(("per_axis", "at"), [(2, 0.0), (2, 0.07), (3, 0.0), (3, 0.11)])
def test_a_surcharge_stays_on_what_remains_of_the_ground(form, per_axis, at):
    """A dead load, and one made later, on half of the ground to within half a distance of particles."""
    spacing = H / per_axis
    for cut in (0.9, 1.0, 1.1):
        scene = ground(form, per_axis, at)
        scene.traction("top", (0.0, -PUSH))
        scene.traction(scene.border.x[:, 1] == 1.0, (0.0, -PUSH))  # a mask
        half_way = middles(scene)
        gone = scene.particles.number[np.asarray(scene.particles.x)[:, 0] > cut].astype(int)
        edge = half_way[np.abs(half_way - cut).argmin()]
        scene.solve()
        scene.remove(gone)
        left = 2 * PUSH * edge
        assert left == pytest.approx(2 * PUSH * cut, abs=2 * PUSH * (spacing / 2 + 1e-9))
        assert scene.solve().reaction("bottom")[1] == pytest.approx(left, rel=1e-5)
        scene.traction("top", (0.0, -PUSH))
        scene.traction(lambda x, y: (y > 0.999) & (x > 0.5), (0.0, -PUSH))
        more = PUSH * (2 * edge - 0.5)
        assert scene.solve().reaction("bottom")[1] == pytest.approx(left + more, rel=1e-5)


def test_moments_of_what_remains_are_exact():
    """A load on each side of a trench, and the lengths of all parts of the border, after two stages."""
    scene = ground(per_axis=3, at=0.07)
    push = scene.traction("top", (0.0, -PUSH))
    side = scene.traction("right", (-PUSH, 0.0))
    x, y = middles(scene), middles(scene, 1)
    scene.solve()
    for a, b, depth in ((x[7], x[9], 0.8), (x[4], x[12], 0.3)):
        scene.remove(lambda px, py, a=a, b=b, d=depth: (px > a) & (px < b) & (py > d))
        points = push.points
        assert points.reference.sum() == pytest.approx(WIDTH - (b - a), rel=1e-12)
        moment = (a**2 + WIDTH**2 - b**2) / 2
        assert points.reference @ points.x[:, 0] == pytest.approx(moment, rel=1e-3)
        everything = scene.border.x
        assert not ((everything[:, 0] > a) & (everything[:, 0] < b) & (everything[:, 1] > 0)).any()
    assert side.points.reference.sum() == pytest.approx(1.0, rel=1e-12)
    push.release()
    scene.remove(lambda px, py: py > y[8])
    assert side.points.reference.sum() == pytest.approx(y[8], rel=1e-12)
    assert side.points.reference @ side.points.x[:, 1] == pytest.approx(y[8] ** 2 / 2, rel=1e-2)


def test_a_removed_crust_takes_its_load_with_it():
    """Its cells still hold particles, but the load stood on what is gone."""
    scene = ground()
    push = scene.traction("top", (0.0, -PUSH))
    scene.solve()
    crust = np.asarray(scene.particles.x)[:, 1] > 0.9
    with pytest.raises(tawami.SupportError, match=r"traction\('top'\) would load no particles"):
        scene.remove(crust)
    push.release()
    scene.remove(crust)
    assert scene.solve().reaction("bottom")[1] == pytest.approx(0.0, abs=1e-3 * PUSH)


def test_half_of_a_loaded_ring_of_arcs_stays():
    """Arcs are cut where their particles end."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1.2, -1.2), h=0.2, cells=(12, 12))
    disc = tawami.disc(grid, (0, 0), 1.0, per_axis=4)
    scene = tawami.Scene(grid, disc, tawami.linear_elastic(E=1e9, nu=0.3), ghost_penalty="on")
    before = scene.traction("outer", (0.0, -PUSH))
    scene.remove(lambda x, y: x > 0.0)
    after = scene.traction("outer", (0.0, -PUSH))
    for load in (before, after):
        assert load.points.reference.sum() == pytest.approx(np.pi, abs=0.2 / 4 / 2)


def test_what_remains_moves_with_the_body():
    """Points and pieces after a body was stretched, then cut half way between its particles."""
    scene = ground("u_epsv_finite", 2, E=1e6)
    high = np.asarray(scene.particles.x)[:, 1] > 1 - H / 3
    top_row = scene.particles.number[high]
    at_start = middles(scene)[7]
    for handle in list(scene.configuration.supports.all):
        handle.release()
    top = scene.traction("top", (0.0, 0.0))
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    pull = scene.fix("right", "x", 0.1)
    tawami.ramp(scene, 0.5)
    x = np.asarray(scene.particles.x)[:, 0]
    upper = np.sort(x[np.isin(scene.particles.number, top_row)])
    edge = (upper[7] + upper[8]) / 2
    pull.release()
    scene.remove(lambda x, y: x > edge)
    new = scene.traction("top", (0.0, 0.0))
    assert top.points.length.sum() == pytest.approx(edge, rel=5e-3)
    assert new.points.length.sum() == pytest.approx(edge, rel=5e-3)
    assert top.points.reference.sum() == pytest.approx(at_start, rel=5e-3)
