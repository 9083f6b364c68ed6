"""Sums over the border, `sum_b`: resultants, foundations, follower pressures, Robin fluxes."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from ufl import cofac, dot, exp

import tawami
from tawami.border.points import BorderPoints
from tawami.form import Form, scalar, vector

SIDES = ("left", "right", "bottom", "top")
ONE_FIELD = {"u": vector("w")}


def points_of_box(lower, upper, h, names=SIDES, count=3):
    """Gauss points on the four sides of a box, in pieces of length h at most."""
    corners = {
        "left": ((0, 1), (0, 0)), "right": ((1, 0), (1, 1)),
        "bottom": ((0, 0), (1, 0)), "top": ((1, 1), (0, 1)),
    }  # fmt: skip
    s, w = np.polynomial.legendre.leggauss(count)
    lower, size = np.array(lower), np.subtract(upper, lower)
    x, length, normal, tag = [], [], [], []
    for number, name in enumerate(SIDES):
        start, end = (lower + size * np.array(c) for c in corners[name])
        edge = end - start
        whole = np.abs(edge).sum()
        pieces = int(np.ceil(whole / h - 1e-9))
        for k in range(pieces):
            x += [start + edge * (k + (1 + t) / 2) / pieces for t in s]
            length += [whole / pieces * v / 2 for v in w]
            normal += [np.array([edge[1], -edge[0]]) / whole] * count
            tag += [number] * count
    along = np.zeros(len(x))
    return BorderPoints(
        np.array(x), np.array(length), np.array(normal), np.array(tag), names, np.array(tag), along
    )


def block(form, lower=(0.1, 0.07), upper=(1.43, 0.95), *, h=0.25, cells=(7, 5), comm=MPI.COMM_SELF,
          carried=None, law=None, **options):  # fmt: skip
    """A block whose sides are inside cells, with its border."""
    geometry = options.pop("geometry", "plane_strain")
    grid = tawami.Grid(comm, origin=(-0.1, -0.1) if geometry == "plane_strain" else (0.0, -0.1), h=h,
                       cells=cells, geometry=geometry)  # fmt: skip
    (x0, y0), (x1, y1) = lower, upper
    body = tawami.polygon(grid, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)], per_axis=3)
    scene = tawami.Scene(
        grid, body, law or tawami.linear_elastic(E=50.0, nu=0.3), form=form, **options
    )
    points = points_of_box(lower, upper, h)
    give(scene, points, carried)
    return scene, points


def give(scene, points, carried=None):
    domain = scene.configuration.domain
    at_rest = {f"old u[{axis}]": np.zeros(len(points)) for axis in range(2)}
    domain.assembly.set_border(points, domain.responses.values, at_rest | (carried or {}))


def resultant(scene, vector):
    return scene.configuration.domain.model.space.vectors(
        vector[: scene.configuration.domain.layout.num_displacement]
    ).sum(axis=0)


def test_tractions_on_any_part_have_exact_resultants():
    def residual(w, sigma, grad, sum_p, sum_b, n):
        R = sum_p(sigma, grad(w)) - sum_b(w[1], on="top") - sum_b(2 * w[0], on=["left", "bottom"])
        return R - 5 * sum_b(dot(n, w))

    scene, _ = block(Form(ONE_FIELD, residual))
    force = resultant(scene, scene.residual(np.zeros(scene.num_coefficients)))
    assert force == pytest.approx([-2 * (0.88 + 1.33), -1.33], abs=1e-13)


def test_rings_carry_their_circumference():
    def residual(w, sigma, grad, sum_p, sum_b, n):
        return sum_p(sigma, grad(w)) - sum_b(w[1], on="top") - sum_b(3 * dot(n, w), on="right")

    scene, _ = block(Form(ONE_FIELD, residual), geometry="axisymmetric")
    force = resultant(scene, scene.residual(np.zeros(scene.num_coefficients)))
    area = np.pi * (1.43**2 - 0.1**2)
    assert force == pytest.approx([-3 * 2 * np.pi * 1.43 * 0.88, -area], rel=1e-12)


def nonlinear(u, T, w, r, sigma, mu, rho, grad, I, old, n,  # noqa: E741
              dot_n, x, h, time, k, p,
              sum_p, sum_b, eps):  # fmt: skip
    """A follower pressure, a nonlinear foundation, Robin and radiating fluxes, an elastic traction."""
    f = I + grad(u)
    R = sum_p(sigma, grad(w)) + sum_p(dot(grad(T), grad(r)))
    R += sum_b(p * (1 + x[0]) * dot(dot_n(cofac(f)), w), on=["top", "right"])
    R += sum_b(k * exp(u[0]) * dot(u + old.u, w) / h) - sum_b(mu * dot(dot_n(eps(u)), w), on="left")
    R += sum_b((T + old.T) ** 3 * r * (1 + dot(n, n)), on="right")
    return R + sum_b(rho * u[1] * r + time * dot_n(grad(T)) * r, on="bottom")


def two_fields(residual):
    return Form(
        {"u": vector("w"), "T": scalar("r", unit="K")},
        residual,
        data={"k": "stiffness of the foundation [Pa]"},
        parameters={"p": {"default": 3.0, "unit": "Pa"}},
    )


@pytest.mark.parametrize("geometry", ["plane_strain", "axisymmetric"])
def test_the_tangent_is_the_derivative_of_the_residual(geometry):
    scene, points = block(
        two_fields(nonlinear), cells=(6, 4), h=0.3, geometry=geometry, density=2.0
    )
    random = np.random.default_rng(0)
    scene.data("k", lambda x, y: 1 + x)
    scene.particles.carried("T")[:] = random.random(np.shape(scene.particles.carried("T")))
    give(scene, points, {"old u[0]": random.random(len(points))})
    c = 0.1 * random.standard_normal(scene.num_coefficients)
    direction = random.standard_normal(len(c))
    change = [scene.residual(c + s * 1e-5 * direction) for s in (1, -1)]
    slope = scene.tangent(c) @ direction
    assert slope == pytest.approx((change[0] - change[1]) / 2e-5, rel=1e-6, abs=1e-7)
