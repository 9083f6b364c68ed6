"""Supports: elimination, projection, and which ones are rejected."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from scenes import beam, grid_of

import tawami
from tawami import _rust
from tawami.base.errors import SupportError
from tawami.field import constraints
from tawami.field.coefficients import Place
from tawami.field.reduction import Reduction
from tawami.grid import edges
from tawami.grid.basis import values_1d


def _place(basis):
    """A displacement in a basis; the number of its functions is not used."""
    return Place(basis, 2, 2, 0, 0)


@pytest.mark.parametrize("point", [(-1.0, 1.25), (-1.0, 1.0), (-0.63, 1.87), (1.0, 2.0)])
@pytest.mark.parametrize("value", [0.0, 3e-3])
def test_a_held_point_equals_a_lagrange_multiplier(basis, point, value):
    scene = beam(basis=basis, tolerance=1e-12)
    scene.fix("left", "x", 1e-3)
    scene.hold(point, "y", value)
    scene.hold((0.3, 0.9), "y", -value)
    scene.traction("right", (0.5, -1.0))
    solution = scene.solve()

    # the same with Lagrange multipliers, by scipy
    n = scene.num_coefficients
    matrix = scene.tangent(np.zeros(n))
    layout = scene.configuration.domain.layout
    held = constraints.held_edge(
        scene.grid, _place(basis), "left", np.arange(3), 0, 1e-3, "a support"
    )
    rows = [sp.csr_matrix(([1.0], ([0], [k])), shape=(1, n)) for k in held.indices]
    values = list(held.values)
    for place, v in ((point, value), ((0.3, 0.9), -value)):
        p = constraints.held_point(layout, place, 1, v)
        rows.append(sp.csr_matrix((p.weights, (np.zeros(len(p.indices)), p.indices)), shape=(1, n)))
        values.append(v)
    b = sp.vstack(rows)
    saddle = sp.bmat([[matrix, b.T], [b, None]], format="csc")
    right = np.concatenate([scene.configuration.external(), values])
    expected = np.linalg.solve(saddle.toarray(), right)[:n]
    mine = np.concatenate([solution.u, solution.volumetric])
    assert np.abs(mine - expected).max() < 1e-9 * np.abs(expected).max()
    assert solution.displacement(point)[1] == pytest.approx(value, abs=1e-15)


def test_a_number_is_its_own_projection(basis):
    grid = grid_of((6, 4))
    for touched in ([0, 1, 2, 4, 5], [1, 2, 4]):
        number, function = (
            constraints.held_edge(
                grid, _place(basis), "top", np.array(touched), 1, value, "a support"
            )
            for value in (-0.7, lambda x, y: -0.7 + 0 * x)
        )
        np.testing.assert_array_equal(number.indices, function.indices)
        assert number.values == pytest.approx(function.values, rel=1e-13)


def test_profiles_are_projected_in_l2_and_reproduced_where_the_basis_can(basis):
    scene = beam(basis=basis)
    place, cells = _place(basis), np.arange(4)
    linear = constraints.held_edge(
        scene.grid, place, "top", cells, 0, lambda x, y: 2 + 3 * x, "a support"
    )
    width = len(linear.indices)
    u = np.zeros(scene.configuration.domain.layout.num_displacement)
    u[linear.indices] = linear.values
    for x in np.linspace(-1, 1, 7):
        location = edges.locate_point(scene.grid, (x, scene.grid.upper[1]), "test")
        assert _rust.interpolate(location, basis, 2, u)[0, 0] == pytest.approx(2 + 3 * x, abs=1e-13)
    # a cubic is not in the space: the error of the projection is orthogonal to it
    cubic = constraints.held_edge(
        scene.grid, place, "top", cells, 0, lambda x, y: x**3, "a support"
    )
    t, w = np.polynomial.legendre.leggauss(6)
    total = np.zeros(width)
    for cell in range(4):
        s = 0.5 + 0.5 * t
        functions = values_1d(basis, 4, np.full(6, cell), s).toarray()
        x = -1 + 0.5 * (cell + s)
        total += functions.T @ (w * (functions @ cubic.values - x**3))
    assert np.abs(total).max() < 1e-13


FREE = {
    "translation in x, translation in y, rotation about": [],
    "translation in y$": [("fix", "left", "x")],
    "translation in x$": [("fix", "bottom", "y")],
    r"rotation about \(-1, 1\.25\)": [("hold", (-1, 1.25), "x"), ("hold", (-1, 1.25), "y")],
    r"rotation about \(-1, 2\)": [("hold", (1, 2), "x"), ("hold", (-1, 0.5), "y")],
}


@pytest.mark.parametrize("motion", FREE)
def test_free_rigid_motions_are_named(motion):
    scene = beam()
    for kind, where, component in FREE[motion]:
        getattr(scene, kind)(where, component)
    scene.traction("right", (0.0, -1.0))
    with pytest.raises(SupportError, match=motion.rstrip("$")) as caught:
        scene.solve()
    if motion.endswith("$"):
        assert "rotation" not in str(caught.value)
    assert not scene.particles.stress.any()


def test_contradicting_supports_are_rejected():
    scene = beam()
    scene.fix("left", "x", 0.0)
    scene.fix("bottom", "x", 1e-3)
    scene.fix("bottom", "y")
    with pytest.raises(
        SupportError,
        match=r"fix\('left'\) x and fix\('bottom'\) x = 0.001 m .* differ by 0.001 m where",
    ):
        scene.solve()
    scene = beam()
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.hold((-1.0, 1.0), "y", 1e-3)
    with pytest.raises(
        SupportError, match=r"hold\(point=\(-1, 1\)\): fix\('left'\) y already give"
    ):
        scene.solve()


def test_supports_that_agree_where_they_meet_are_accepted():
    scene = beam()
    scene.fix("left", "x", lambda x, y: 1e-3 * (y - 0.5))
    scene.fix("bottom", "x", 0.0)
    scene.fix("bottom", "y")
    scene.hold((-1.0, 0.5), "x", 0.0)
    scene.solve()
    scene.traction("right", (1.0, 0.0))
    scene.solve()  # with supports that hold already


def test_each_separate_part_of_the_body_needs_its_supports():
    grid = grid_of((12, 3))
    parts = [
        tawami.box(grid, (-1, 0.5), (0.5, 2), per_axis=2),
        tawami.box(grid, (3.0, 0.5), (5, 2), per_axis=2),
    ]
    body = tawami.Body(
        *(np.concatenate(a) for a in zip(*[(b.x, b.volume) for b in parts], strict=True))
    )
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=3e3, nu=0.4999))
    scene.fix("left", "x")
    scene.fix("left", "y")
    with pytest.raises(
        SupportError, match=r"part of the body around \(3.96, 1.25\).*\(2 parts\).*rotation"
    ):
        scene.solve()
    scene.fix("right", "x")
    scene.fix("right", "y", -1e-3)
    scene.solve()
    u = np.array(scene.particles.displacement)[scene.particles.x[:, 0] > 2]
    np.testing.assert_allclose(u, np.tile([0, -1e-3], (len(u), 1)), atol=1e-15)


@pytest.mark.parametrize("form", ["u", "u_bbar", "u_epsv", "u_p"])
def test_a_prescribed_rigid_motion_gives_no_stress_and_converges(form):
    scene = beam(form=form)
    scene.fix("left", "x", lambda x, y: 0.1 - 1e-3 * (y - 1))
    scene.fix("left", "y", lambda x, y: -0.3 + 1e-3 * (x - 2))
    scene.solve()
    x = np.array(scene.particles.x)
    expected = np.column_stack([0.1 - 1e-3 * (x[:, 1] - 1), -0.3 + 1e-3 * (x[:, 0] - 2)])
    np.testing.assert_allclose(scene.particles.displacement, expected, atol=1e-12)
    assert np.abs(scene.particles.stress).max() < 1e-6  # Pa, of a material of 3 kPa
    scene.traction("right", (0.0, -1.0))
    assert scene.solve().iterations >= 1


def test_a_point_on_the_border_of_the_body_is_held_despite_round_off():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-0.3, -0.3), h=0.1, cells=(10, 10))
    for shift in (0.0, 4e-16, -4e-16, 1e-12):
        body = tawami.box(grid, (0.0, 0.0), (0.5, 0.5), per_axis=2)
        scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3))
        for y in (0.0, 0.25, 0.5):
            scene.hold((shift, y), "x")
        scene.hold((0.5 + shift, 0.25), "y", 1e-3)
        assert scene.solve().displacement((0.5, 0.25))[1] == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize("form", ["u", "u_epsv"])
def test_particles_on_grid_lines_do_not_activate_the_cells_beyond(form):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(12, 8))
    x, y = np.meshgrid(np.linspace(0, 2, 25), np.linspace(0, 1, 13))
    points = np.column_stack([x.ravel(), y.ravel()])
    solutions = []
    for shift in (0.0, 1e-8):
        inward = points + shift * (np.array([1.0, 0.5]) - points)
        body = tawami.Body(inward, np.full(len(points), 2 / len(points)))
        scene = tawami.Scene(grid, body, tawami.linear_elastic(E=3e3, nu=0.4), form=form)
        scene.fix("left", "x")
        scene.fix("bottom", "y", lambda x, y: 1e-3 * x)
        solutions.append(scene.solve())
    assert solutions[0].unknowns == solutions[1].unknowns
    assert solutions[0].condition < 1e6
    np.testing.assert_allclose(
        solutions[0].displacement_of_particles,
        solutions[1].displacement_of_particles,
        # the gradient of eps_v jumps at the lines, so the inner particles' side matters a little
        atol=1e-9 if form == "u" else 5e-6,
    )


def test_a_solution_keeps_its_values_in_later_steps():
    scene = beam()
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1.0))
    first = scene.solve()
    before = first.mean_stress.copy()
    scene.traction("right", (0.0, -1.0))
    second = scene.solve()
    np.testing.assert_array_equal(first.mean_stress, before)
    np.testing.assert_allclose(second.mean_stress, 2 * before, atol=1e-9 * np.abs(before).max())


def test_coefficients_of_another_length_are_rejected():
    scene = beam()
    with pytest.raises(tawami.InputError, match="coefficients has 3 entries: expected 80"):
        scene.residual(np.zeros(3))


def test_many_solves_free_their_factorisations():
    """Memory after 30 more solves of 32 x 16 cells: their factorisations would take about 600 MB.

    Python frees scenes late, because they refer to themselves.
    """
    code = """
