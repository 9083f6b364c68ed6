"""Laws written in NumPy, compared with those in Rust."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import grid_of, linear_field

import tawami

K, MU = 5e3, 1e3
UNIT = np.array([1.0, 1.0, 1.0, 0.0])
#: d stress / d strain with gamma_xy as the fourth strain
ELASTIC = K * np.outer(UNIT, UNIT) + MU * (
    np.diag([2.0, 2.0, 2.0, 1.0]) - 2 / 3 * np.outer(UNIT, UNIT)
)


def elastic(strain, stress):
    return stress + strain @ ELASTIC, np.broadcast_to(ELASTIC, (len(strain), 4, 4))


def stiffening(strain, stress):
    """sigma = (1 + 50 eps:eps) C eps: nonlinear, without history."""
    linear = strain @ ELASTIC
    factor = 1 + 50 * np.sum(strain**2, axis=1)
    tangent = factor[:, None, None] * ELASTIC + 100 * linear[:, :, None] * strain[:, None, :]
    return stress + factor[:, None] * linear, tangent


SIGMA_Y, HARDENING = 30.0, 200.0


def von_mises(strain, stress, history, hardening=HARDENING):
    """Radial return with linear hardening (Simo and Hughes 1998, box 3.2), in their symbols."""
    one, I_dev = UNIT, np.diag([1, 1, 1, 0.5]) - np.outer(UNIT, UNIT) / 3
    alpha = history["plastic_strain"]
    trial = stress + strain @ ELASTIC
    p = trial[:, :3].mean(axis=1)[:, None]
    xi = trial - p * one
    norm = np.sqrt((xi**2 * [1, 1, 1, 2]).sum(axis=1))
    f = norm - np.sqrt(2 / 3) * (SIGMA_Y + hardening * alpha)
    gamma = np.maximum(f, 0.0) / (2 * MU) / (1 + hardening / (3 * MU))
    n = xi / np.maximum(norm, 1e-300)[:, None]
    theta = 1 - 2 * MU * gamma / np.maximum(norm, 1e-300)
    theta_bar = np.where(f > 0, 1 / (1 + hardening / (3 * MU)) - (1 - theta), 0.0)
    C = K * np.outer(one, one) + 2 * MU * (
        theta[:, None, None] * I_dev - theta_bar[:, None, None] * n[:, :, None] * n[:, None, :]
    )
    stress = p * one + xi - 2 * MU * gamma[:, None] * n
    return stress, C, {"plastic_strain": alpha + np.sqrt(2 / 3) * gamma}


def without_tangent(strain, stress, history):
    stress, _, history = von_mises(strain, stress, history)
    return stress, history


RUST = tawami.von_mises(
    tawami.linear_elastic(K=K, mu=MU), yield_stress=SIGMA_Y, hardening=HARDENING
)
NUMPY = tawami.NumpyLaw(von_mises, K, MU, history=("plastic_strain",))
DIFFERENCES = tawami.NumpyLaw(without_tangent, K, MU, history=("plastic_strain",))


def block(material, form="u_epsv", **options):
    """A block between two walls on a rough floor, to be loaded on its top."""
    grid = grid_of((4, 6), h=0.25)
    body = tawami.box(grid, (-1.0, 0.5), (0.0, 1.5), per_axis=2)
    scene = tawami.Scene(grid, body, material, form=form, tolerance=1e-10, **options)
    scene.fix("left", "x")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def pressed(scene, force=40.0, steps=2):
    """Solutions while a part of the top is loaded; the block yields there."""
    load = scene.load(lambda x, y: (y > 1.25) & (x < -0.5), (0.0, 0.0))
    solutions = []
    for k in range(1, steps + 1):
        load.change((0.0, -force * k / steps))
        solutions.append(scene.solve())
    return solutions


def assert_same(mine, other, share):
    """Whether two solutions are equal, as a share of the largest number."""
    names = ("stress", "displacement", "strain")
    pairs = [(getattr(s.scene.particles, name) for s in (mine, other)) for name in names]
    pairs.append(s.scene.particles.history("plastic_strain") for s in (mine, other))
    for one, two in pairs:
        np.testing.assert_allclose(one, two, rtol=0, atol=share * np.abs(two).max())


def scene_with(material, form="u_epsv", **options):
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
    scene = tawami.Scene(grid, body, material, form=form, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (3.0, -5.0))
    return scene


@pytest.mark.parametrize("form", ["u", "u_bbar", "u_epsv", "u_p"])
def test_linear_elasticity_in_numpy_agrees_with_rust(form):
    scenes = [
        scene_with(law, form)
        for law in (tawami.NumpyLaw(elastic, K, MU), tawami.linear_elastic(K=K, mu=MU))
    ]
    solutions = [scene.solve() for scene in scenes]
    for mine, other in (
        (solutions[0].u, solutions[1].u),
        (solutions[0].stress, solutions[1].stress),
    ):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-9 * np.abs(other).max())
    again = [scene.solve() for scene in scenes]
    assert [s.iterations for s in again] == [0, 0]


@pytest.mark.parametrize("form", ["u", "u_bbar", "u_epsv"])
def test_newton_uses_the_tangent_of_a_nonlinear_law(form):
    scene = scene_with(tawami.NumpyLaw(stiffening, K, MU), form)
    random = np.random.default_rng(0)
    c, d = 1e-2 * random.standard_normal((2, scene.num_coefficients))
    step = 1e-4
    difference = (scene.residual(c + step * d) - scene.residual(c - step * d)) / (2 * step)
    predicted = scene.tangent(c) @ d
    assert np.abs(difference - predicted).max() < 1e-6 * np.abs(predicted).max()


def test_newton_converges_quadratically():
    scene = scene_with(tawami.NumpyLaw(stiffening, K, MU), tolerance=1e-11)
    scene.traction("right", (300.0, 0.0))
    solution = scene.solve()
    assert 3 <= solution.iterations <= 8
    measures = [max(m) for m in solution.history]
    assert measures[-2] < 1e-4


def test_uniaxial_strain_gives_the_stress_of_the_law():
    """The border is displaced linearly: every particle has the prescribed strain."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    scene = tawami.Scene(grid, body, tawami.NumpyLaw(stiffening, K, MU), form="u", tolerance=1e-12)
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "x", lambda x, y: 0.02 * x)
        scene.fix(edge, "y")
    scene.solve()
    expected, _ = stiffening(np.array([[0.02, 0, 0, 0]]), np.zeros((1, 4)))
    np.testing.assert_allclose(
        scene.particles.stress, np.tile(expected, (len(scene.particles), 1)), atol=1e-9
    )
    u = linear_field(grid, "quadratic_spline", np.zeros(2), [[0.02, 0], [0, 0]])
    assert scene.residual(u).shape == u.shape


