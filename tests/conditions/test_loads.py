"""Tractions and steps of loading."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import beam, greville, grid_of

import tawami


@pytest.mark.parametrize("edge", ["left", "right", "bottom", "top"])
def test_a_traction_adds_up_to_its_integral(edge, basis):
    """A parabola along part of each edge: total force and moment."""
    grid = grid_of((6, 5))
    lower = (grid.origin[0], 1.0) if edge != "bottom" else grid.origin
    upper = (grid.upper[0] if edge == "right" else 1.5, 2.5 if edge != "top" else grid.upper[1])
    body = tawami.box(grid, lower, upper, per_axis=3)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u", basis=basis)
    scene.traction(edge, (lambda x, y: 1 + x * y + x**2 + y**2, lambda x, y: -2 * x + y))
    force = scene.configuration.external().reshape(-1, 2)
    along = 1 if edge in ("left", "right") else 0
    t, w = np.polynomial.legendre.leggauss(4)
    half = (upper[along] - lower[along]) / 2
    s = lower[along] + half * (1 + t)
    fixed = np.full(4, {"left": lower[0], "right": upper[0]}.get(edge, 0.0)
                    if along == 1 else {"bottom": lower[1], "top": upper[1]}[edge])  # fmt: skip
    x, y = (fixed, s) if along == 1 else (s, fixed)
    expected = [half * w @ (1 + x * y + x**2 + y**2), half * w @ (-2 * x + y)]
    np.testing.assert_allclose(force.sum(axis=0), expected, rtol=1e-12, atol=1e-14)
    points = [grid.origin[a] + grid.h * greville(basis, grid.cells[a]) for a in range(2)]
    lever = (
        np.tile(points[0], len(points[1])) if along == 0 else np.repeat(points[1], len(points[0]))
    )
    moment = half * w @ ((1 + x * y + x**2 + y**2) * s)
    assert lever @ force[:, 0] == pytest.approx(moment, rel=1e-12)


def test_loading_in_two_steps_equals_loading_in_one():
    def fixed():
        scene = beam(tolerance=1e-12)
        scene.fix("left", "x", 1e-3)
        scene.fix("left", "y")
        return scene

    at_once = fixed()
    at_once.traction("right", (2.0, -1.0))
    once = at_once.solve()
    stepwise = fixed()
    stepwise.traction("right", (1.5, 0.0))
    stepwise.solve()
    stepwise.traction("right", (0.5, -1.0))
    twice = stepwise.solve()
    np.testing.assert_allclose(twice.u, once.u, rtol=0, atol=1e-9 * np.abs(once.u).max())
    scale = np.abs(at_once.particles.stress).max()
    np.testing.assert_allclose(
        stepwise.particles.stress, at_once.particles.stress, rtol=0, atol=1e-9 * scale
    )
    # nothing left to do: no iteration, no change
    before = np.array(stepwise.particles.stress)
    assert stepwise.solve().iterations == 0
    np.testing.assert_allclose(stepwise.particles.stress, before, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("width", [1.0, 1.28])
def test_a_part_of_an_edge_is_loaded_and_held(width):
    """Parts of the border end anywhere in the cells, and the held one carries the load."""
    grid = grid_of((4, 3))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=10.0, nu=0.3), basis="bilinear")
    for component in ("x", "y"):
        scene.fix(lambda x, y: (y == 0.5) & (x < width - 1.0), component)
    scene.traction(lambda x, y: (y == 2) & (abs(x) < width / 2), (0.0, -3.0))
    force = scene.configuration.external()[: 2 * 20].reshape(-1, 2)
    assert force[:, 1].sum() == pytest.approx(-3.0 * width, rel=1e-12)
    loaded = np.flatnonzero(np.abs(force[15:, 1]) > 1e-12).tolist()  # cells of .5 m from x = -1 m
    assert loaded == ([1, 2, 3] if width == 1.0 else [0, 1, 2, 3, 4])
    assert not scene.reduction().fixed.any()
    reaction = scene.solve().reaction("bottom")
    assert reaction == pytest.approx([0.0, 3.0 * width], abs=1e-5)
