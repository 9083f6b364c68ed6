"""Modified Cam-Clay in scenes: a homogeneous block on closed-form paths, or integrated by scipy."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import tawami

K, MU, M, THETA = 5e6, 3e6, 1.1, 0.04
P_C, P_T = 1e5, 100.0  # [Pa]
CLAY = {"M": M, "lambda_star": 0.05, "kappa_star": 0.01, "preconsolidation": P_C, "tension": 1e-3}
ONE = np.array([1.0, 1.0, 1.0, 0.0])
MIXED = ("u_epsv", "u_p")
SMALL = ("u", "u_bbar", *MIXED)


def block(form, p, bulk=K, geometry="plane_strain", **options):
    """A square of 1 m that fills its grid, under the pressure p [Pa], on a smooth floor and side."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(2, 2), geometry=geometry)
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=3, gauss=True)
    law = tawami.cam_clay(tawami.linear_elastic(K=bulk, mu=MU), **(CLAY | options))
    scene = tawami.Scene(grid, body, law, form=form, tolerance=1e-10)
    scene.initial("stress", (-p, -p, -p, 0.0))
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    return scene


def state(scene):
    """p, q and p_c [Pa] of the particles, which are all equal."""
    stress = np.array(scene.particles.stress)
    assert np.ptp(stress, axis=0).max() < 1e-6 * P_C
    p = -stress[0, :3].mean()
    s = stress[0] + p * ONE
    return p, np.sqrt(1.5 * (s**2 @ [1, 1, 1, 2])), scene.particles.history("preconsolidation")[0]


def excess(p, q, p_c, p_t=P_T):
    """The yield function over the size of the ellipse."""
    return ((q / M) ** 2 + (p + p_t) * (p - p_c)) / p_c**2


def rate(stress, p_c, theta=THETA):
    """Tangent of the rate equations (4 x 4) and d p_c / d strain (4), from their definition."""
    p = -stress[:3].mean()
    s = stress + p * ONE
    g = 2 * p + P_T - p_c
    n = 3 / M**2 * s * [1, 1, 1, 2] - g / 3 * ONE  # dF/d sigma, as a strain
    dev = np.diag([1, 1, 1, 0.5]) - np.outer(ONE, ONE) / 3
    C = K * np.outer(ONE, ONE) + 2 * MU * dev
    hardening = (p + P_T) * p_c * g / theta
    multiplier = n @ C / (n @ C @ n + hardening)
    return C - np.outer(C @ n, multiplier), p_c * g / theta * multiplier


@pytest.mark.parametrize("form", SMALL)
def test_the_volume_is_the_sum_of_both_lines(form):
    """eps_v = theta ln(p_c / p_c0) + (p - p_0) / K on every path, here with two equal strains."""
    scene = block(form, P_C)
    for edge, component in (("right", "x"), ("top", "y")):
        scene.fix(edge, component, -0.02)
    scene.solve()
    p, q, p_c = state(scene)
    assert excess(p, q, p_c) == pytest.approx(0, abs=1e-9)
    assert THETA * np.log(p_c / P_C) + (p - P_C) / K == pytest.approx(0.04, rel=1e-8)


@pytest.mark.parametrize(("ocr", "ratio"), [(1.0, 1.7), (1.6, 1.7), (1.0, 40.0), (1.6, 40.0)])
@pytest.mark.parametrize("form", SMALL)
def test_undrained_shear_has_the_stress_path_of_its_closed_form(form, ocr, ratio):
    """At a constant volume p / K + theta ln p_c is constant, up to the critical state."""
    p_0, bulk = P_C / ocr, ratio * MU
    scene = block(form, p_0, bulk)
    right, top = scene.fix("right", "x", 0.0), scene.fix("top", "y", 0.0)

    def change(p, p_c):
        return (p - p_0) / (bulk * THETA) + np.log(p_c / P_C)

    for strain in (0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.16):
        right.change(strain)
        top.change(-strain)
        scene.solve()
        p, q, p_c = state(scene)
        assert change(p, p_c) == pytest.approx(0, abs=1e-6)
        assert excess(p, q, p_c) == pytest.approx(0, abs=1e-9) or p_c == P_C
    # critical state: the strength is M (p_u + p_t)
    p_u = brentq(lambda p: change(p, 2 * p + P_T), 0.1 * P_C, P_C)
    assert (p, q, p_c) == pytest.approx((p_u, M * (p_u + P_T), 2 * p_u + P_T), rel=1e-2)


