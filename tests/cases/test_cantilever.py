"""The cantilever of the paper by the MPM: closed form, independent computation, orders."""

from __future__ import annotations

import numpy as np
import pytest
from particle_sums import Sum, functions_1d

import tawami
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import (
    MU,
    V_CLAMPED,
    V_THEORY,
    D,
    E,
    K,
    P,
    point_support_growth,
)

ALPHAS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)


def test_the_closed_form_is_that_of_plane_strain():
    """Eq. (3) with E/(1 - nu^2) in place of E, evaluated by hand."""
    assert pytest.approx(0.0102508666, abs=1e-10) == V_THEORY


def deflection_by_sums(scene: tawami.Scene, options: dict[str, object]) -> float:
    """Deflection of the tip with the support `paper`, by dense matrices and Lagrange multipliers.

    The tangent is a sum over particles, the load an integral of splines, both written in the tests.
    """
    matrix = Sum(scene, options, [(MU, K)]).matrix()
    (nx, ny), h = scene.grid.cells, scene.grid.h
    spline = "quadratic_spline"

    def values(x: float, y: float, component: int) -> np.ndarray:
        """Row of the displacement at a point given in cells."""
        fx = functions_1d(spline, nx, x, min(int(x), nx - 1))[0]
        fy = functions_1d(spline, ny, y, min(int(y), ny - 1))[0]
        row = np.zeros(len(matrix))
        row[component : 2 * len(fx) * len(fy) : 2] = np.outer(fy, fx).ravel()
        return row

    points, weights = np.polynomial.legendre.leggauss(3)
    load = np.zeros(len(matrix))
    for cell in range(ny):
        for point, weight in zip(points, weights, strict=True):
            y = cell + (point + 1) / 2
            load += -P / D * weight * h / 2 * values(nx, y, 1)
    # as many points of the root as there are splines along it hold them all
    held = [values(0.0, y, 0) for y in np.linspace(0, ny, ny + 2)] + [values(0.0, ny / 2, 1)]
    scale = np.abs(matrix).max()
    constraints = scale * np.array(held)
    system = np.block([[matrix, constraints.T], [constraints, np.zeros((len(held),) * 2)]])
    found = np.linalg.solve(system, np.append(load, np.zeros(len(held))))
    return -values(nx, ny / 2, 1) @ found[: len(matrix)]


@pytest.mark.parametrize(
    "options", [{"form": "u_epsv", "alpha": 0.1}, {"form": "u_bbar"}, {"form": "u"}]
)
def test_the_deflection_agrees_with_an_independent_computation(options):
    row, solution = mpm.solve(options["form"], "paper", 8, options.get("alpha"))
    expected = deflection_by_sums(solution.scene, options)
    assert row.deflection_m == pytest.approx(expected, rel=1e-7)


def test_the_deflection_of_a_point_support_grows_without_limit():
    """By the closed form of a point force (Kelvin) for each halving of h."""
    fine = [mpm.solve("u_epsv", "paper", n, 0.0)[0].deflection_m for n in (32, 64)]
    assert fine[1] - fine[0] == pytest.approx(point_support_growth(), rel=0.02)
    assert 100 * point_support_growth() / V_THEORY == pytest.approx(1.08, abs=0.005)


@pytest.mark.parametrize(("alpha", "error"), [(0.0, 0.453), (0.1, 1.954)])
def test_the_error_with_the_support_of_the_closed_form(alpha, error):
    """[%]. The code's own numbers, as `make cantilever` prints them."""
    row, _ = mpm.solve("u_epsv", "exact", 8, alpha)
    assert row.error_percent == pytest.approx(error, abs=0.005)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_the_deflection_converges_with_second_order(alpha):
    coarse, fine = (mpm.solve("u_epsv", "exact", n, alpha)[0].error_percent for n in (16, 32))
    assert np.log2(coarse / fine) > 1.9


def test_the_mean_stress_of_displacement_alone_is_ten_times_worse():
    """Relative errors in the L2 norm: the code's own numbers, as `make cantilever` prints them."""
    mixed = mpm.solve("u_epsv", "exact", 8, 0.1)[0].mean_stress_l2
    displacement = mpm.solve("u", "exact", 8)[0].mean_stress_l2
    assert mixed == pytest.approx(0.027, abs=0.001)
    assert displacement == pytest.approx(0.289, abs=0.005)


@pytest.mark.parametrize(
    ("stabilisation", "error", "order"),
    [("laplacian", 0.3845, 2), ("projection", 0.0330, 2), ("residual_based", 0.000155, 4)],
)
def test_the_error_of_each_stabilisation(stabilisation, error, order):
    """[%] with alpha = 0.1. Particles at Gauss points have no other error: alpha = 0 gives 4e-5 %.

    The orders are those of the terms, the numbers the code's own.
    """

    def solve(n):
        options = {"per_axis": 3, "gauss": True, "stabilisation": stabilisation}
        return mpm.solve("u_epsv", "exact", n, 0.1, **options)[0].error_percent

    coarse, fine = solve(8), solve(16)
    assert fine == pytest.approx(error, rel=0.02)
    assert np.log2(coarse / fine) > order - 0.1


def test_the_clamped_beam_converges_to_its_own_limit():
    rows = [mpm.solve("u_epsv", "clamped", n, 0.1)[0] for n in (8, 16, 32)]
    distances = [abs(row.deflection_m - V_CLAMPED) for row in rows]
    assert distances[2] < distances[1] < distances[0]
    assert distances[2] < 0.006 * V_CLAMPED


@pytest.mark.parametrize("method", ["u_epsv", "u_p"])
@pytest.mark.parametrize("alpha", [0.0, 0.1])
def test_one_iteration_for_any_poissons_ratio(method, alpha):
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
    # the same beam by nu itself
    again = mpm.build(
        method, "paper", 8, material=tawami.linear_elastic(E=E, nu=0.499999999), alpha=alpha
    )
    assert -again.solve().displacement((2.0, 0.0))[1] == pytest.approx(deflections[2], rel=1e-7)


def test_u_p_solves_an_incompressible_beam():
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


def test_the_solution_is_antisymmetric():
    """In y, with the support of the closed form."""
    scene = mpm.build("u_epsv", "exact", 8, alpha=0.1)
    solution = scene.solve()
    for x in (0.3, 1.0, 1.7):
        up, down = solution.displacement((x, 0.3)), solution.displacement((x, -0.3))
        assert up[0] == pytest.approx(-down[0], rel=1e-9)
        assert up[1] == pytest.approx(down[1], rel=1e-9)
    assert solution.displacement((0.0, 0.0))[1] == pytest.approx(0, abs=1e-15)
    assert scene.grid.upper == (2.0, D / 2)