@pytest.mark.parametrize(
    ("respond", "history", "message"),
    [
        (lambda e, s: (s, e, s), (), "returned 3 values for 108 particles from 0 on: expected .stress"),
        (lambda e, s: None, (), "stress that respond returned: expected an array of real numbers"),
        (lambda e, s: (s[:, :3], e), (), r"stress of shape \(108, 3\) for 108 .*expected \(108, 4\)"),
        (lambda e, s: (s, e), (), r"tangent of shape \(108, 4\) for .*: expected \(108, 4, 4\)"),
        (
            lambda e, s: (np.where(np.arange(len(s)) % 50 == 7, np.nan, s.T).T, e), (),
            "stress that is not finite at 3 particles, the first is 7: nan at the strain",
        ),
        (lambda e, s, h: (s, e), ("kappa",), "an array of shape .* as history of 108 particles"),
        (lambda e, s, h: (s, e, {}), ("kappa",), "a dictionary with nothing as .*with 'kappa' behind"),
        (
            lambda e, s, h: (s, {"kappa": h["kappa"][:3]}), ("kappa",),
            r"kappa of shape \(3,\) for 108 particles from 0 on: expected \(108,\)",
        ),
        (lambda e, s, h: (s, {"kappa": h["kappa"] / 0}), ("kappa",), "kappa that is not finite at 108"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_wrong_results_of_a_law_are_rejected(respond, history, message):
    scene = scene_with(tawami.NumpyLaw(respond, K, MU, history))
    with pytest.raises(tawami.InputError, match=rf"NumpyLaw\(lambda\): .*{message}"):
        scene.solve()
    assert not scene.particles.stress.any()


@pytest.mark.parametrize(("bulk", "mu"), [(0.0, 1.0), (1.0, -1.0), (np.inf, 1.0), ("a", 1.0)])
def test_wrong_moduli_are_rejected(bulk, mu):
    with pytest.raises(tawami.InputError, match=r"NumpyLaw\(elastic\): "):
        tawami.NumpyLaw(elastic, bulk, mu)


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ("kappa", "history = 'kappa': expected at most 8 different names"),
        (("kappa", "kappa"), "expected at most 8 different names"),
        (tuple("abcdefghi"), "expected at most 8 different names"),
        (("plastic strain",), "history variable 'plastic strain': expected a name of letters"),
        ((3,), "history variable 3: expected a name of letters"),
        (("stress",), "that particles do not have already"),
    ],
)
def test_wrong_names_of_history_variables_are_rejected(history, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.NumpyLaw(elastic, K, MU, history)
    tawami.NumpyLaw(elastic, K, MU, history=("plastic_strain",))  # the advice


@pytest.mark.parametrize(
    "form", ["u", "u_epsv", "u_p", "u_finite", "u_bbar_finite", "u_epsv_finite"]
)
@pytest.mark.parametrize("law", [NUMPY, DIFFERENCES], ids=["tangent", "differences"])
@pytest.mark.filterwarnings("ignore::tawami.TangentWarning")
def test_von_mises_in_numpy_is_that_in_rust(form, law):
    (*_, mine), (*_, other) = (pressed(block(one, form)) for one in (law, RUST))
    plastic = other.scene.particles.history("plastic_strain")
    assert plastic.max() > 0.01
    assert plastic.min() == 0
    assert_same(mine, other, 1e-9)
