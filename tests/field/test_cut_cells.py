"""Partially filled cells: the ghost penalty, scaling, slivers, single particles."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import BASES, grid_of
from scipy.interpolate import BSpline

import tawami
from cases.showcase import cut_cells
from tawami.field.cut_cells import partially_filled, sides
from tawami.form import vector
from tawami.form.form import Form

GHOST = {"form": "u_epsv", "ghost_penalty": "on", "k": 0.5, "k_v": 0.5}
WITHOUT = {"form": "u_epsv", "ghost_penalty": "off"}


@pytest.fixture
def corner(random_scene):
    """Scenes of particles in one corner of a grid, with or without the ghost penalty."""
    grid = grid_of((6, 5))
    x = grid.origin + np.random.default_rng(0).random((80, 2)) * [1.9, 1.4]
    body = tawami.Body(x, np.full(80, 0.05))
    law = tawami.linear_elastic(E=2.0, nu=0.4)

    def make(**options):
        return tawami.Scene(grid, body, law, **options)

    return make


def penalty(corner, **options):
    """A scene with the ghost penalty, and the matrix of the penalty alone."""
    with_it, without = corner(**GHOST, **options), corner(**WITHOUT, **options)
    c = np.zeros(with_it.num_coefficients)
    return with_it, (with_it.tangent(c) - without.tangent(c)).toarray()


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("path", ["points", "dolfinx"])
def test_the_tangent_is_the_derivative_of_the_residual(corner, basis, path):
    scene, matrix = penalty(corner, basis=basis, assembly=path)
    c = np.random.default_rng(1).standard_normal(scene.num_coefficients)
    other = corner(**WITHOUT, basis=basis, assembly=path)
    difference = scene.residual(c) - other.residual(c)
    assert np.abs(difference - matrix @ c).max() < 1e-12 * np.abs(difference).max()
    assert np.abs(matrix - matrix.T).max() < 1e-13 * np.abs(matrix).max()


def second_derivative(n, h, coefficients, x):
    """Second derivative of a clamped quadratic spline, by SciPy."""
    knots = h * np.concatenate([[0, 0], np.arange(n + 1), [n, n]])
    return BSpline(knots, coefficients, 2).derivative(2)(x)


def spline(n, h, coefficients, x):
    knots = h * np.concatenate([[0, 0], np.arange(n + 1), [n, n]])
    return BSpline(knots, coefficients, 2)(x)


def test_the_penalty_is_the_integral_of_the_jumps(corner):
    """sum over sides of k mu h^3 int [u,nn].[u,nn], and of -k K^2/mu h^3 int [eps_v,n]^2."""
    scene, matrix = penalty(corner)
    grid, layout = scene.grid, scene.configuration.domain.layout
    (nx, ny), h = grid.cells, grid.h
    random = np.random.default_rng(2)
    a, b = random.standard_normal(nx + 2), random.standard_normal(ny + 2)
    e = random.standard_normal((ny + 1, nx + 1))
    c = np.zeros(layout.size)
    c[0 : layout.num_displacement : 2] = np.outer(b, a).ravel()  # u_x = a(x) b(y)
    c[layout.num_displacement :] = e.ravel()
    points, weights = np.polynomial.legendre.leggauss(5)
    points, weights = 0.5 * h * (points + 1), 0.5 * h * weights
    law = tawami.linear_elastic(E=2.0, nu=0.4)
    K, mu = law.bulk_modulus, law.shear_modulus
    expected = 0.0
    for (i, j), (p, q), _ in scene.configuration.domain.assembly.attachment.sides:
        if p > i:
            bend = [second_derivative(nx, h, a, x) for x in (p * h - 1e-9, p * h + 1e-9)]
            along = spline(ny, h, b, j * h + points)
            slopes = [(e[j : j + 2, m + 1] - e[j : j + 2, m]) / h for m in (i, p)]
        else:
            bend = [second_derivative(ny, h, b, y) for y in (q * h - 1e-9, q * h + 1e-9)]
            along = spline(nx, h, a, i * h + points)
            slopes = [(e[m + 1, i : i + 2] - e[m, i : i + 2]) / h for m in (j, q)]
        expected += 0.5 * mu * h**3 * weights @ ((bend[1] - bend[0]) * along) ** 2
        jump = slopes[1] - slopes[0]
        at = jump[0] + (jump[1] - jump[0]) * points / h
        expected -= 0.5 * K**2 / mu * h**3 * weights @ at**2
    assert c @ matrix @ c == pytest.approx(expected, rel=1e-9)


def test_partly_filled_cells_are_beside_empty_ones():
    active = np.ones((4, 5), dtype=bool)
    active[3, 4] = False
    partly = partially_filled(active)
    assert np.argwhere(partly).tolist() == [[2, 3], [2, 4], [3, 3]]  # not those at the grid's end
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=1.0, cells=active.shape[::-1])
    assert len(list(sides(grid.window, active))) == 6
    assert not list(sides(grid.window, np.ones((4, 5), dtype=bool)))


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (
            lambda u, w, dG, jump_nn, mu: jump_nn(u)[0] ** 2 * jump_nn(w)[0] * dG,
            "linear in the fields",
        ),
        (lambda u, w, dG, jump_nn, mu: jump_nn(w)[0] * dG, "linear in the fields"),
    ],
)
def test_terms_on_sides_that_are_not_linear_are_rejected(random_scene, term, words):
    from ufl import grad

    def residual(u, w, sigma, mu, sum_p, dG, jump_nn):
        return sum_p(sigma, grad(w)) + term(u, w, dG, jump_nn, mu)

    form = Form({"u": vector("w")}, residual)
    with pytest.raises(tawami.FormError, match=words):
        random_scene(form=form)


@pytest.mark.parametrize(
    ("method", "condition", "change"),
    [("u_epsv", 1e3, 30), ("u_epsv, ghost", 100, 20), ("u", 3e3, 10)],
)
def test_a_block_may_lie_anywhere_on_the_grid(method, condition, change):
    """Deflection and scaled condition stay bounded; the condition before scaling does not."""
    rows = [cut_cells.solve(method, 0.0)]
    rows += [cut_cells.solve(method, o, rows[0].stretch) for o in (0.1, 0.3, 0.5, 0.7, 0.9)]
    assert max(row.condition for row in rows) < condition
    assert max(abs(row.change_percent) for row in rows) < change
    if method != "u_epsv, ghost":
        assert max(row.unscaled for row in rows) > 1e11


def test_a_sliver_of_1e_8_of_a_cell_changes_little():
    """The deflection stays; the matrix is well conditioned with the ghost penalty."""
    for method, condition in (("u_epsv, ghost", 100), ("u_epsv", 1e10), ("u", 3e3)):
        before, after = (cut_cells.solve(method, 0.25 + s) for s in (-1e-8, 1e-8))
        assert after.stretch == pytest.approx(before.stretch, rel=0.02), method
        assert after.condition < condition


@pytest.mark.parametrize("penalty", ["off", "on"])
def test_a_particle_alone_in_its_cell_does_not_stop_a_motion(penalty):
    """It moves as a point mass does, and so does the block beside it."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(16, 16))
    block = tawami.box(grid, (0.25, 1.0), (0.75, 1.5), per_axis=2)
    x = np.vstack([block.x, [1.31, 1.27]])
    body = tawami.Body(x, np.append(block.volume, block.volume[0]))
    law = tawami.linear_elastic(E=1e5, nu=0.49)
    scene = tawami.Scene(
        grid, body, law, form="u_epsv_finite", density=1e3, alpha=0.01, ghost_penalty=penalty
    )
    scene.gravity((0, -10))
    motion = tawami.Dynamics(scene, velocity=(0.5, 0.0))
    steps = motion.run(0.3, 0.01)
    assert len(steps) == 30
    assert motion.velocity == pytest.approx(np.tile([0.5, -3.0], (65, 1)), abs=1e-9)
