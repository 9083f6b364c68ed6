"""Reused factorisations give the same results as new ones."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import pairwise

import numpy as np
import pytest
from scenes import grid_of
from scipy.sparse import csr_matrix
from ufl import div, grad, inner

import tawami
from cases.verification.cantilever import mpm
from tawami.base.errors import InexactSumWarning
from tawami.field import PointAssembly
from tawami.form import vector
from tawami.form.form import Form
from tawami.solve import direct
from tawami.solve.scaling import Scaling

#: Whatever solver the session names.
pytestmark = pytest.mark.direct


def hardening(strength):
    """Displacement only, with a stress that grows with the cube of the volume change."""

    def residual(u, w, sigma, mu, sum_p):
        harder = sum_p(strength * mu, inner(div(u) ** 3, div(w)))
        return sum_p(sigma, grad(w)) + harder

    return Form({"u": vector("w")}, residual)


def beam(form, **options):
    grid = grid_of((8, 4), h=0.25)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
    material = tawami.linear_elastic(E=1e3, nu=0.2)
    inexact = options.get("assembly") == "dolfinx"
    with pytest.warns(InexactSumWarning) if inexact else nullcontext():  # degree 6
        scene = tawami.Scene(grid, body, material, form=form, tolerance=1e-11, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (120.0, 20.0))
    return scene


@pytest.mark.parametrize("assembly", ["points", "dolfinx"])
def test_a_factorisation_is_reused_in_a_step_and_the_next(assembly, monkeypatch):
    form = hardening(20.0)
    scene = beam(form, assembly=assembly)
    first = scene.solve()
    assert first.iterations > 3
    assert first.krylov[0] == 0
    assert all(0 < number <= direct.PAYS for number in first.krylov[1:])
    scene.traction("right", (12.0, 2.0))
    second = scene.solve()
    assert 0 not in second.krylov
    monkeypatch.setattr(direct, "PAYS", -1)
    again = beam(hardening(20.0), assembly=assembly)
    every_time = again.solve()
    assert set(every_time.krylov) == {0}
    assert np.abs(first.u - every_time.u).max() < 1e-10 * np.abs(first.u).max()
    assert first.iterations <= every_time.iterations + 1
    again.traction("right", (12.0, 2.0))
    assert np.abs(second.u - again.solve().u).max() < 1e-10 * np.abs(first.u).max()


def test_a_tangent_that_changed_too_much_is_factorised_again(monkeypatch):
    slow = beam(hardening(3e4)).solve()
    late = [k for k, number in enumerate(slow.krylov[:-1]) if number > direct.PAYS]
    assert late
    assert all(slow.krylov[k + 1] == 0 for k in late)
    monkeypatch.setattr(direct, "LIMIT", 1)  # too many iterations lead to a new factorisation
    at_once = beam(hardening(3e4)).solve()
    assert at_once.krylov.count(0) > slow.krylov.count(0)
    assert np.abs(at_once.u - slow.u).max() < 1e-9 * np.abs(slow.u).max()


@pytest.mark.parametrize("form", ["u", "u_epsv", "u_p"])
@pytest.mark.parametrize("load", [10.0, 20.0, 40.0])
def test_a_load_beyond_the_strength_raises_an_error(form, load):
    """The deviator is bounded: the iterates diverge and must not count as converged."""
    K, mu = 2.0, 1.0
    unit = np.array([1.0, 1.0, 1.0, 0.0])
    weight = np.array([1.0, 1.0, 1.0, 0.5])  # of gamma_xy in e : e

    def respond(strain, stress):
        volume = strain[:, :3].sum(axis=1)
        e = strain - volume[:, None] / 3 * unit
        root = np.sqrt(1 + 1e3 * (weight * e**2).sum(axis=1))[:, None]
        s = 2 * mu * weight * e / root
        projector = np.eye(4) - np.outer(unit, unit) / 3
        slope = (
            2
            * mu
            * (
                np.diag(weight)[None] / root[..., None]
                - 1e3 * np.einsum("ni,nj->nij", weight * e, weight * e) / root[..., None] ** 3
            )
        )
        tangent = slope @ projector + K * np.outer(unit, unit)
        return stress + s + K * volume[:, None] * unit, tangent

    grid = grid_of((8, 4), h=0.25)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.NumpyLaw(respond, K=K, mu=mu), form=form)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -load))
    with pytest.raises((tawami.SingularError, tawami.ConvergenceError)):
        scene.solve()
    assert not scene.particles.stress.any()


@pytest.mark.parametrize("stabilisation", ["laplacian", "residual_based"])
def test_mumps_works_with_the_options_that_were_chosen(stabilisation, monkeypatch):
    """INFOG(7) is the ordering that MUMPS used. PETSc 3.18 ignores ICNTL(7) set by a call."""
    used = []
    mumps = direct.DirectSolver._mumps

    def observed(self, *arguments):
        result, factor = mumps(self, *arguments), self._handles["factor"]
        used.append([factor.getMumpsInfog(7), *(factor.getMumpsIcntl(k) for k in (6, 7, 8, 14))])
        return result

    monkeypatch.setattr(direct.DirectSolver, "_mumps", observed)
    solution = mpm.build("u_epsv", "paper", 16, alpha=0.1, stabilisation=stabilisation).solve()
    assert solution.symmetric == (stabilisation == "laplacian")
    assert used == [[6, 0, 6, 0, direct.ROOM[0]]]


@pytest.fixture
def analyses(monkeypatch):
    """The solvers of all analyses, in their order."""
    analyses = []
    analyse = direct.DirectSolver._analyse_next

    def counted(self, *arguments):
        analyses.append(self)
        analyse(self, *arguments)

    monkeypatch.setattr(direct.DirectSolver, "_analyse_next", counted)
    return analyses


def test_the_analysis_serves_all_factorisations_of_one_matrix(analyses, monkeypatch):
    scenes = [beam(hardening(20.0), factorise="always") for _ in range(2)]
    once = scenes[0].solve()
    assert len(once.krylov) > 3
    assert len(analyses) == 1
    mumps = direct.DirectSolver._mumps

    def anew(self, *arguments):
        self._analysed = None
        return mumps(self, *arguments)

    monkeypatch.setattr(direct.DirectSolver, "_mumps", anew)
    every_time = scenes[1].solve()
    assert len(analyses) == 1 + len(every_time.krylov)
    assert once.u.tobytes() == every_time.u.tobytes()


def pile(steps):
    """Particles after steps of a sliding pile, and each step's matrix and number of unknowns."""
    grid = grid_of((8, 4), h=0.25)
    body = tawami.box(grid, grid.origin, (grid.origin[0] + 1.0, grid.upper[1]), per_axis=2)
    sand = tawami.drucker_prager(tawami.linear_elastic(E=1e5, nu=0.3), phi=30.0, c=10.0)
    scene = tawami.Scene(grid, body, sand, form="u_epsv_finite", density=1e3)
    scene.gravity((0.0, -9.81))
    scene.fix("bottom", "y")
    motion = tawami.Dynamics(scene, velocity=(1.0, 0.0))
    matrices = []
    for _ in range(steps):
        assembly = scene.configuration.domain.assembly
        motion.step(0.025)
        matrices.append((assembly._matrix.summed(), assembly.reduction.size))
    return scene.particles.rows(), matrices


