"""Kernels of axisymmetry: sums over a random cloud by splines of SciPy, tangents by differences."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scenes import FINITE, FORMS
from scipy.interpolate import BSpline
from ufl import dot, inner

import tawami
from tawami.form import vector
from tawami.form.form import Form

CELLS, H, ORIGIN = (4, 3), 0.3, (0.0, -0.2)
NU = {"u": 0.3, "u_finite": 0.3}


def scene_of(form, law=None, **options):
    random = np.random.default_rng(0)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=ORIGIN, h=H, cells=CELLS, geometry="axisymmetric")
    x = np.array(ORIGIN) + H * np.array(CELLS) * random.uniform(0.02, 0.98, (80, 2))
    body = tawami.Body(x, random.uniform(0.01, 0.02, 80))
    law = law or tawami.linear_elastic(K=2.0, mu=1.0)
    return tawami.Scene(grid, body, law, form=form, **options)


def functions(x, i, j):
    """Derivatives of the splines along r and z at points, functions x points."""
    along = []
    for axis, order in enumerate((i, j)):
        n = CELLS[axis]
        knots = ORIGIN[axis] + H * np.concatenate([[0, 0], np.arange(n + 1), [n, n]])
        spline = BSpline(knots, np.eye(n + 2), 2)
        along.append((spline.derivative(order) if order else spline)(x[:, axis]))
    return np.einsum("pj,pi->jip", along[1], along[0]).reshape(-1, len(x))


def sums(x, weight, u):
    """sum_p weight (eps(u) : eps(w) + (div u)^3 div w + r u . w), the residual below, by SciPy."""
    at, r, z = (functions(x, *order) for order in ((0, 0), (1, 0), (0, 1)))
    radius = x[:, 0]
    (ur, uz), (urr, uzr), (urz, uzz) = (u.T @ f for f in (at, r, z))
    hoop, shear = ur / radius, (urz + uzr) / 2
    cube = (urr + uzz + hoop) ** 3
    along_r = r * urr + z * shear + at * hoop / radius + cube * (r + at / radius) + radius * at * ur
    along_z = z * uzz + r * shear + cube * z + radius * at * uz
    return np.column_stack([along_r @ weight, along_z @ weight]).ravel()


@pytest.mark.parametrize("place", ["sum_p", "sum_c"])
def test_sums_are_those_of_splines_of_scipy(place):
    def integrand(u, w, eps, div, x):
        return inner(eps(u), eps(w)) + div(u) ** 3 * div(w) + x[0] * dot(u, w)

    def at_particles(u, w, eps, div, x, mu, sum_p):
        return sum_p(mu * integrand(u, w, eps, div, x))

    def at_centres(u, w, eps, div, x, mu, sum_p, sum_c):
        return sum_c(mu, integrand(u, w, eps, div, x))

    form = Form({"u": vector("w")}, at_particles if place == "sum_p" else at_centres)
    scene = scene_of(form)
    particles, grid = scene.particles, scene.grid
    x, weight = np.array(particles.x), np.array(particles.volume)
    if place == "sum_c":
        x = grid.in_metres(grid.cell_at(grid.in_cells(x)) + 0.5)
    c = 0.1 * np.random.default_rng(1).standard_normal(scene.num_coefficients)
    expected = sums(x, weight, c.reshape(-1, 2))
    np.testing.assert_allclose(scene.residual(c), expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("name", "basis"),
    [*((name, "quadratic_spline") for name in FORMS | FINITE), ("u_epsv", "bilinear")],
)
def test_tangents_are_those_of_the_residuals(name, basis):
    law = tawami.neo_hookean(K=2.0, mu=1.0) if name in FINITE else None
    scene = scene_of(law=law, basis=basis, **(FORMS | FINITE)[name])
    random = np.random.default_rng(2)
    c, direction = (0.003 * random.standard_normal(scene.num_coefficients) for _ in range(2))
    step = 1e-4
    ahead, behind = (scene.residual(c + s * step * direction) for s in (1, -1))
    predicted = scene.tangent(c) @ direction
    error = np.abs((ahead - behind) / (2 * step) - predicted).max()
    assert error < 1e-7 * np.abs(predicted).max()


def test_plastic_tangents_are_those_of_the_residuals():
    elastic = tawami.linear_elastic(K=2.0, mu=1.0)
    law = tawami.mohr_coulomb(elastic, phi=30.0, c=1e-4, psi=10.0)
    scene = scene_of("u_epsv", law)
    scene.particles.stress[:, :3] = -1e-2
    random = np.random.default_rng(2)
    c, direction = (1e-3 * random.standard_normal(scene.num_coefficients) for _ in range(2))
    step = 1e-6
    ahead, behind = (scene.residual(c + s * step * direction) for s in (1, -1))
    predicted = scene.tangent(c) @ direction
    error = np.abs((ahead - behind) / (2 * step) - predicted).max()
    assert error < 1e-5 * np.abs(predicted).max()


def test_integrals_over_cells_edges_and_sides_have_the_length_of_the_circle():
    """int dx of a linear field, of a traction, and the ghost penalty of a quadratic field."""

    def residual(u, w, mu, sum_p, dx, dG, jump_nn, h):
        R = sum_p(mu * dot(u, w)) + dot(u, w) * dx
        return R + h**3 * inner(jump_nn(u), jump_nn(w)) * dG

    random = np.random.default_rng(0)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.6, 0.0), h=0.3, cells=(4, 2),
                       geometry="axisymmetric")  # fmt: skip
    x = np.concatenate(
        [np.array([0.6 + 0.3 * i, 0.0]) + 0.3 * random.random((5, 2)) for i in (0, 1)]
    )
    form = Form({"u": vector("w")}, residual)
    border = tawami.polyline([(0.6, 0.0), (1.2, 0.0)], names="bottom", closed=False)
    body = tawami.Body(x, np.full(10, 0.01), border=border)
    law = tawami.linear_elastic(K=2.0, mu=1.0)
    scene = tawami.Scene(grid, body, law, form=form, basis="biquadratic")
    nodes = scene.configuration.domain.layout.greville

    def work(u, w):
        c = [np.column_stack([f(*nodes.T), 0 * nodes[:, 0]]).ravel() for f in (u, w)]
        return scene.residual(c[0]) @ c[1]

    mass = np.asarray(scene.particles.volume) * (np.array(x)[:, 0] ** 2)
    dx = 2 * np.pi * 0.3 * ((1.2**4 - 0.6**4) / 4)  # of u w = r^2 over one row of two cells
    assert work(lambda x, y: x, lambda x, y: x) == pytest.approx(mass.sum() + dx, rel=1e-12)
    # u = (r - 0.9)^2 for r > 0.9: its second derivative jumps by 2 across r = 0.9, a side of length 0.3
    kink = work(*[lambda x, y: np.maximum(x - 0.9, 0) ** 2] * 2)
    plain = (np.asarray(scene.particles.volume) * np.maximum(x[:, 0] - 0.9, 0) ** 4).sum()
    s = np.polynomial.polynomial.Polynomial([0, 0, 0, 0, 0.9, 1.0]).integ()(0.3)
    plain += 2 * np.pi * 0.3 * s
    side = 0.3**3 * 4 * 2 * np.pi * 0.9 * 0.3
    assert kink == pytest.approx(plain + side, rel=1e-10)
    scene.traction("bottom", (3.0, 0.0))
    forces = scene.configuration.external()
    assert forces.sum() == pytest.approx(3 * np.pi * (1.2**2 - 0.6**2), rel=1e-12)


@pytest.mark.parametrize(
    ("residual", "message"),
    [
        (lambda w, sigma, sum_p: sum_p(sigma, ufl.grad(w)),
         r"line \d+ .*shape \(2, 2\): expected the same shape; take grad, div, eps and I as arg"),
        (lambda w, sigma, sum_p: sum_p(inner(sigma, ufl.grad(w))),
         r"its residual raised .*If shapes differ: take grad, div, eps and I as arguments"),
        (lambda w, sigma, sigma_m, eps, sum_p: sum_p(sigma, eps(w)) + sum_p(sigma_m, ufl.div(w)),
         r"line \d+ .*a derivative of a vector by UFL, div\(.*: take grad, div, eps and I as arg"),
        (lambda u, w, mu, sum_p: sum_p(mu, inner(ufl.grad(u), ufl.grad(w))),
         r"a derivative of a vector by UFL, grad\(.*: in axisymmetry tensors have a third row"),
    ],
)  # fmt: skip
def test_derivatives_without_the_hoop_direction_are_rejected(residual, message):
    with pytest.raises(tawami.FormError, match=message):
        scene_of(Form({"u": vector("w")}, residual))
