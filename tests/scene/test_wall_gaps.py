"""Walls at a distance from the border of the body: a warning, and what it advises."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from mpi4py import MPI

import tawami

E, NU, RHO, G, HEIGHT, H = 1e6, 0.3, 1000.0, 10.0, 1.5, 0.25


def advised(caught, scene, **names):
    """The obstacle of the one warning, made in a scene."""
    [message] = [str(one.message) for one in caught]
    [code] = re.findall(r"scene\.obstacle\(tawami\.half_plane\(.*?\)\), [\d.]+\)", message)
    [point] = re.findall(r"with the point (\(.*?\))", message)
    if names.get("statics"):
        code = re.sub(r"half_plane\(\(.*?\)", f"half_plane({point}", code, count=1)
    return eval(code, {"scene": scene, "tawami": tawami})


@pytest.mark.parametrize("edge", ["bottom", "left"])
@pytest.mark.parametrize("gap", [1e-4, 0.02, 0.1, 0.2, 0.3])
def test_a_block_under_its_weight_needs_the_obstacle_of_the_warning(edge, gap):
    """The settlement is rho g H^2 / 2 M at any gap, M the modulus in one-dimensional strain."""
    turned = (lambda x, y: (y, x)) if edge == "left" else (lambda x, y: (x, y))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=turned(0.0, -gap), h=H, cells=turned(8, 9))
    body = tawami.box(grid, (0, 0), turned(2.0, HEIGHT), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), density=RHO)
    for side in turned(("left", "right"), ("bottom", "top"))[0]:
        scene.fix(side, "y" if edge == "left" else "x")
    scene.gravity(turned(0.0, -G))
    acts = "acts already" if gap < H else "never acts"
    with pytest.warns(tawami.SupportWarning, match=rf"{gap:g} m = .* h away.*{acts}") as caught:
        wall = scene.wall(edge)
    wall.release()
    advised(caught, scene, statics=True)
    modulus = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    exact = -RHO * G * HEIGHT**2 / 2 / modulus
    settlement = scene.solve().displacement(turned(1.0, HEIGHT - 1e-4))
    assert settlement[0 if edge == "left" else 1] == pytest.approx(exact, rel=1e-3)


def first_push(scene, dt=4e-3, end=0.24):
    """Time and height of the border when something pushes a falling body first."""
    motion, found = tawami.Dynamics(scene), []

    def look(solution):
        fall = -scene.mass.sum() * G * motion.time
        if not found and motion.linear_momentum[1] > fall * 0.99:
            found.append((motion.time, scene.border.x[:, 1].min()))

    motion.run(end, dt, each=look)
    return found[0]


def falling(rows):
    """A block 0.25 m above y = 0, with rows of cells below that."""
    h = H / 2
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, -rows * h), h=h, cells=(8, 6 + rows))
    body = tawami.box(grid, (0.25, 0.25), (0.75, 0.75), per_axis=2)
    law = tawami.linear_elastic(E=E, nu=NU)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=RHO)
    scene.gravity((0.0, -G))
    return scene


def test_a_falling_block_lands_on_the_obstacle_of_the_warning():
    """It falls for sqrt(2 h / g); a wall stops it most of a cell earlier."""
    scene, fall = falling(0), np.sqrt(2 * 0.25 / G)
    scene.wall("bottom", 0.3)  # no warning yet
    with pytest.warns(tawami.SupportWarning, match="the wall pushed it in a step") as caught:
        time, gap = first_push(scene)
    assert time < 0.9 * fall
    assert gap > 0.5 * H / 2
    scene = falling(1)
    obstacle = advised(caught, scene)
    assert obstacle.friction == 0.3
    time, gap = first_push(scene)
    assert time == pytest.approx(fall, abs=2.1 * 4e-3)
    assert abs(gap) < 0.05 * H / 2


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_a_body_on_the_wall_gets_no_warning(form):
    """Also one that slides, a disc that touches it at one place, and loose particles."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(8, 8))
    box = tawami.box(grid, (0.5, 0.0), (1.0, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=E, nu=NU)
    loose = tawami.box(grid, (0.5, 0.1), (1.0, 0.6), per_axis=2)
    for body in (box, tawami.disc(grid, (1, 0.53), 0.53), tawami.Body(loose.x, loose.volume)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", tawami.QuadratureWarning)
            scene = tawami.Scene(grid, body, law, form=form, density=RHO)
            scene.gravity((0.0, -G))
            scene.wall("bottom", 0.2)
            tawami.Dynamics(scene, velocity=(0.5, 0.0)).run(0.02, 5e-3)
