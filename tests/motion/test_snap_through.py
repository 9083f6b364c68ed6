"""A shallow truss of two bars snaps through (von Mises 1923): one half of it, at finite strain."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

SPAN, RISE, DEPTH = 8.0, 0.35, 0.5  # of one bar [m]
E, H = 1e3, 0.25  # [Pa], [m]


def bar() -> tuple[tawami.Scene, int]:
    """A bar with a pin at its lower end, a slider at its upper one, and a load of 1 N/m on it; and the
    particle next to the slider.
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-0.5, -1.5), h=H, cells=(36, 10))
    end = np.array([SPAN, RISE])
    along = end / np.linalg.norm(end)
    side = DEPTH / 2 * np.array([-along[1], along[0]])
    body = tawami.polygon(grid, [-side, end - side, end + side, side], per_axis=3)
    law = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", ghost_penalty="on")
    scene.hold((0.0, 0.0), "x")
    scene.hold((0.0, 0.0), "y")
    scene.hold((SPAN, RISE), "x")
    scene.load(body.x @ along > end @ along - H, (0.0, -1.0))
    return scene, int(np.linalg.norm(body.x - end, axis=1).argmin())


def closed_form(deflection):
    """Load at a deflection of the slider: E ln(length / length_0) acts along a bar of constant area
    per length_0, and the load is the derivative of its energy.
    """
    at_rest, length = np.hypot(SPAN, RISE), np.hypot(SPAN, RISE - deflection)
    return -E * DEPTH * at_rest * np.log(length / at_rest) / length**2 * (RISE - deflection)


def followed(control, size, to):
    """Deflections of the slider and loads along the path."""
    scene, tip = bar()
    curve = []
    steps = tawami.follow(
        scene, control, size=size, to=to,
        each=lambda s: curve.append((-s.displacement_of_particles[tip, 1], s.load)),
    )  # fmt: skip
    assert steps.complete
    return np.array(curve).T


@pytest.fixture(scope="module")
def by_arc_length():
    return followed("arc length", 0.03, 0.51)


def test_the_load_rises_falls_below_zero_and_rises_again(by_arc_length):
    deflection, load = by_arc_length
    assert (np.diff(deflection) > 0).all()  # it does not turn back
    turns = np.flatnonzero(np.diff(np.sign(np.diff(load)))) + 1
    assert len(turns) == 2
    highest, lowest = turns
    assert load[highest] > 0 > load[lowest]
    assert load[-1] > 3 * load[highest]  # on the far side the bar is in tension


def test_the_path_is_that_of_two_bars(by_arc_length):
    deflection, load = by_arc_length
    limit = closed_form(np.linspace(0, RISE, 2001)).max()
    off = np.abs(load - closed_form(deflection)) / limit
    snapping = deflection < 1.9 * RISE
    # bars of a continuum also bend, and give way at their pins
    assert off[snapping].max() < 0.09
    print(f"off by {100 * off[snapping].max():.1f} % of the limit load {limit:.5f} N/m")


def test_a_point_follows_the_same_path(by_arc_length):
    # the seventh step ends where the bars are flat, and supports do not hold them to first order
    deflection, load = followed(((SPAN, RISE), "y"), 0.05, -0.9)
    fitted = np.polynomial.Polynomial.fit(*by_arc_length, 7)
    apart = np.abs(load - fitted(deflection))
    largest = apart[deflection < 1.9 * RISE].max() / load[deflection < RISE].max()
    assert largest < 0.02
    print(f"apart by {100 * largest:.2f} % of the limit load")