@pytest.mark.parametrize("form", SMALL)
def test_oedometer_converges_to_the_rate_equations(form):
    """No strain sideways; the error of implicit steps is halved with the step."""
    strain = 0.1

    def equations(_, y):
        tangent, hardening = rate(y[:4], y[4])
        return -strain * np.append(tangent[:, 1], hardening[1])

    start = [-P_C, -P_C, -P_C, 0.0, P_C]
    exact = solve_ivp(equations, (0, 1), start, rtol=1e-10, atol=1e-3).y[:, -1]
    errors = []
    for steps in (10, 20):
        scene = block(form, P_C)
        scene.fix("right", "x")
        top = scene.fix("top", "y", 0.0)
        for k in range(1, steps + 1):
            top.change(-strain * k / steps)
            scene.solve()
        errors.append(abs(scene.particles.stress[0, 1] / exact[1] - 1))
        assert state(scene)[2] == pytest.approx(exact[4], rel=0.05)
    assert errors[0] < 0.02
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.15)


@pytest.mark.parametrize("form", ["u", "u_epsv"])
def test_drained_compression_ends_at_the_critical_state(form):
    """The pressure on the side is constant; the path is that of the rate equations."""
    strain, steps, theta = 0.15, 20, 0.01

    def equations(_, y):
        tangent, hardening = rate(y[:4], y[4], theta)
        side = -tangent[0, 1] / tangent[0, 0]  # no change of sigma_xx
        e = -strain * np.array([side, 1.0, 0.0, 0.0])
        return np.append(tangent @ e, hardening @ e)

    start = [-P_C, -P_C, -P_C, 0.0, P_C]
    exact = solve_ivp(equations, (0, 1), start, rtol=1e-9, atol=1e-3).y[:, -1]
    scene = block(form, P_C, kappa_star=CLAY["lambda_star"] - theta)
    scene.traction("right", (-P_C, 0.0))
    top = scene.fix("top", "y", 0.0)
    for k in range(1, steps + 1):
        top.change(-strain * k / steps)
        scene.solve()
    assert scene.particles.stress[0] == pytest.approx(exact[:4], rel=0.03, abs=1.0)
    p, q, p_c = state(scene)
    assert q == pytest.approx(M * (p + P_T), rel=0.05)
    assert p_c == pytest.approx(2 * p + P_T, rel=0.1)


@pytest.mark.parametrize("form", ["u", "u_epsv", "u_p"])
def test_drained_triaxial_compression_has_the_stress_path_and_volume_of_its_closed_form(form):
    """A cylinder under a constant pressure on its side: q = 3 (p - p_0) up to q = M (p + p_t)."""
    scene = block(form, P_C, geometry="axisymmetric", kappa_star=CLAY["lambda_star"] - 0.01)
    scene.traction("right", (-P_C, 0.0))
    top = scene.fix("top", "y", 0.0)
    for strain in (0.01, 0.02, 0.04, 0.08, 0.12, 0.16):
        top.change(-strain)
        solution = scene.solve()
        p, q, p_c = state(scene)
        assert q == pytest.approx(3 * (p - P_C), rel=1e-6)
        assert excess(p, q, p_c) == pytest.approx(0, abs=1e-8)
        radial = solution.displacement((1.0, 0.5))[0]
        volume = 0.01 * np.log(p_c / P_C) + (p - P_C) / K
        assert strain - 2 * radial == pytest.approx(volume, rel=1e-5)
    p_f = (3 * P_C + M * P_T) / (3 - M)
    assert (p, q, p_c) == pytest.approx((p_f, M * (p_f + P_T), 2 * p_f + P_T), rel=0.02)


