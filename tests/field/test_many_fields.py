"""Forms with fields of their own: assembly, scaling and measures of any number of fields."""

from __future__ import annotations

import heated
import numpy as np
import pytest
from particle_sums import Sum
from scenes import BASES, grid_of, random_scene
from scipy.sparse import csr_matrix
from ufl import div, dot, grad

import tawami
from tawami.form import Form, scalar, vector


def with_cells(u, theta, eps_v, w, r, q, sigma, K, sum_p, c, k, beta, source, a, dx, cell_mean):
    """Nonlinear terms over cells as well, which both assemblies integrate alike."""
    linear = heated.residual(u, theta, eps_v, w, r, q, sigma, K, sum_p, c, k, beta, source, a)
    power = cell_mean(K) * theta**2 * div(u)
    return linear + (power * r + theta * eps_v * q + theta * dot(u, w)) * dx


def close(a, b, tolerance=1e-12):
    assert np.abs(a - b).max() <= tolerance * np.abs(b).max()


@pytest.mark.parametrize("theta", ["bilinear", "quadratic_spline"])
@pytest.mark.parametrize("basis", BASES)
def test_both_assemblies_agree(basis, theta):
    form = heated.form_of(with_cells, theta)
    scenes = [
        random_scene(150, basis=basis, form=form, assembly=path) for path in ("points", "dolfinx")
    ]
    c = np.random.default_rng(0).standard_normal(scenes[0].num_coefficients)
    found = []
    for scene in scenes:
        scene.fix("bottom", "y")
        scene.hold((-0.51, 1.2), "x")
        scene.hold((-0.5, 1.3), "y")
        domain, reduction = scene.configuration.domain, scene.reduction()
        residual = scene.residual(c)
        tangent = domain.assembly.tangent(c, domain.responses.data, reduction)
        start, columns, values = tangent.getValuesCSR()
        reduced = csr_matrix((values, columns, start), shape=(reduction.size,) * 2).toarray()
        found.append((residual, reduced, scene.tangent(c).toarray()))
    for mine, reference in zip(*found, strict=True):
        close(mine, reference)


class WithHeat(Sum):
    """Adds the third field to the sum over particles; coefficients are those of u, theta, eps_v."""

    def __init__(self, scene, theta):
        super().__init__(scene, {"form": "u_epsv", "alpha": 0.0})
        self.theta = theta

    def parts(self, p):
        """Volume, bulk modulus, div u, value and gradient of the functions of theta at a particle."""
        particles = self.scene.particles
        s = (particles.x[p] - self.scene.grid.origin) / self.h
        n = self.at(self.scene.basis, s, self.cells[p])
        m = self.at(self.theta, s, self.cells[p])
        divergence = np.column_stack([n[1][0], n[0][1]]).ravel()
        bulk = self.moduli[particles.material[p]][1]
        return particles.volume[p], bulk, divergence, m[0][0], np.array([m[1][0], m[0][1]])

    def matrix(self):
        two = super().matrix()
        volume, _, divergence, value, _ = self.parts(0)
        n, m = len(divergence), len(value)
        whole = np.zeros((len(two) + m,) * 2)
        others = np.r_[:n, n + m : len(whole)]
        whole[np.ix_(others, others)] = two
        c, k, beta, _, a = heated.PARAMETERS.values()
        for p in range(len(self.cells)):
            volume, bulk, divergence, value, gradient = self.parts(p)
            conduction = c * np.outer(value, value) + k * gradient.T @ gradient
            whole[n : n + m, n : n + m] += volume * conduction
            whole[:n, n : n + m] -= volume * bulk * beta * np.outer(divergence, value)
            whole[n : n + m, :n] += volume * a * np.outer(value, divergence)
        return whole

    def magnitude(self, u, theta):
        """Sums of the absolute values of the contributions to the equation of theta."""
        c, k, _, source, a = heated.PARAMETERS.values()
        total = 0.0
        for p in range(len(self.cells)):
            volume, _, divergence, value, gradient = self.parts(p)
            rate = c * value @ theta + a * divergence @ u - source
            total += volume * np.abs(rate * value + k * gradient.T @ gradient @ theta)
        return total


