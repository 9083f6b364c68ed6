"""Tractions, pressures and fluxes on borders at any place in the cells: their resultants, and pressures
that follow the border.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import greville
from ufl import dot

import tawami
from tawami.form import scalar, vector

#: Degrees by which a block is turned, and the place of its corner in a cell.
PLACES = [(0.0, (0.0, 0.0)), (0.0, (0.013, 0.199)), (17.0, (0.1, 0.02)), (45.0, (0.07, 0.11))]
SIZE = np.array([1.1, 0.63])
AXISYMMETRIC = "axisymmetric"


def turned(angle):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.array([[c, -s], [s, c]])


def block(angle, shift, geometry="plane_strain", gauss=False, **options):
    """A turned block of SIZE with the sides '0' (below) to '3', and its corners."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.2, cells=(14, 14), geometry=geometry)
    local = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * SIZE
    corners = np.array([0.9, 0.6]) + shift + local @ turned(angle).T
    body = tawami.polygon(grid, [tuple(corner) for corner in corners], gauss=gauss)
    law = tawami.linear_elastic(E=1e3, nu=0.3)
    return tawami.Scene(grid, body, law, **options), corners


def on_grid(scene, coefficients):
    """Positions of the functions of the grid, and the forces on them, functions x 2."""
    n = scene.configuration.domain.layout.num_displacement
    x, y = (scene.grid.h * greville(scene.basis, n) for n in scene.grid.cells)
    points = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
    return points, coefficients[:n].reshape(-1, 2)


def integral(a, b, f, axisymmetric):
    """Integral of f(x) over the line from a to b, or over the cone that it draws around the axis."""
    t, w = np.polynomial.legendre.leggauss(8)
    x = a + 0.5 * (1 + t)[:, None] * (b - a)
    area = 0.5 * w * np.linalg.norm(b - a)
    if axisymmetric:
        area = area * 2 * np.pi * x[:, 0]
    return np.array([area @ column for column in np.transpose(f(x))])


@pytest.mark.parametrize("geometry", ["plane_strain", AXISYMMETRIC])
@pytest.mark.parametrize(("angle", "shift"), PLACES)
def test_forces_and_moments_are_the_integrals(angle, shift, geometry):
    """A traction with a slope on the side '2', a pressure with one on '1' and '3'."""
    scene, corners = block(angle, shift, geometry, form="u")
    scene.traction("2", (lambda x, y: 1 + x, lambda x, y: 2 - y))
    scene.pressure(["1", "3"], lambda x, y: 3 + x - 2 * y)
    points, forces = on_grid(scene, scene.configuration.external())

    def of_traction(x):
        return np.column_stack([1 + x[:, 0], 2 - x[:, 1]])

    def of_pressure(side):
        along = (corners[(side + 1) % 4] - corners[side]) / SIZE[1]
        normal = np.array([along[1], -along[0]])
        return lambda x: -(3 + x[:, :1] - 2 * x[:, 1:]) * normal

    parts = [(2, of_traction), (1, of_pressure(1)), (3, of_pressure(3))]
    force, moment = np.zeros(2), 0.0
    for side, f in parts:
        a, b = corners[side], corners[(side + 1) % 4]
        force += integral(a, b, f, geometry == AXISYMMETRIC)
        moment += integral(
            a, b, lambda x, f=f: (x[:, 0] * f(x)[:, 1] - x[:, 1] * f(x)[:, 0])[:, None],
            geometry == AXISYMMETRIC,
        )[0]  # fmt: skip
    assert forces.sum(axis=0) == pytest.approx(force, rel=1e-10)
    by_grid = points[:, 0] @ forces[:, 1] - points[:, 1] @ forces[:, 0]
    assert by_grid == pytest.approx(moment, rel=1e-10)