import logging, resource; logging.disable(logging.INFO)
from cases.verification.cantilever import mpm
def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
for k in range(40):
    scene = mpm.build("u_epsv", "paper", 16)
    scene.solve()
    if k == 9: before = peak()
print(peak() - before)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(run.stdout.splitlines()[-1]) < 150  # MPI may print lines before


def test_a_support_may_be_given_twice():
    solutions = []
    for times in (1, 2):
        scene = beam()
        for _ in range(times):
            scene.fix("left", "x")
            scene.hold((-1.0, 1.25), "y")
        scene.traction("right", (0.0, -1.0))
        solutions.append(scene.solve().u)
    np.testing.assert_array_equal(*solutions)


def test_a_support_that_misses_the_body_is_rejected():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, (0.0, grid.upper[1]), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3))
    loose = tawami.Scene(
        grid, tawami.Body(body.x, body.volume), tawami.linear_elastic(E=1.0, nu=0.3)
    )
    with pytest.raises(SupportError, match=r"fix\('right'\): the particles .* end 0.938 m away"):
        loose.fix("right", "x")
    with pytest.raises(
        tawami.InputError, match="no body there; the nearest particle is 1.03 m away"
    ):
        scene.hold((0.9, 1.0), "y")
    scene = tawami.Scene(
        grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u", basis="bilinear"
    )
    scene.fix("left", "x")
    scene.hold((0.2, 1.0), "y")  # near a particle, and functions without particles have a share
    with pytest.raises(SupportError, match="lies in a cell without particles"):
        scene.solve()
    with pytest.raises(tawami.InputError, match=r"traction\('right'\): the body has no border"):
        loose.traction("right", (0.0, -1.0))