@pytest.mark.parametrize(
    ("basis", "theta"),
    [
        ("quadratic_spline", "quadratic_spline"),
        ("quadratic_spline", "bilinear"),
        ("bilinear", "quadratic_spline"),
    ],
)
def test_the_tangent_is_that_of_a_sum_over_particles(basis, theta):
    for path in ("points", "dolfinx"):
        scene = random_scene(30, basis=basis, form=heated.form_of(basis=theta), assembly=path)
        reference = WithHeat(scene, theta)
        close(scene.tangent(np.zeros(scene.num_coefficients)).toarray(), reference.matrix())
    scene = random_scene(30, basis=basis, form=heated.form_of(basis=theta))
    domain = scene.configuration.domain
    place = domain.layout.fields["theta"]
    c = np.random.default_rng(1).standard_normal(scene.num_coefficients)
    domain.newton.internal(c)
    found = domain.assembly.magnitude(c, domain.responses.data)[place.slice]
    reference = WithHeat(scene, theta)
    close(found, reference.magnitude(c[: place.start], c[place.slice]))


def test_the_tangent_is_the_derivative_of_the_residual():
    def residual(u, p, d, w, r, m, sigma, mu, sum_p):
        flux = dot(grad(p) * (1 + d**2), grad(r)) + p**3 * r + div(u) * p * r
        damage = dot(grad(d), grad(m)) + (d - 1) * p**2 * m
        return sum_p(sigma, grad(w)) + sum_p(mu, d * dot(u, w)) + sum_p(flux + damage)

    form = Form(
        {"u": vector("w"), "p": scalar("r", basis="quadratic_spline"), "d": scalar("m")}, residual
    )
    scene = random_scene(form=form)
    random = np.random.default_rng(2)
    c, direction = random.standard_normal((2, scene.num_coefficients))
    ahead, behind = (scene.residual(c + step * direction) for step in (1e-5, -1e-5))
    close(scene.tangent(c) @ direction, (ahead - behind) / 2e-5, 1e-8)


def solved(unit=1.0, equation=1.0, scale=None, assembly="points", theta="bilinear"):
    """A column heated inside and held at its base, with temperatures in other units."""
    values = {
        "c": 20.0 * equation / unit, "k": 0.5 * equation / unit, "beta": 1e-3 / unit,
        "source": 30.0 * equation, "a": 2.0 * equation,
    }  # fmt: skip
    grid = grid_of()
    body = tawami.box(grid, grid.origin, (0.5, 1.5))
    form = heated.form_of(basis=theta, scale=scale, **values)
    scene = tawami.Scene(
        grid, body, tawami.linear_elastic(E=1e7, nu=0.499), form=form, assembly=assembly,
        tolerance=1e-10,
    )  # fmt: skip
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    solution = scene.solve()
    c = scene.configuration.total
    return scene, solution, c[scene.configuration.domain.layout.fields["theta"].slice] / unit


@pytest.mark.parametrize("theta", ["bilinear", "quadratic_spline"])
def test_the_solution_does_not_depend_on_units_and_scales(theta):
    _, solution, values = solved(theta=theta)
    assert values.max() == pytest.approx(1.5, rel=0.1)  # source / c
    assert all(len(measures) == 3 for measures in solution.history)
    assert max(solution.history[-1]) < 1e-10
    others = [solved(1e6, 1e3, theta=theta), solved(scale=5.0, theta=theta)]
    others.append(solved(assembly="dolfinx", theta=theta))
    for _, other, same in others:
        close(same, values, 1e-9)
        close(other.u, solution.u, 1e-9)
        assert abs(other.iterations - solution.iterations) <= 1  # of linear solves to a tolerance