def test_a_pressure_all_around_has_no_resultant():
    scene, _ = block(31.0, (0.03, 0.17), form="u")
    scene.pressure(["0", "1", "2", "3"], 5.0)
    points, forces = on_grid(scene, scene.configuration.external())
    assert np.abs(forces).max() > 0.1
    assert forces.sum(axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert points[:, 0] @ forces[:, 1] - points[:, 1] @ forces[:, 0] == pytest.approx(0, abs=1e-12)


def steady():
    """A form in which a field c flows, int grad c . grad r dV."""

    def residual(w, r, c, sigma, old, grad, sum_p):
        flow = sum_p(dot(grad(r), grad(old.c + c)))
        return sum_p(sigma, grad(w)) + flow

    return tawami.Form({"u": vector("w"), "c": scalar("r", unit="mol/m3")}, residual)


@pytest.mark.parametrize(("angle", "shift"), PLACES)
def test_a_flux_adds_up_to_its_integral(angle, shift):
    scene, corners = block(angle, shift, form=steady())
    scene.flux("1", "c", lambda x, y: 1 + x * y)
    place = scene.configuration.domain.layout.fields["c"].slice
    total = integral(corners[1], corners[2], lambda x: 1 + x[:, :1] * x[:, 1:], False)
    assert scene.configuration.external()[place].sum() == pytest.approx(total[0], rel=1e-10)


@pytest.mark.parametrize(("angle", "shift"), PLACES)
def test_a_field_between_inclined_borders_is_linear(angle, shift):
    """c = 1 on the side '3' and a flux of 2 into '1': a gradient of 2 across."""
    scene, corners = block(angle, shift, form=steady())
    for component in ("x", "y"):
        scene.fix("0", component)
    scene.fix("3", "c", 1.0)
    scene.flux("1", "c", 2.0)
    solution = scene.solve()
    along = (solution.x - corners[0]) @ turned(angle)[:, 0]
    assert np.abs(solution.field("c") - 1 - 2 * along).max() < 0.02 * 2 * SIZE[0]


@pytest.mark.parametrize("geometry", ["plane_strain", AXISYMMETRIC])
def test_the_tangent_of_a_follower_pressure_is_that_of_differences(geometry):
    scene, _ = block(23.0, (0.05, 0.02), geometry, form="u_epsv_finite")
    scene.pressure(["1", "2"], lambda x, y: 1 + x)
    now = scene.configuration
    (term,) = now.loads.following(now.domain, now.moment())
    random = np.random.default_rng(3)
    u, change = 0.02 * random.standard_normal((2, now.domain.layout.size))
    term.forces(u)
    by_tangent = -(term.stiffness(np.zeros(0, dtype=int)) @ change)
    eps = 1e-6
    by_differences = (term.forces(u + eps * change) - term.forces(u - eps * change)) / (2 * eps)
    scale = np.abs(by_differences).max()
    assert scale > 1e-3
    assert np.abs(by_tangent - by_differences).max() < 1e-7 * scale


def test_a_pressure_follows_the_border_and_a_dead_traction_does_not():
    """A free block that turns by 90 degrees in a motion."""
    scene, corners = block(0.0, (0.05, 0.03), form="u_epsv_finite", density=1.0)
    middle = corners.mean(axis=0)
    turning = tawami.Dynamics(scene, velocity=lambda x, y: (-(y - middle[1]), x - middle[0]))
    scene.pressure("1", 1e-6)
    scene.traction("2", (0.0, 1e-6))
    at_start, steps = np.array(scene.particles.x), 20
    for _ in range(steps):
        turning.step(np.pi / 2 / steps)
    now = scene.configuration
    pressure, traction = (load.points for load in now.loads.all)
    # the block turns by 1.3 degrees less than in rigid motion; its border does as its particles do
    (a, b), (c, d) = at_start.T - middle[:, None], scene.particles.x.T - middle[:, None]
    angle = np.arctan2((a * d - b * c).sum(), (a * c + b * d).sum())
    assert angle == pytest.approx(np.pi / 2, abs=0.03)
    of_pressure = -pressure.area.sum(axis=0) / SIZE[1]
    assert of_pressure == pytest.approx([-np.cos(angle), -np.sin(angle)], abs=1e-3)
    _, forces = on_grid(scene, now.external())
    assert forces.sum(axis=0) == pytest.approx([0.0, 1e-6 * SIZE[0]], rel=1e-10)
    arm = SIZE[1] / 2 * np.array([-np.sin(angle), np.cos(angle)])
    assert traction.x.mean(axis=0) == pytest.approx(middle + arm, abs=0.01)


def test_a_pressure_is_released_and_changed_in_a_ramp():
    """The reaction follows the share of the load, in the middle of a ramp and after its release."""
    scene, _ = block(20.0, (0.05, 0.03))
    for component in ("x", "y"):
        scene.fix("0", component)
    push, found = scene.pressure("2", 5.0), []
    full = 5.0 * SIZE[0] * np.array([-np.sin(np.radians(20)), np.cos(np.radians(20))])
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("0")))
    push.change(10.0)
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("0")))
    push.release()
    tawami.ramp(scene, 1.0, each=lambda s: found.append(s.reaction("0")))
    for reaction, share in zip(found, [0.5, 1.0, 1.5, 2.0, 0.0], strict=True):
        assert reaction == pytest.approx(share * full, abs=1e-6)


def test_a_load_after_a_motion_acts_where_the_border_is_then():
    """On a border that has been stretched, straight pieces between its points."""
    scene, _ = block(0.0, (0.05, 0.03), form="u_epsv_finite")
    scene.fix("0", "y")
    scene.fix("3", "x")
    scene.traction("1", (80.0, 0.0))
    tawami.ramp(scene, 0.25)
    x = scene.particles.x
    width = scene.border.points.x[:, 0].max() - scene.border.points.x[:, 0].min()
    assert width > 1.05 * SIZE[0]
    assert x[:, 0].max() < scene.border.points.x[:, 0].max()
    load = scene.pressure("2", 1.0)
    assert load.points.length.sum() == pytest.approx(width, rel=0.02)
    force = load.points.area.sum(axis=0)
    assert force[1] == pytest.approx(load.points.length.sum(), rel=1e-3)
