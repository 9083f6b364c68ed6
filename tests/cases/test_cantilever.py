"""The cantilever of the paper by MPM: published closed form, reference values, orders."""

from __future__ import annotations

import numpy as np
import pytest

import tawami
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import V_THEORY, D, E, point_support_growth

ALPHAS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)


def test_theory():
    assert pytest.approx(0.0102508666, abs=1e-10) == V_THEORY


@pytest.mark.parametrize(
    ("method", "alpha", "deflection"),
    [("u_epsv", 0.1, 0.01115905951), ("u_bbar", None, 0.01102969148), ("u", None, 0.01077931363)],
)
def test_support_paper(method, alpha, deflection):
    row, _ = mpm.solve(method, "paper", 8, alpha)
    assert row.deflection_m == pytest.approx(deflection, rel=1e-6)


def test_support_paper_grows_without_limit():
    """Slope of the logarithm against the closed form of a point force (Kelvin)."""
    fine = [mpm.solve("u_epsv", "paper", n, 0.0)[0].deflection_m for n in (32, 64)]
    assert fine[1] - fine[0] == pytest.approx(point_support_growth(), rel=0.02)
    assert 100 * point_support_growth() / V_THEORY == pytest.approx(1.08, abs=0.005)


@pytest.mark.parametrize(("alpha", "error"), [(0.0, 0.453), (0.1, 1.954)])
def test_support_exact(alpha, error):
    row, _ = mpm.solve("u_epsv", "exact", 8, alpha)
    assert row.error_percent == pytest.approx(error, abs=0.005)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_observed_order(alpha):
    coarse, fine = (mpm.solve("u_epsv", "exact", n, alpha)[0].error_percent for n in (16, 32))
    assert np.log2(coarse / fine) > 1.9


def test_mean_stress_tells_locking_from_none():
    mixed = mpm.solve("u_epsv", "exact", 8, 0.1)[0].mean_stress_l2
    displacement = mpm.solve("u", "exact", 8)[0].mean_stress_l2
    assert mixed == pytest.approx(0.027, abs=0.001)
    assert displacement == pytest.approx(0.289, abs=0.005)


@pytest.mark.parametrize(
    ("stabilisation", "error", "order"),
    [("laplacian", 0.3845, 2), ("projection", 0.0330, 2), ("residual_based", 0.000155, 4)],
)
def test_what_each_stabilisation_adds_to_the_error(stabilisation, error, order):
    """alpha = 0.1, Gauss points as particles, so that nothing else does (alpha = 0: 4e-5 %)."""

    def solve(n):
        options = {"per_axis": 3, "gauss": True, "stabilisation": stabilisation}
        return mpm.solve("u_epsv", "exact", n, 0.1, **options)[0].error_percent

    coarse, fine = solve(8), solve(16)
    assert fine == pytest.approx(error, rel=0.02)
    assert np.log2(coarse / fine) > order - 0.1


def test_clamped_support_tends_to_its_own_limit():
    rows = [mpm.solve("u_epsv", "clamped", n, 0.1)[0] for n in (8, 16, 32)]
    distances = [abs(row.deflection_m - 0.009684) for row in rows]
    assert distances[2] < distances[1] < distances[0]
    assert distances[2] < 0.006 * 0.009684


@pytest.mark.parametrize("method", ["u_epsv", "u_p"])
@pytest.mark.parametrize("alpha", [0.0, 0.1])
def test_one_iteration_whatever_poissons_ratio(method, alpha):
    """Both measures below 1e-10 after one iteration; the deflection changes with 1 - 2 nu."""
    compressibility = [2e-4, 2e-6, 2e-9, 2e-12]
    deflections = []
    for small in compressibility:
        material = tawami.linear_elastic(E=E, one_minus_2nu=small)
        scene = mpm.build(method, "paper", 8, material=material, alpha=alpha, tolerance=1e-10)
        solution = scene.solve()
        assert solution.iterations == 1
        assert solution.symmetric
        assert max(solution.history[-1]) < 1e-10
        assert solution.condition < 1e4
        deflections.append(-solution.displacement((2.0, 0.0))[1])
    change = np.diff(deflections) / deflections[-1]
    assert abs(change[0]) < 2e-4
    assert abs(change[1]) < abs(change[0]) / 50
    assert abs(change[2]) < 1e-8
    # nu as a number: the same beam
    again = mpm.build(
        method, "paper", 8, material=tawami.linear_elastic(E=E, nu=0.499999999), alpha=alpha
    )
    assert -again.solve().displacement((2.0, 0.0))[1] == pytest.approx(deflections[2], rel=1e-7)


def test_incompressible_exactly_with_u_p():
    scene = mpm.build("u_p", "paper", 8, material=tawami.linear_elastic(E=E, nu=0.5), alpha=0.1)
    nearly = mpm.build(
        "u_p", "paper", 8, material=tawami.linear_elastic(E=E, one_minus_2nu=2e-12), alpha=0.1
    )
    v = [s.solve().displacement((2.0, 0.0))[1] for s in (scene, nearly)]
    assert v[0] == pytest.approx(v[1], rel=1e-9)
    assert np.isfinite(scene.particles.stress).all()


def test_u_p_and_u_epsv_are_one_method_for_a_linear_material():
    a = mpm.solve("u_p", "exact", 8, 0.1)[0]
    b = mpm.solve("u_epsv", "exact", 8, 0.1)[0]
    assert a.deflection_m == pytest.approx(b.deflection_m, rel=1e-9)
    assert a.mean_stress_l2 == pytest.approx(b.mean_stress_l2, rel=1e-6)


def test_mirror_symmetry():
    """The exact beam is antisymmetric in y."""
    scene = mpm.build("u_epsv", "exact", 8, alpha=0.1)
    solution = scene.solve()
    for x in (0.3, 1.0, 1.7):
        up, down = solution.displacement((x, 0.3)), solution.displacement((x, -0.3))
        assert up[0] == pytest.approx(-down[0], rel=1e-9)
        assert up[1] == pytest.approx(down[1], rel=1e-9)
    assert solution.displacement((0.0, 0.0))[1] == pytest.approx(0, abs=1e-15)
    assert scene.grid.upper == (2.0, D / 2)