@pytest.mark.parametrize("basis", ["bilinear", "quadratic_spline"])
def test_an_equation_whose_terms_cancel_at_each_particle_converges(basis):
    """As in a hydrostatic equilibrium: all contributions are round-off, and so is their scale."""

    def residual(u, p, head, w, r, m, sigma, sum_p):
        balance = (p + head) * r + dot(grad(p + head), grad(r))
        return sum_p(sigma, grad(w)) + sum_p(balance + (head - 7e3) * m)

    fields = {"u": vector("w"), "p": scalar("r", basis=basis), "head": scalar("m")}
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper)
    material = tawami.linear_elastic(E=1e3, nu=0.2)
    scene = tawami.Scene(grid, body, material, form=Form(fields, residual))
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    scene.solve()
    random, balanced = np.random.default_rng(0), scene.configuration.total
    guess = balanced * (1 + 1e-15 * random.standard_normal(len(balanced)))
    again = tawami.Scene(grid, body, material, form=scene.form)
    again.fix("bottom", "x")
    again.fix("bottom", "y")
    newton, reduction = again.configuration.domain.newton, again.reduction()
    steps = [newton.solve(reduction, np.zeros_like(guess), guess=guess) for _ in range(2)]
    assert steps[0].history[0][2] > 0.1  # nothing is known yet but contributions
    assert [step.iterations for step in steps] == [1, 0]


@pytest.mark.parametrize("basis", ["bilinear", "quadratic_spline"])
def test_a_spline_field_that_a_particle_hardly_reaches_follows_its_neighbour(basis):
    """A particle 1e-8 of a cell inside a support gives its function no stiffness."""
    grid = grid_of()
    inside = tawami.box(grid, grid.origin, (0.0, 2.0), per_axis=2)
    x = np.vstack([inside.x, [[1e-8 * grid.h, 1.1]]])
    body = tawami.Body(x, np.append(inside.volume, 0.01))
    form = heated.form_of(basis="quadratic_spline")
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form=form, basis=basis)
    layout = scene.configuration.domain.layout
    place = layout.fields["theta"]
    followers, leaders = layout.tied[place.holds(layout.tied[:, 0])].T
    assert len(followers) == 3  # the functions of the last column on the row of the particle
    assert place.holds(leaders).all()
    assert not layout.active[followers].any()
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    tied = scene.reduction().selection
    for follower, leader in zip(followers, leaders, strict=True):
        assert (tied[follower] != tied[leader]).nnz == 0


def test_the_message_of_a_step_names_the_field():
    def residual(u, p, w, r, sigma, sum_p):
        return sum_p(sigma, grad(w)) + sum_p((p**3 + 0.01 * p - 1) * r)

    form = Form({"u": vector("w"), "p": scalar("r")}, residual)
    scene = random_scene(form=form, max_iterations=2)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    with pytest.raises(tawami.ConvergenceError, match=r"momentum, volume and 'p' by iteration: 0:"):
        scene.solve()


def test_a_field_without_stiffness_is_named():
    def residual(u, p, w, r, sigma, sum_p, source):
        return sum_p(sigma, grad(w)) + sum_p(dot(grad(p), grad(r)) - source * r)

    fields = {"u": vector("w"), "p": scalar("r")}
    form = Form(fields, residual, parameters={"source": {"default": 1.0}})
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.2), form=form)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    with pytest.raises(tawami.SingularError, match=r"\d\) with \d+ particles in field 'p'"):
        scene.solve()


def test_too_many_fields_are_rejected():
    def residual(u, w, sigma, sum_p, p0, q0, p1, q1, p2, q2, p3, q3, p4, q4, p5, q5):
        extra = p0 * q0 + p1 * q1 + p2 * q2 + p3 * q3 + p4 * q4 + p5 * q5
        return sum_p(sigma, grad(w)) + sum_p(extra)

    def scene_with(basis):
        fields = {f"p{k}": scalar(f"q{k}", basis=basis) for k in range(6)}
        return random_scene(form=Form({"u": vector("w"), **fields}, residual))

    with pytest.raises(tawami.FormError, match="too many fields: they have 72 coefficients"):
        scene_with("quadratic_spline")
    scene = scene_with("bilinear")  # as the message says
    block = scene.configuration.domain.layout.fields["p5"].slice
    assert scene.tangent(np.zeros(scene.num_coefficients))[block, block].nnz > 0
