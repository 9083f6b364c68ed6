"""Multigrid: its operators and grids, iterations that do not grow, and the choice of a linear solver."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import grid_of

import tawami
from cases.verification.cantilever import mpm
from tawami.base.petsc import rows_of
from tawami.field.block import Block
from tawami.field.reduction import Reduction
from tawami.grid.basis import BASES, refinement, values_1d
from tawami.solve import choice, memory, numerics


def solved(n: int, nu: float = 0.4999, form: str = "u_epsv", **options) -> tawami.Solution:
    """The cantilever with 2n x n cells by multigrid."""
    rubber = tawami.linear_elastic(E=3e6, nu=nu)
    options = {"material": rubber, "linear_solver": "multigrid"} | options
    return mpm.build(form, "paper", n, **options).solve()


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("n", [1, 2, 5, 8])
def test_coarse_functions_are_sums_of_fine_ones(basis, n):
    t = np.linspace(0.0, 1.0, 7)
    cell, t = np.repeat(np.arange(n), 7), np.tile(t, n)
    fine = values_1d(basis, n, cell, t)
    coarse = values_1d(basis, (n + 1) // 2, cell // 2, (cell % 2 + t) / 2)
    assert abs(fine @ refinement(basis, n) - coarse).max() < 1e-14


@pytest.mark.parametrize("geometry", ["plane_strain", "axisymmetric"])
def test_the_energy_of_a_linear_displacement(geometry):
    """u = (a x + b y, c x + d y); in axisymmetry the hoop strain is a if b = 0."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(3, 4), geometry=geometry)
    body = tawami.box(grid, (0.0, 0.0), (1.5, 1.3), per_axis=3)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u")
    domain = scene.configuration.domain
    layout = domain.layout
    block = Block(domain.assembly.attachment, Reduction.of_all(layout), layout.fields["u"])
    mu, lame = 2.0, 5.0
    data = np.tile([mu, lame], (len(domain.particles), 1))
    matrix = rows_of(block.assembled("elasticity", data))
    a, b, c, d = 0.3, 0.0 if geometry == "axisymmetric" else 0.7, -0.2, 0.4
    u = (layout.greville @ np.array([[a, c], [b, d]])).ravel()[block.coefficients]
    hoop = a if geometry == "axisymmetric" else 0.0
    energy = 2 * mu * (a**2 + d**2 + hoop**2 + (b + c) ** 2 / 2) + lame * (a + d + hoop) ** 2
    volume = domain.particles.volume.sum()
    assert u @ matrix @ u == pytest.approx(energy * volume, rel=1e-12)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4999, 0.499999])
def test_iterations_grow_neither_with_the_grid_nor_with_the_bulk_modulus(nu):
    iterations = [sum(solved(n, nu, alpha=0.01, tolerance=1e-8).krylov) for n in (16, 31, 48)]
    assert max(iterations) <= 1.15 * min(iterations)
    assert max(iterations) <= 60


def test_iterations_of_other_forms():
    assert max(solved(32, 0.5, "u_p", tolerance=1e-8).krylov) <= 60
    assert max(solved(32, 0.3, "u", tolerance=1e-8).krylov) <= 30
    assert max(solved(32, 0.3, "u_bbar", tolerance=1e-8).krylov) <= 30
    assert max(solved(32, alpha=1.0, tolerance=1e-8).krylov) <= 60


def layered(contrast: float, sliver: float, solver: str) -> tawami.Solution:
    """A block of two materials that ends a small part of a cell behind a line of the grid."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1 / 16, cells=(33, 17))
    body = tawami.box(grid, (0.0, 0.0), (2 + sliver / 16, 1 + sliver / 16))
    laws = [tawami.linear_elastic(E=E, nu=0.4999) for E in (3e6, 3e6 * contrast)]
    upper = (body.x[:, 1] > 0.5).astype(int)
    scene = tawami.Scene(
        grid, body, laws, material_of=upper, alpha=0.01, tolerance=1e-8, linear_solver=solver
    )
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.load(body.x[:, 0] > 1.9, (0.0, -1e3))
    return scene.solve()


@pytest.mark.parametrize(("contrast", "sliver", "most"), [(1.0, 1e-3, 90), (1e3, 0.0, 120)])
def test_iterations_with_slivers_and_a_contrast(contrast, sliver, most):
    direct, found = (layered(contrast, sliver, solver) for solver in ("direct", "multigrid"))
    assert 0 < max(found.krylov) <= most
    assert np.abs(found.u - direct.u).max() < 1e-7 * np.abs(direct.u).max()


@pytest.mark.parametrize("cells", [(20, 20), (1, 1), (33, 17)])
def test_the_body_may_have_two_parts_or_one_cell(cells):
    """Two columns three cells apart; their parts of a coarse function have unknowns of their own."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1.0, cells=cells)
    body = tawami.box(grid, (0.0, 0.0), (min(2.0, cells[0]), cells[1]))
    if cells[0] > 5:
        body += tawami.box(grid, (5.0, 0.0), grid.upper)
    solutions = []
    for solver in ("multigrid", "direct"):
        law = tawami.linear_elastic(E=1e3, nu=0.4999)
        scene = tawami.Scene(grid, body, law, alpha=0.01, linear_solver=solver)
        scene.fix("bottom", "x")
        scene.fix("bottom", "y")
        scene.load(body.x[:, 1] > cells[1] / 2, (1e-3, -1e-3))
        solutions.append(scene.solve())
    found, direct = solutions
    assert 0 < max(found.krylov) <= 42
    assert np.abs(found.u - direct.u).max() < 1e-9 * np.abs(direct.u).max()


