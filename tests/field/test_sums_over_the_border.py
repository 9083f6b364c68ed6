"""Sums over the border, `sum_b`: resultants, foundations, follower pressures, fluxes, errors."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from ufl import cofac, dev, dot, exp

import tawami
from tawami.form import Form, scalar, vector

ONE_FIELD = {"u": vector("w")}
SIDES = ["bottom", "right", "top", "left"]
LOWER, UPPER = (0.1, 0.07), (1.43, 0.95)
WIDTH, HEIGHT = np.subtract(UPPER, LOWER)
E, NU = 50.0, 0.3
#: Modulus of confined compression.
M = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))


def block(form, *, h=0.25, geometry="plane_strain", comm=MPI.COMM_SELF, **options):
    """A block whose sides are inside the cells of its grid."""
    grid = tawami.Grid(
        comm, origin=(0.0, -0.1), h=h, cells=(round(1.5 / h), round(1.25 / h)), geometry=geometry
    )
    (x0, y0), (x1, y1) = LOWER, UPPER
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    body = tawami.polygon(grid, corners, names=SIDES, per_axis=3)
    return tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), form=form, **options)


def resultant(scene):
    domain = scene.configuration.domain
    forces = scene.residual(np.zeros(scene.num_coefficients))[: domain.layout.num_displacement]
    return domain.model.space.vectors(forces).sum(axis=0)


def test_tractions_on_any_part_have_exact_resultants():
    def residual(w, sigma, grad, sum_p, sum_b, n):
        R = sum_p(sigma, grad(w)) - sum_b(w[1], on="top") - sum_b(2 * w[0], on=["left", "bottom"])
        return R - 5 * sum_b(dot(n, w))

    force = resultant(block(Form(ONE_FIELD, residual)))
    assert force == pytest.approx([-2 * (HEIGHT + WIDTH), -WIDTH], abs=1e-12)


def test_rings_carry_their_circumference():
    def residual(w, sigma, grad, sum_p, sum_b, n):
        return sum_p(sigma, grad(w)) - sum_b(w[1], on="top") - sum_b(3 * dot(n, w), on="right")

    force = resultant(block(Form(ONE_FIELD, residual), geometry="axisymmetric"))
    area = np.pi * (UPPER[0] ** 2 - LOWER[0] ** 2)
    assert force == pytest.approx([-3 * 2 * np.pi * UPPER[0] * HEIGHT, -area], rel=1e-12)


def test_points_in_cells_without_particles_lose_no_force():
    def residual(w, sigma, grad, sum_p, sum_b, x):
        return sum_p(sigma, grad(w)) + sum_b(x[0] * w[1], on="2") + sum_b(w[0], on="1")

    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=0.25, cells=(6, 5))
    inside = tawami.box(grid, (0.25, 0.25), (1.0, 0.75))
    border = tawami.polyline([(0.2, 0.19), (1.05, 0.19), (1.05, 0.81), (0.2, 0.81)])
    volume = inside.volume * 0.85 * 0.62 / inside.volume.sum()
    body = tawami.Body(inside.x, volume, border=border)
    scene = tawami.Scene(
        grid, body, tawami.linear_elastic(E=E, nu=NU), form=Form(ONE_FIELD, residual)
    )
    domain = scene.configuration.domain
    assert not domain.active[3, 4]
    assert resultant(scene) == pytest.approx([0.62, (1.05**2 - 0.2**2) / 2], rel=1e-12)


def nonlinear(
    u, T, w, r, sigma, mu, rho, grad, eps, I, old, n, dot_n, x, h, time, k, p, sum_p, sum_b,  # noqa: E741
):  # fmt: skip
    """A follower pressure, a nonlinear foundation, Robin and radiating fluxes, an elastic traction."""
    f = I + grad(u)
    R = sum_p(sigma, grad(w)) + sum_p(dot(grad(T), grad(r)))
    R += sum_b(p * (1 + x[0]) * dot(dot_n(cofac(f)), w), on=["top", "right"])
    R += sum_b(k * exp(u[0]) * dot(u + old.u, w) / h)
    R -= sum_b(2 * mu * dot(dot_n(dev(eps(u))), w), on="left")
    R += sum_b((T + old.T) ** 3 * r * (1 + dot(n, n)), on="right")
    return R + sum_b(rho * u[1] * r + (1 + time) * dot_n(grad(T)) * r, on="bottom")


HEATED = Form(
    {"u": vector("w"), "T": scalar("r", unit="K")},
    nonlinear,
    data={"k": "stiffness of the foundation [Pa]"},
    parameters={"p": {"default": 3.0, "unit": "Pa"}},
)


@pytest.mark.parametrize("geometry", ["plane_strain", "axisymmetric"])
def test_the_tangent_is_the_derivative_of_the_residual(geometry):
    scene = block(HEATED, geometry=geometry, density=2.0)
    random = np.random.default_rng(0)
    scene.data("k", lambda x, y: 1 + x)
    column = scene.particles.carried("T")
    column[:] = random.random(np.shape(column))
    scene.configuration.total[:] = random.random(scene.num_coefficients)
    c = 0.1 * random.standard_normal(scene.num_coefficients)
    direction = random.standard_normal(len(c))
    change = [scene.residual(c + s * 1e-5 * direction) for s in (1, -1)]
    slope = scene.tangent(c) @ direction
    assert slope == pytest.approx((change[0] - change[1]) / 2e-5, rel=1e-6, abs=1e-7)


def on_foundation(u, w, sigma, grad, sum_p, sum_b, old, time, k):
    R_u = sum_p(sigma, grad(w)) + sum_b(k * dot(old.u + u, w), on="bottom")
    return R_u + sum_b(time * w[1], on="top")


FOUNDATION = Form(ONE_FIELD, on_foundation, data={"k": "stiffness of the foundation [Pa/m]"})


def test_a_column_on_an_elastic_foundation():
    """Confined compression under p = time: u = -p/k at the base and -p/k - p H/M at the top."""
    k, (x0, y0), (x1, y1) = 40.0, (0.0, 0.07), (0.5, 0.95)
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0.0, -0.05), h=0.25, cells=(2, 5))
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    body = tawami.polygon(grid, corners, names=SIDES, per_axis=3, gauss=True)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), form=FOUNDATION)
    for edge in ("left", "right"):
        scene.fix(edge, "x")
    scene.data("k", k)
    for p in (1.0, 3.0):  # the foundation remembers the first step
        solution = scene.solve(until=p)
        assert solution.symmetric
        base, top = (solution.displacement((0.3, y))[1] for y in (y0, y1))
        assert base == pytest.approx(-p / k, rel=1e-9)
        assert top == pytest.approx(-p / k - p * (y1 - y0) / M, rel=1e-9)


def test_a_follower_pressure_all_around_is_a_uniform_cauchy_stress():
    """tau = J sigma with sigma = -p I in the plane and in axisymmetry, at large strain."""

    def residual(u, w, P, grad, sum_p, sum_b, dot_n, I, p):  # noqa: E741
        return sum_p(P, grad(w)) + sum_b(p * dot(dot_n(cofac(I + grad(u))), w))

    form = Form(
        ONE_FIELD, residual, strain="finite", parameters={"p": {"default": 0.0, "unit": "Pa"}}
    )
    for geometry, components in (("plane_strain", 2), ("axisymmetric", 3)):
        grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=0.25, cells=(4, 3), geometry=geometry)
        upper = (0.5, 0.5)
        body = tawami.box(grid, (0, 0), upper, per_axis=3, gauss=True)
        law = tawami.linear_elastic(E=E, nu=NU)
        scene = tawami.Scene(grid, body, law, form=form, basis="bilinear", tolerance=1e-11, p=10.0)
        scene.fix("left", "x")
        scene.fix("bottom", "y")
        tau = np.asarray(scene.solve().stress)[:, :components]
        F = np.eye(components) + np.asarray(scene.particles.displacement_gradient)
        J = np.linalg.det(F)[:, None]
        assert J.max() < 0.9
        assert tau / J == pytest.approx(np.full(tau.shape, -10.0), rel=1e-8)


def test_a_robin_flux_has_its_linear_temperature():
    """T = 0 at the base, flux c (T_a - T) at the top: T = T_a y / (lambda/c + H)."""

    def residual(u, T, w, r, sigma, grad, sum_p, sum_b, old, c):
        R = sum_p(sigma, grad(w)) + sum_p(dot(grad(old.T + T), grad(r)))
        return R + sum_b(c * (old.T + T - 20) * r, on="top")

    form = Form(
        {"u": vector("w"), "T": scalar("r", unit="K")},
        residual,
        parameters={"c": {"default": 2.5, "unit": "1/m"}},
    )
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=0.25, cells=(2, 4))
    corners = [(0, 0), (0.5, 0), (0.5, 0.9), (0, 0.9)]
    body = tawami.polygon(grid, corners, names=SIDES, per_axis=3)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), form=form)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    scene.fix("bottom", "T", 0.0)
    for _ in range(2):  # the second step starts in equilibrium
        solution = scene.solve()
        expected = 20 * solution.x[:, 1] / (1 / 2.5 + 0.9)
        assert solution.field("T") == pytest.approx(expected, rel=1e-9)
    assert solution.iterations <= 1


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (lambda w, sigma, n, sum_b: sum_b(dot(sigma * n, w)),
         r"line \d+ .*sum_b of 'sigma': .* the border has no stress .* 2 \* mu \* dev\(eps\(u\)\)"),
        (lambda w, n, sum_p: sum_p(dot(n, w)), "the normal n at particles: expected n and dot_n"),
        (lambda w, n, sum_v: sum_v(n[0], w[0]), "the normal n at particles"),
        (lambda w, old, sum_p: sum_p(dot(old.u, w)), "expected old.u in sum_b"),
        (lambda w, old, grad, sum_b: sum_b(grad(old.u)[0, 0] * w[0]), "derivative of the old displ"),
        (lambda w, sum_b: sum_b(w), r"sum_b of an expression of shape \(2,\): expected a number"),
        (lambda w, sum_b: sum_b(w[0], on=3), r"sum_b\(..., on=3\): expected the name of a part"),
        (lambda w, sum_b, K, cell_mean: sum_b(cell_mean(K) * w[0]), "expected K, mu or data alone"),
        (lambda w, sum_b, dot_n: sum_b(dot_n(w[0]) * w[0]), "dot_n of an expression of shape"),
        (lambda u, sum_b: sum_b(dot(u, u)), "expected one in each term"),
    ],
)  # fmt: skip
def test_what_a_sum_over_the_border_cannot_read(term, message):
    import inspect

    names = [name for name in inspect.signature(term).parameters if name != "w"]

    def residual(**given):
        wanted = {name: given[name] for name in inspect.signature(term).parameters}
        return given["sum_p"](given["sigma"], given["grad"](given["w"])) + term(**wanted)

    keyword = inspect.Parameter.KEYWORD_ONLY
    asked = dict.fromkeys([*names, "w", "sigma", "grad", "sum_p"])
    residual.__signature__ = inspect.Signature([inspect.Parameter(name, keyword) for name in asked])
    with pytest.raises(tawami.FormError, match=message):
        block(Form(ONE_FIELD, residual))


def test_errors_name_the_parts_of_the_border():
    def on(name):
        def residual(w, sigma, grad, sum_p, sum_b):
            return sum_p(sigma, grad(w)) + sum_b(w[0], on=name)

        return Form(ONE_FIELD, residual)

    with pytest.raises(tawami.InputError, match="on='topp'.* 'bottom', .*did you mean 'top'"):
        block(on("topp"))
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=0.5, cells=(2, 2))
    law = tawami.linear_elastic(E=E, nu=NU)
    loose = tawami.Body(np.array([[0.5, 0.5]]), np.array([0.1]))
    with pytest.raises(tawami.InputError, match="has no border: expected .* the parts .*'crest'"):
        tawami.Scene(grid, loose, law, form=on("crest"))
    with pytest.raises(tawami.FormError, match="sum_b with assembly='dolfinx'"):
        block(on("top"), assembly="dolfinx")


def test_data_of_the_border_that_are_missing_or_not_finite():
    scene = block(FOUNDATION)
    scene.fix("left", "x")
    with pytest.raises(tawami.InputError, match=r"expected scene.data\('k', ...\) before"):
        scene.solve(until=1.0)
    with pytest.raises(tawami.InputError, match=r"data 'k' at the border: inf at "):
        scene.data("k", lambda x, y: np.where(y > LOWER[1] + 1e-9, 1.0, np.inf))


def on_springs(u, w, P, grad, sum_p, sum_b, old, k):
    return sum_p(P, grad(w)) + sum_b(k * dot(old.u + u, w)) - sum_b(w[0])


def test_springs_remember_the_way_of_a_body_that_moves():
    """Springs all around, of stiffness k per length, balance a force of 1 per length: u_x = 1/k."""
    form = Form(
        ONE_FIELD, on_springs, strain="finite", data={"k": "stiffness of the foundation [Pa/m]"}
    )
    scene = block(form)
    scene.data("k", lambda x, y: 20.0 + 0 * x)
    for _ in range(2):
        scene.solve()
        moved = np.asarray(scene.particles.displacement)
        assert moved == pytest.approx(np.tile([0.05, 0.0], (len(moved), 1)), abs=1e-7)


def test_a_removal_keeps_the_numbers_of_the_border_that_remains():
    """The foundation carries the load on what remains of the top."""
    scene = block(FOUNDATION)
    scene.fix("bottom", "x")
    scene.data("k", lambda x, y: 40.0 + 10 * x)
    scene.solve(until=1.0)
    scene.remove(np.asarray(scene.particles.x)[:, 0] > 1.0)
    solution, points = scene.solve(), scene.configuration.border.points.now
    base, top = (points.tag == SIDES.index(name) for name in ("bottom", "top"))
    u = np.array([solution.displacement(tuple(x))[1] for x in points.x[base]])
    carried = points.length[base] @ ((40 + 10 * points.x[base, 0]) * u)
    # the point whose stretch is cut has moved a little and keeps its k
    assert carried == pytest.approx(-points.length[top].sum(), rel=2e-5)
    assert points.length[top].sum() < 0.8 * WIDTH