def test_pattern_and_analysis_are_kept_when_the_grid_is_reset(analyses, monkeypatch):
    """As long as the unknowns are the same, and with the same bits as without."""
    kept, matrices = pile(10)
    changes = sum(a[1] != b[1] for a, b in pairwise(matrices))
    assert 1 <= changes < 8  # the pile enters other cells, and not in every step
    assert changes + 1 == len({id(matrix) for matrix, _ in matrices}) <= len(analyses) < 10
    monkeypatch.setattr(PointAssembly, "follow", lambda self, earlier: None)
    anew, _ = pile(10)
    assert kept.tobytes() == anew.tobytes()


def test_iterations_that_cost_more_than_a_factorisation_are_not_made():
    """Of a residual that falls by a tenth in each iteration, and of one that falls by nine tenths."""
    pays = direct._Pays(1e-6)
    assert [pays(None, k, 0.1**k) for k in range(6)] == [0] * 6
    assert pays(None, 7, 0.1**7) > 0
    pays = direct._Pays(1e-6)
    assert [pays(None, k, 0.9**k) for k in range(direct.TRIAL)] == [0] * direct.TRIAL
    assert pays(None, direct.TRIAL, 0.9**direct.TRIAL) < 0
    assert pays(None, direct.TRIAL, np.nan) < 0


def test_a_tangent_with_nan_is_named():
    def residual(u, w, sigma, mu, sum_p):
        root = sum_p(mu, inner((div(u) ** 2) ** 0.5, div(w)))
        return sum_p(sigma, grad(w)) + root

    form = Form({"u": vector("w")}, residual)
    with pytest.raises(tawami.SingularError, match="the tangent holds NaN or infinity"):
        beam(form).solve()


def test_other_supports_need_a_new_factorisation():
    scene = beam(hardening(20.0))
    scene.solve()
    scene.hold((1.0, 1.0), "y", 1e-3)
    assert scene.solve().krylov[0] == 0


def test_a_linear_scene_needs_one_iteration_on_an_old_factorisation():
    scene = mpm.build("u_epsv", "paper", 8, alpha=0.1)
    once = scene.solve()
    scene.traction("right", (0.0, -1e3))
    twice = scene.solve()
    assert twice.krylov == (1,)
    assert max(twice.history[-1]) < 1e-10
    assert np.abs(twice.u - 2 * once.u).max() < 1e-10 * np.abs(once.u).max()


def test_an_unsymmetric_tangent_is_solved():
    scene = mpm.build("u_epsv", "paper", 8, alpha=0.1, stabilisation="residual_based")
    first = scene.solve()
    assert not first.symmetric
    scene.traction("right", (0.0, -1e3))
    assert scene.solve().krylov == (1,)


@pytest.mark.parametrize("method", ["u", "u_epsv"])
def test_the_condition_number_agrees_with_the_dense_inverse(method):
    """Within a factor of three, which is the accuracy of a few random vectors."""
    options = {"alpha": 0.1} if method == "u_epsv" else {}
    scene = mpm.build(method, "clamped", 4, **options)
    solution = scene.solve()
    domain, reduction = scene.configuration.domain, scene.reduction()
    c = np.zeros(scene.num_coefficients)
    domain.newton.internal(c)
    matrix = domain.assembly.tangent(c, domain.responses.data, reduction)
    scale = Scaling(domain.layout, domain.responses).factors(matrix, reduction)
    start, columns, values = matrix.getValuesCSR()
    dense = csr_matrix((values, columns, start)).toarray() * scale * scale[:, None]
    exact = np.linalg.norm(dense) / np.sqrt(len(dense)) * np.linalg.norm(np.linalg.inv(dense))
    assert exact / 3 < solution.condition < 3 * exact


def test_repeated_solutions_have_the_same_bits():
    runs = [beam(hardening(20.0)).solve() for _ in range(2)]
    assert runs[0].u.tobytes() == runs[1].u.tobytes()
    assert runs[0].stress.tobytes() == runs[1].stress.tobytes()