@pytest.mark.parametrize("options", [{"stabilisation": "residual_based"}, {"ghost_penalty": "on"}])
def test_the_solution_is_that_of_the_direct_solver(options):
    options = {"alpha": 0.03, "tolerance": 1e-12, **options}
    found, direct = (solved(12, linear_solver=name, **options) for name in ("multigrid", "direct"))
    assert np.abs(found.u - direct.u).max() < 1e-9 * np.abs(direct.u).max()


def test_a_linear_problem_is_solved_once_to_the_same_answer():
    found, direct = (solved(16, linear_solver=name) for name in ("multigrid", "direct"))
    assert found.iterations == 1
    assert np.abs(found.u - direct.u).max() < 1e-9 * np.abs(direct.u).max()


def heated(solver: str) -> tawami.Solution:
    """A wall that is heated from above."""
    scene = square("u_epsv_theta", solver, E=3e10, density=2400.0)
    for name, value in (("expansion", 1e-5), ("conductivity", 2.0), ("capacity", 900.0)):
        scene.data(name, value)
    scene.fix("top", "theta", 100.0)
    return scene.solve(until=1e4)


def drained(solver: str) -> tawami.Solution:
    """Soil under a load, shortly after it: the pore pressure bears most of it."""
    scene = square("u_epsv_pw", solver, E=1e7)
    scene.data("kappa", 1e-12)
    scene.fix("top", "p_w", 0.0)
    scene.load(scene.particles.x[:, 0] > 0.5, (0.0, -1e3))
    return scene.solve(until=10.0)


def cracked(solver: str) -> tawami.Solution:
    """A plate with a crack across half of it."""
    scene = square("u_epsv_damage", solver, E=1e9)
    for name, value in (("G_c", 100.0), ("l", 1 / 8)):
        scene.data(name, value)
    x, y = scene.particles.x.T
    scene.data("H", np.where((abs(y - 0.5) < 1 / 16) & (x < 0.5), 1e3 * 100.0 * 4, 0.0))
    scene.fix("top", "y", 1e-4)
    return scene.solve()


def square(form: str, solver: str, E: float, **options) -> tawami.Scene:
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1 / 16, cells=(16, 16))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1.0))
    law = tawami.linear_elastic(E=E, nu=0.3)
    scene = tawami.Scene(
        grid, body, law, form=form, linear_solver=solver, tolerance=1e-10, **options
    )
    for edge, component in (("left", "x"), ("bottom", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    return scene


@pytest.mark.parametrize(("solve", "most"), [(heated, 45), (drained, 60), (cracked, 90)])
def test_fields_of_the_users_have_blocks_of_their_own(solve, most):
    found, direct = solve("multigrid"), solve("direct")
    assert 0 < min(found.krylov) <= max(found.krylov) <= most
    assert np.abs(found.u - direct.u).max() < 1e-8 * np.abs(direct.u).max()


def test_a_form_that_multigrid_does_not_suit_is_factorised():
    with pytest.warns(tawami.SolverWarning, match="alpha = 0: the pair of spaces is unstable"):
        assert solved(8, alpha=0.0).krylov == (0,)
    with pytest.warns(tawami.SolverWarning, match="without a field for the volume"):
        assert solved(8, form="u").krylov == (0,)


def block(**options) -> tawami.Scene:
    grid = grid_of((6, 6))
    body = tawami.box(grid, grid.origin, grid.upper)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1e-3))
    return scene


@pytest.mark.direct
def test_the_solver_is_chosen_by_the_number_of_unknowns(monkeypatch):
    scene = block()
    assert f"fewer than {numerics.SMALL}" in scene.header()
    assert scene.solve().krylov == (0,)
    monkeypatch.setattr(choice, "SMALL", 10)
    monkeypatch.setattr(choice, "FACTORISATION", 1e3)
    scene = block()
    header = " ".join(scene.header().split())
    assert "multigrid (GMRES, grids of 6 x 6, 3 x 3, 2 x 2 cells and coarser) while it" in header
    assert min(scene.solve().krylov) > 0
    assert block(alpha=0.0).solve().krylov == (0,)


@pytest.mark.direct
def test_a_factorisation_follows_once_it_would_have_been_cheaper(monkeypatch):
    monkeypatch.setattr(choice, "SMALL", 10)
    monkeypatch.setattr(choice, "FACTORISATION", 100.0)
    scene, krylov = block(), []
    for k in range(9):
        scene.traction("right", (0.0, -1e-3 * (k + 1)))
        krylov += scene.solve().krylov
    assert krylov[0] > 5
    assert 0 in krylov


def test_memory_that_does_not_suffice(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda comm: 1e5)
    monkeypatch.setattr(memory, "LITTLE", 0.0)
    with pytest.raises(tawami.SolverError, match="needs about .* GB .* expected at most about"):
        block(linear_solver="direct").solve()
    monkeypatch.setattr(memory, "available", lambda comm: 1e9)
    assert min(block(linear_solver="multigrid").solve().krylov) > 0


def test_multigrid_solves_where_a_factorisation_does_not_fit(monkeypatch):
    monkeypatch.setattr(choice, "SMALL", 10)
    monkeypatch.setattr(choice, "FACTORISATION", 0.0)
    monkeypatch.setattr(memory, "of_factors", lambda unknowns, symmetric: np.inf)
    assert min(block().solve().krylov) > 0
