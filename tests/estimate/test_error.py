"""Errors of quantities: parts, pictures and refusals."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from mpi4py import MPI

import tawami

H = 0.5
GRID = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(4, 2))
TIP = tawami.Goal.displacement((2.0, 0.5), "y")


def beam(law=None, form="u_epsv", body=None, **options):
    body = body or tawami.box(GRID, (0, 0), (2, 1))
    law = law or tawami.linear_elastic(E=3e6, nu=0.3)
    scene = tawami.Scene(GRID, body, law, form=form, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    return scene


def loaded(load=-1e3, **options):
    scene = beam(**options)
    scene.traction("right", (0.0, load))
    return scene


def test_a_patch_has_no_error():
    body = tawami.box(GRID, (0, 0), (2, 1), per_axis=3, gauss=True)
    scene = tawami.Scene(GRID, body, tawami.linear_elastic(E=3e6, nu=0.3))
    scene.fix("left", "x")
    scene.hold((0, 0), "y")
    scene.traction("right", (1e3, 0.0))
    solution = scene.solve()
    for goal in (
        tawami.Goal.displacement((2.0, 0.5), "x"),
        tawami.Goal.mean_displacement("right", "x"),
        tawami.Goal.mean_stress(),
    ):
        found = solution.error(goal)
        assert abs(found.error) < 1e-9 * abs(found.value)
        assert "order at round-off" in repr(found)
    exact = 2 * 1e3 * (1 - 0.3**2) / 3e6  # plane strain
    assert solution.error(tawami.Goal.mean_displacement("right", "x")).value == pytest.approx(exact)


def test_loads_that_end_inside_a_cell_are_exact():
    body = tawami.box(GRID, (0, 0), (1.8, 1), per_axis=3, gauss=True)  # 0.6 h after a line
    scene = tawami.Scene(GRID, body, tawami.linear_elastic(E=3e6, nu=0.3))
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("top", (0.0, -1e3))
    found = scene.solve().error(tawami.Goal.displacement((1.8, 1.0), "y"))
    assert abs(found.error) < 1e-9 * abs(found.value)


def test_the_parts_add_up_and_belong_to_cells():
    found = loaded().solve().error(TIP)
    assert found.error == pytest.approx(sum(found.parts.values()))
    for name, part in found.parts.items():
        assert found.cells[name].sum() == pytest.approx(part, rel=1e-9, abs=1e-18)


def test_stress_of_the_middle_by_equilibrium():
    # in bending the stress at mid-height is that of shear: no mean stress by symmetry
    middle = tawami.Goal.mean_stress(lambda x, y: abs(y - 0.5) < 0.3)
    found = loaded().solve().error(middle)
    assert abs(found.value + found.error) < 1e-6 * 1e3


def test_newton_s_tolerance_is_a_part():
    law = tawami.von_mises(tawami.linear_elastic(E=3e6, nu=0.4), yield_stress=5e3, hardening=1e6)
    tight = loaded(law=law, tolerance=1e-9).solve().displacement((2.0, 0.5))[1]
    solution = loaded(law=law, tolerance=3e-2).solve()
    off = tight - solution.displacement((2.0, 0.5))[1]
    assert abs(off) > 1e-6
    assert solution.error(TIP).parts["Newton"] == pytest.approx(off, rel=0.3)


def test_a_picture():
    found = loaded().solve().error(TIP)
    axes = found.plot()
    assert "error of displacement y" in axes.get_title()
    found.plot("particles", axes)
    with pytest.raises(tawami.InputError, match="part"):
        found.plot("wind")
    plt.close("all")
    assert "Newton" in repr(found)
    assert "Newton" in found._repr_html_()


def test_what_is_no_quantity():
    solution = loaded().solve()
    with pytest.raises(tawami.InputError, match=r"tawami\.Goal\.displacement"):
        solution.error("tip deflection")
    with pytest.raises(tawami.InputError, match="expected a point within the grid"):
        solution.error(tawami.Goal.displacement((9.0, 0.5), "y"))
    with pytest.raises(tawami.InputError, match="expected one of 'x', 'y'"):
        solution.error(tawami.Goal.displacement((2.0, 0.5), "z"))
    with pytest.raises(tawami.InputError, match="no part 'rihgt'"):
        solution.error(tawami.Goal.mean_displacement("rihgt", "y"))
    with pytest.raises(tawami.InputError, match="no particle was chosen"):
        solution.error(tawami.Goal.mean_stress(lambda x, y: x > 9))
    with pytest.raises(tawami.InputError, match="expected a function f\\(x, y\\)"):
        tawami.Goal.mean_stress("right")
    with pytest.raises(tawami.InputError, match="gave float64 of shape"):
        solution.error(tawami.Goal.mean_stress(lambda x, y: x - 1))


def test_a_scene_that_has_changed():
    scene = loaded()
    solution = scene.solve()
    scene.traction("top", (0.0, -1e3))
    with pytest.raises(tawami.NotModelledError, match="loads and supports as they were"):
        solution.error(TIP)
    scene.solve()
    with pytest.raises(tawami.InputError, match="has changed since this solution"):
        solution.error(TIP)
    solution = scene.solve()
    scene.fix("right", "x", 1e-3)
    with pytest.raises(tawami.NotModelledError, match="prescribe other displacements"):
        solution.error(TIP)
    scene.solve().error(TIP)


def test_what_is_not_modelled():
    with pytest.raises(tawami.NotModelledError, match="small strain"):
        loaded(form="u_epsv_finite").solve().error(TIP)
    with pytest.raises(tawami.NotModelledError, match="basis = 'bilinear'"):
        loaded(basis="bilinear").solve().error(TIP)
    scene = loaded()
    scene.initial("stress", (-1.0e4, -1.0e4, -1.0e4, 0.0))
    with pytest.raises(tawami.NotModelledError, match="without initial stress"):
        scene.solve().error(TIP)
    scene = beam()
    scene.load(np.array([0]), (0.0, -1.0))
    with pytest.raises(tawami.NotModelledError, match="forces on particles"):
        scene.solve().error(TIP)
    scene = beam(body=tawami.box(GRID, (0, 0), (1.8, 1)))
    scene.fix("right", "x", 1e-3)
    with pytest.raises(tawami.NotModelledError, match="supports on edges of the grid"):
        scene.solve().error(tawami.Goal.displacement((1.8, 0.5), "x"))
    scene = beam()
    scene.wall("bottom")
    with pytest.raises(tawami.NotModelledError, match="has walls"):
        scene.solve().error(TIP)
    moving = tawami.Dynamics(loaded(density=1e3))
    with pytest.raises(tawami.NotModelledError, match="in motion"):
        moving.step(1e-3).error(TIP)


def test_a_body_without_a_border():
    x, y = np.meshgrid((np.arange(12) + 0.5) / 6, (np.arange(6) + 0.5) / 6)
    particles = np.column_stack([x.ravel(), y.ravel()]), np.full(72, 1 / 36)
    scene = beam(body=tawami.Body(*particles), density=1e3)
    scene.gravity((0.0, -9.81))
    with pytest.raises(tawami.InputError, match="the body has no border"):
        scene.solve().error(TIP)
    bordered = tawami.polyline([(0, 0), (2, 0), (2, 1), (0, 1)])
    scene = beam(body=tawami.Body(*particles, border=bordered), density=1e3)
    scene.gravity((0.0, -9.81))
    assert scene.solve().error(TIP).parts["particles"] > 0  # as the message advises
