"""Shipped forms with fields of their own: tangents, and closed forms of small problems."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import COUPLED
from scipy.special import erfc
from ufl import inner

import tawami
from tawami.form import scalar, vector

GEOMETRIES = ("plane_strain", "axisymmetric")


def random_scene(geometry: str, **options) -> tawami.Scene:
    """Particles of two materials at random, with the data of the form and old fields that vary."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 3), geometry=geometry)
    random = np.random.default_rng(0)
    body = tawami.Body(random.random((60, 2)) * (2, 1.5), random.uniform(0.01, 0.1, 60))
    laws = [tawami.linear_elastic(E=2.0, nu=0.3), tawami.linear_elastic(E=7.0, nu=0.49)]
    numbers = random.integers(0, 2, 60)
    scene = tawami.Scene(grid, body, laws, material_of=numbers, density=1.0, **options)
    scene.gravity((0.0, -0.2))
    for name in scene.form.data:
        scene.data(name, lambda x, y: 1.0 + 0.1 * x)
    for name in scene.form.own_fields:
        scene.initial(name, lambda x, y: 0.2 + 0.1 * x * y)
    return scene


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("name", COUPLED)
def test_the_tangent_is_the_difference_of_residuals(name, geometry):
    scene = random_scene(geometry, **COUPLED[name])
    random = np.random.default_rng(1)
    c, d = 0.02 * random.standard_normal((2, scene.num_coefficients))
    step = 1e-4
    ends = [scene.residual(c + sign * step * d, dt=0.3) for sign in (1, -1)]
    difference = (ends[0] - ends[1]) / (2 * step)
    predicted = scene.tangent(c, dt=0.3) @ d
    assert np.abs(difference - predicted).max() < 1e-7 * np.abs(predicted).max()


def test_old_j_is_det_f_at_the_start_of_the_step():
    """A field that grows by old.J: its sum over the particles is that of det F (1 plus grad u once)."""

    def residual(w, r, P, c, old, grad, sum_p):
        return sum_p(inner(P, grad(w))) + sum_p(r * (c - old.J))

    form = tawami.Form({"u": vector("w"), "c": scalar("r")}, residual, strain="finite")
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(2, 3))
    body = tawami.box(grid, (0, 0), (1, 1))
    law = tawami.linear_elastic(E=1.0, nu=0.0)
    scene = tawami.Scene(grid, body, law, form=form, density=1.0)
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    scene.gravity((0.0, -0.3))
    expected = 0.0
    for _ in range(3):
        J = np.linalg.det(np.eye(2) + scene.particles.displacement_gradient)
        expected += scene.particles.volume @ J
        solution = scene.solve()
    assert J.mean() < 0.9
    assert scene.particles.volume @ solution.field("c") == pytest.approx(expected, rel=1e-9)


# -- heat ----------------------------------------------------------------------

E, NU, EXPANSION = 2e9, 0.3, 1e-5


def heated(cells=(4, 2), h=0.25, conductivity=2.0, law=None) -> tawami.Scene:
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=h, cells=cells)
    body = tawami.box(grid, (0, 0), (h * cells[0], h * cells[1]))
    law = law or tawami.linear_elastic(E=E, nu=NU)
    scene = tawami.Scene(grid, body, law, form="u_epsv_theta", density=2000.0)
    for name, value in (
        ("expansion", EXPANSION),
        ("conductivity", conductivity),
        ("capacity", 900.0),
    ):
        scene.data(name, value)
    return scene


def test_free_expansion_has_no_stress():
    """Heat enters all around; in plane strain it is free in the plane only, so that nu = 0."""
    scene = heated(law=tawami.linear_elastic(E=E, nu=0.0))
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "theta", 40.0)
    for until in (1e3, 1e9, 2e9):
        solution = scene.solve(until=until)
    np.testing.assert_allclose(solution.field("theta"), 40.0, rtol=1e-9)
    np.testing.assert_allclose(solution.strain[:, :2], EXPANSION * 40, rtol=1e-8)
    assert np.abs(solution.stress[:, [0, 1, 3]]).max() < 1e-8 * E * EXPANSION * 40
    np.testing.assert_allclose(solution.stress[:, 2], -E * EXPANSION * 40, rtol=1e-8)


def test_a_bar_between_walls():
    """sigma_xx = -E a theta/(1 - nu) in plane strain, with a free top."""
    scene = heated()
    for edge in ("left", "right"):
        scene.fix(edge, "x")
        scene.fix(edge, "theta", 40.0)
    scene.fix("bottom", "y")
    for until in (1e9, 2e9, 3e9):
        solution = scene.solve(until=until)
    expected = -E * EXPANSION * 40 / (1 - NU)
    np.testing.assert_allclose(solution.stress[:, 0], expected, rtol=1e-7)
    np.testing.assert_allclose(solution.stress[:, 2], expected, rtol=1e-7)
    assert np.abs(solution.stress[:, [1, 3]]).max() < 1e-7 * abs(expected)


def test_conduction_into_a_half_space():
    """theta = theta_0 erfc(x / (2 sqrt(D t))), D = k/(rho c), while the other end is cold."""
    scene = heated(cells=(40, 1), h=0.025)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("left", "theta", 1.0)
    D, end, steps = 2.0 / (2000.0 * 900.0), 0.02, 60
    for k in range(1, steps + 1):
        solution = scene.solve(until=(k / steps) ** 2 * end / D)
    expected = erfc(scene.particles.x[:, 0] / (2 * np.sqrt(end)))
    assert np.abs(solution.field("theta") - expected).max() < 0.004


def test_the_flux_of_heat_is_stored():
    scene = heated()
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.flux("right", "theta", 300.0)
    solution = scene.solve(until=50.0)
    stored = 2000.0 * 900.0 * scene.particles.volume @ solution.field("theta")
    assert stored == pytest.approx(300.0 * 50.0 * 0.5, rel=1e-10)


# -- creep ---------------------------------------------------------------------


def sheared(eta: float, mu: float, steps: int, end: float) -> float:
    """Shear strain over tau/mu of a block that creeps under the shear stress tau = 1."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(2, 2))
    body = tawami.box(grid, (0, 0), (1, 1), gauss=True)
    law = tawami.linear_elastic(E=2.6 * mu, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_visco")
    scene.data("eta", eta)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    for edge, stress in (("top", (1, 0)), ("right", (0, 1)), ("left", (0, -1))):
        scene.traction(edge, stress)
    for k in range(1, steps + 1):
        solution = scene.solve(until=end * k / steps)
    shear = 2 * solution.strain[:, 3]
    assert np.ptp(shear) < 1e-8 * shear.max()
    return float(shear.mean()) * mu


def test_creep_in_shear():
    """1 - exp(-t mu/eta); backward Euler gives 1 - (1 + dt mu/eta)^-n, whose error is linear in dt."""
    mu, eta = 1e6, 3e6
    values = {n: sheared(eta, mu, n, 3.0) for n in (5, 10, 20)}
    for n, value in values.items():
        assert value == pytest.approx(1 - (1 + 1 / n) ** -n, rel=1e-8)
    errors = [abs(value - (1 - np.exp(-1))) for value in values.values()]
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.05)