@pytest.mark.parametrize("basis", ["bilinear", "biquadratic"])
def test_cells_without_particles_do_not_change_the_answer(basis):
    """Lagrange functions on the cells of the body are the same on a larger grid. Open splines are
    not: they are clamped at the end of the grid.
    """

    def solve(extra):
        grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(8 + extra, 4 + extra))
        body = tawami.box(grid, (0, 0), (2, 1), per_axis=3)
        material = tawami.linear_elastic(E=3e3, nu=0.4999)
        scene = tawami.Scene(grid, body, material, basis=basis)
        scene.fix("left", "x")
        scene.fix("bottom", "y", lambda x, y: 1e-3 * x**2)
        return scene.solve()

    tight, loose = solve(0), solve(5)
    assert loose.unknowns == tight.unknowns
    stresses = [np.array(s.scene.particles.stress) for s in (tight, loose)]
    assert np.abs(stresses[1] - stresses[0]).max() < 1e-9 * np.abs(stresses[0]).max()


@given(a=st.floats(-1, 1), b=st.floats(0.5, 2.0))
def test_any_point_of_the_body_can_be_held(a, b):
    scene = beam()
    scene.fix("left", "x")
    scene.fix("left", "y")
    if a > -0.99:
        scene.hold((a, b), "y", 1e-3)
        assert scene.solve().displacement((a, b))[1] == pytest.approx(1e-3, abs=1e-14)


def test_the_reduction_selects_each_free_coefficient_once():
    scene = beam()
    layout = scene.configuration.domain.layout
    place, cells = _place(scene.basis), np.arange(3)
    held = [
        constraints.held_edge(scene.grid, place, "left", cells, k, 0.0, "a support")
        for k in range(2)
    ]
    reduction = Reduction(layout, held, [], np.zeros(layout.size))
    assert reduction.size == layout.size - 2 * (3 + 2)
    assert (reduction.selection.sum(axis=0) == 1).all()
