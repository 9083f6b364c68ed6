"""Sums over particles of any expression are those sums: compared with splines of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import grid_of
from scipy.interpolate import BSpline
from ufl import (
    Constant,
    Identity,
    as_vector,
    conditional,
    cos,
    det,
    diff,
    div,
    dot,
    exp,
    grad,
    gt,
    inner,
    inv,
    ln,
    sqrt,
    variable,
)  # fmt: skip

import tawami
from tawami.form import vector
from tawami.form.form import Form

CELLS, H = (5, 4), 0.3


def splines(x, n, origin, order):
    """Derivatives of the clamped quadratic splines on a row of cells, positions x functions."""
    knots = origin + H * np.concatenate([[0, 0], np.arange(n + 1), [n, n]])
    return BSpline(knots, np.eye(n + 2), 2).derivative(order)(x) if order else BSpline(
        knots, np.eye(n + 2), 2
    )(x)  # fmt: skip


@pytest.fixture(scope="module")
def cloud():
    """Scattered particles, and the functions there by their derivatives along x and y."""
    random = np.random.default_rng(0)
    grid = grid_of(CELLS, h=H)
    x = np.array(grid.origin) + H * np.array(CELLS) * random.random((60, 2))
    volume = 0.1 * random.random(60)

    def functions(i, j):
        along = [splines(x[:, a], CELLS[a], grid.origin[a], d) for a, d in enumerate((i, j))]
        return np.einsum("pj,pi->jip", along[1], along[0]).reshape(-1, len(x))

    return grid, x, volume, functions


def scene_of(cloud, residual, **options):
    grid, x, volume, _ = cloud
    form = Form({"u": vector("w")}, residual)
    material = tawami.linear_elastic(K=2.0, mu=1.0)
    return tawami.Scene(grid, tawami.Body(x, volume), material, form=form, **options)


def increments(scene):
    return 0.1 * np.random.default_rng(1).standard_normal(scene.num_coefficients)


def gradient_of(cloud, c):
    """grad u at the particles: components x axes x particles."""
    _, _, _, functions = cloud
    u = c.reshape(-1, 2)
    return np.array([[u[:, k] @ f for f in (functions(1, 0), functions(0, 1))] for k in range(2)])


def test_a_power_of_the_volume_change(cloud):
    """R(w) = sum_p V_p K (div u)^7 div w."""
    scene = scene_of(cloud, lambda u, w, K, sum_p: sum_p(K, div(u) ** 7 * div(w)))
    c = increments(scene)
    _, _, volume, functions = cloud
    g = gradient_of(cloud, c)
    weight = 2.0 * volume * (g[0, 0] + g[1, 1]) ** 7
    expected = np.column_stack([functions(1, 0) @ weight, functions(0, 1) @ weight]).ravel()
    np.testing.assert_allclose(scene.residual(c), expected, atol=1e-12 * np.abs(expected).max())


def test_values_and_first_derivatives_in_one_expression(cloud):
    """R(w) = sum_p V_p exp(u_x) cos(du_y/dx) w_y."""
    scene = scene_of(
        cloud,
        lambda u, w, sum_p: (
            sum_p(exp(u[0]) * cos(grad(u)[1, 0]) * w[1]) + sum_p(1e-9 * div(u) * w[0])
        ),
    )
    c = increments(scene)
    _, _, volume, functions = cloud
    at = functions(0, 0)
    weight = volume * np.exp(c.reshape(-1, 2)[:, 0] @ at) * np.cos(gradient_of(cloud, c)[1, 0])
    np.testing.assert_allclose(scene.residual(c)[1::2], at @ weight, atol=1e-12)


def test_second_derivatives(cloud):
    """R(w) = sum_p V_p h^2 (d2 u_x/dx dy + d2 u_y/dy2) d2 w_x/dx2."""

    def residual(u, w, h, sum_p):
        bend = grad(grad(u))
        return sum_p(h**2 * (bend[0, 0, 1] + bend[1, 1, 1]) * grad(grad(w))[0, 0, 0]) + sum_p(
            w[1] * u[1]
        )

    scene = scene_of(cloud, residual)
    c = increments(scene)
    _, _, volume, functions = cloud
    u = c.reshape(-1, 2)
    weight = H**2 * volume * (u[:, 0] @ functions(1, 1) + u[:, 1] @ functions(0, 2))
    expected = functions(2, 0) @ weight
    found = scene.residual(c)[::2]
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("basis", ["quadratic_spline", "bilinear", "biquadratic"])
@pytest.mark.parametrize(
    "expression",
    [
        lambda u, w: inner(inv(Identity(2) + 0.1 * grad(u)).T, grad(w)),
        lambda u, w: dot(as_vector([u[1] ** 3, sqrt(1 + u[0] ** 2)]), w),
        lambda u, w: conditional(gt(div(u), 0), div(u) ** 2, 0) * div(w),
        lambda u, w: inner(grad(grad(u)), grad(grad(w))) * dot(u, u),
    ],
)
def test_the_tangent_is_that_of_the_residual(cloud, basis, expression):
    scene = scene_of(
        cloud,
        lambda u, w, mu, sigma, sum_p: sum_p(sigma, grad(w)) + sum_p(mu, expression(u, w)),
        basis=basis,
    )
    c, direction = increments(scene), increments(scene)[::-1]
    step = 1e-5
    ahead, behind = (scene.residual(c + s * step * direction) for s in (1, -1))
    predicted = scene.tangent(c) @ direction
    error = np.abs((ahead - behind) / (2 * step) - predicted).max()
    assert error < 1e-7 * np.abs(predicted).max()


def test_an_energy_in_terms_of_a_variable(cloud):
    """R(w) = sum_p V_p dW/dF : grad w, W = mu (F : F - 2 ln det F), F a variable."""

    def residual(u, w, mu, sum_p):
        F = variable(Identity(2) + 0.3 * grad(u))
        return sum_p(mu, inner(diff(inner(F, F) - 2 * ln(det(F)), F), grad(w)))

    scene = scene_of(cloud, residual)
    c = increments(scene)
    _, _, volume, functions = cloud
    F = np.eye(2)[..., None] + 0.3 * gradient_of(cloud, c)
    inverse = np.linalg.inv(F.transpose(2, 0, 1)).transpose(2, 1, 0)
    stress = 2 * (F - inverse) * volume
    expected = np.column_stack(
        [functions(1, 0) @ stress[k, 0] + functions(0, 1) @ stress[k, 1] for k in range(2)]
    ).ravel()
    np.testing.assert_allclose(scene.residual(c), expected, atol=1e-12 * np.abs(expected).max())


def test_terms_that_vanish_and_sums_that_are_not_used(cloud):
    def residual(u, w, mu, s, sigma, sum_p):
        sum_p(s, grad(w))
        return sum_p(sigma, grad(w)) + sum_p(mu, 0 * dot(u, w))

    plain = scene_of(cloud, lambda w, sigma, sum_p: sum_p(sigma, grad(w)))
    scene = scene_of(cloud, residual)
    c = increments(scene)
    np.testing.assert_allclose(scene.residual(c), plain.residual(c), rtol=1e-13)
    assert abs(scene.tangent(c) - plain.tangent(c)).max() == 0


@pytest.mark.parametrize(
    ("residual", "message"),
    [
        (
            lambda u, w, sum_p: sum_p(inner(grad(grad(grad(u))), grad(grad(grad(w))))),
            "at most second derivatives",
        ),
        (lambda w, sigma, h, sum_p, sum_c: sum_p(sigma, grad(w)) + sum_c(h), "no test function"),
        (
            lambda w, mu, sum_p: sum_p(mu, Constant(w.ufl_domain(), count=77) * w[0]),
            "a Constant of UFL: expected a number",
        ),
    ],
)
def test_terms_that_cannot_be_evaluated_are_rejected(cloud, residual, message):
    with pytest.raises(tawami.FormError, match=message):
        scene_of(cloud, residual)


@pytest.mark.parametrize("quantity", ["tau_m", "ln_J"])
def test_the_tangent_of_volumes_and_mean_stresses_at_finite_strain(cloud, quantity):
    """R(w) = sum_p V_p (tau f^-T : grad w + q^2 div w), for a law of the whole strain."""

    def residual(w, P, tau_m, ln_J, sum_p):
        q = tau_m if quantity == "tau_m" else ln_J
        return sum_p(P, grad(w)) + sum_p((q + q**2) * div(w))

    grid, x, volume, _ = cloud
    form = Form({"u": vector("w")}, residual, strain="finite")
    material = tawami.linear_elastic(K=2.0, mu=1.0)
    scene = tawami.Scene(grid, tawami.Body(x, volume), material, form=form)
    c, direction, step = 0.3 * H * increments(scene), increments(scene)[::-1], 1e-6
    ahead, behind = (scene.residual(c + s * step * direction) for s in (1, -1))
    change = scene.tangent(c) @ direction
    assert np.abs((ahead - behind) / (2 * step) - change).max() < 1e-7 * np.abs(change).max()
