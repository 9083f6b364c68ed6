"""Points that are not in the body are rejected, with the distance to the nearest particle."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

FAR = (
    r"\(2.0, 1.5\).*no body there; the nearest particle is 1.5 m away: expected a point of the body"
)


def scene_of(form="u_epsv"):
    """A block of 1 m x 0.5 m in the corner of a grid of 4 m x 2 m."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(16, 8))
    body = tawami.box(grid, (0, 0), (1, 0.5), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e4, nu=0.3), form=form)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    return scene


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_points_outside_the_body_are_rejected(form, tmp_path):
    scene, far = scene_of(form), (2.0, 1.5)
    load = scene.load([5], (1.0, 0.0))
    solution = scene.solve()
    load.change((2.0, 0.0))
    column = tawami.TableOutput(f"displacement {far}")
    calls = {
        "displacement": lambda: solution.displacement(far),
        "hold": lambda: scene.hold(far, "x"),
        "follow": lambda: tawami.follow(scene, (far, "x"), size=1e-3, to=1e-3),
    }
    for call in calls.values():
        with pytest.raises(tawami.InputError, match=FAR):
            call()
    with pytest.raises(tawami.InputError, match=r"displacement \(2.0, 1.5\): no "):
        tawami.ramp(scene, results=tawami.Results(tmp_path / "run", column))
    assert len(scene.configuration.supports.all) == 2
    scene.solve()


@pytest.mark.parametrize("basis", ["quadratic_spline", "bilinear", "biquadratic"])
def test_points_in_and_at_the_border_of_the_body_are_found(basis):
    """Corners, sides, round-off; the grid has the displacement that the body has."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.25, cells=(10, 10))
    body = tawami.box(grid, (0, 0), (1, 0.5), per_axis=3)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e4, nu=0.3), basis=basis)
    for component in "xy":
        scene.hold((-1e-12, 0.5), component)
    scene.hold((1.0 + 1e-12, 0.5), "y", 0.01)
    solution = scene.solve()  # turned by 0.01
    for x, y in ((0.0, 0.0), (1.0, 0.5), (1.0 + 1e-13, 0.3), (0.4, 0.5 + 1e-13), (0.3, 0.2)):
        expected = [0.01 * (0.5 - y), 0.01 * x]
        assert solution.displacement((x, y)) == pytest.approx(expected, abs=1e-11)


def test_a_point_between_the_particles_of_a_cut_body_is_found():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.25, cells=(8, 8))
    scene = tawami.Scene(grid, tawami.disc(grid, (0, 0), 0.8), tawami.linear_elastic(E=1.0, nu=0.3))
    for angle in np.linspace(0, 2 * np.pi, 23):
        for component in "xy":
            scene.hold((0.8 * np.cos(angle), 0.8 * np.sin(angle)), component)
    scene.solve()


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_the_displacement_of_a_point_is_an_increment_at_finite_strain(form):
    """Of a block that moves as a whole: the total is that of the particles."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(5, 4))
    body = tawami.box(grid, (0, 0), (1, 1))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e6, nu=0.3), form=form)
    for edge, component in (("left", "x"), ("bottom", "y")):
        scene.fix(edge, component, 0.03)
    steps = []
    tawami.ramp(scene, 0.25, each=steps.append)
    assert len(steps) == 4
    moved = 0.03 / 4 if form == "u_epsv_finite" else 0.03
    assert steps[-1].displacement((0.5, 0.5)) == pytest.approx([moved] * 2, rel=1e-6)
    np.testing.assert_allclose(steps[-1].displacement_of_particles, 0.03, rtol=1e-6)