@pytest.mark.parametrize("form", ["u_finite", "u_bbar_finite", "u_epsv_finite"])
def test_finite_compression_satisfies_the_implicit_equations_in_logarithmic_strains(form):
    """A step without strain sideways; two equations for plastic compression and multiplier."""
    scene = block(form, P_C)
    scene.fix("right", "x")
    scene.fix("top", "y", -0.1)
    scene.solve()
    e = -np.log(0.9)

    def after(v, multiplier):
        a = 1 + 6 * MU * multiplier / M**2
        return P_C + K * (e - v), 2 * MU * e / a, P_C * np.exp(v / THETA)

    def equations(unknowns):
        v, multiplier = unknowns * [1.0, 1e-7]
        p, q, p_c = after(v, multiplier)
        return excess(p, q, p_c), v - multiplier * (2 * p + P_T - p_c)

    v, multiplier = fsolve(equations, [0.05, 1.0], xtol=1e-13) * [1.0, 1e-7]
    assert state(scene) == pytest.approx(after(v, multiplier), rel=1e-7)


@pytest.mark.parametrize("form", ["u", "u_epsv"])
def test_softening_dry_of_critical_is_a_warning(form):
    """A clay of overconsolidation ratio 6 is sheared with its volume free."""
    scene = block(form, P_C / 6)
    scene.initial("preconsolidation", P_C)
    scene.traction("right", (-P_C / 6, 0.0))
    top = scene.fix("top", "y", 0.0)
    for strain in (0.005, 0.01, 0.015):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            top.change(-strain)
            scene.solve()
        if caught:
            break
    assert [w.category for w in caught] == [tawami.SofteningWarning]
    assert "the preconsolidation pressure of particle" in str(caught[0].message)
    assert scene.particles.history("preconsolidation").min() < P_C


def test_initial_preconsolidation():
    """Values of the particles replace the parameter; wrong ones are rejected."""
    scene = block("u_epsv", P_C)
    scene.initial("preconsolidation", lambda x, y: 2 * P_C + P_C * y)
    for edge, component in (("right", "x"), ("top", "y")):
        scene.fix(edge, component, -1e-4)
    scene.solve()
    y = scene.particles.x[:, 1]
    assert scene.particles.history("preconsolidation") == pytest.approx(P_C * (2 + y))
    assert scene.particles.history("plastic_strain").max() == 0
    other = block("u_epsv", P_C)
    with pytest.raises(tawami.InputError, match="preconsolidation of particle 0 is -1: expected 0"):
        other.initial("preconsolidation", -1.0)
    with pytest.raises(tawami.InputError, match="beyond the yield surface"):
        other.initial("preconsolidation", 0.9 * P_C)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"M": 0.0}, "M = 0: expected a positive, finite slope of the critical state line"),
        ({"kappa_star": -0.1}, "kappa_star = -0.1: expected a finite slope of at least 0"),
        ({"lambda_star": 0.01}, "lambda_star = 0.01: expected a finite slope larger than kappa_st"),
        ({"preconsolidation": 0.0}, "preconsolidation = 0: expected a positive, finite pressure"),
        ({"preconsolidation": 2e6}, "expected less than 12 mu (lambda_star - kappa_star) / M^2"),
        ({"tension": 0.0}, "tension = 0: expected a share of preconsolidation, 0 < tension <= 1"),
    ],
)
def test_wrong_parameters_are_named(options, words):
    with pytest.raises(tawami.InputError) as error:
        tawami.cam_clay(tawami.linear_elastic(K=K, mu=MU), **(CLAY | options))
    assert words in str(error.value)
