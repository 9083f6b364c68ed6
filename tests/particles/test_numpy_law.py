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
    ("respond", "message"),
    [
        (lambda e, s: s, r"did not return a pair: expected \(stress, tangent\)"),
        (lambda e, s: (s[:, :3], e), r"a stress of shape \(108, 3\): expected \(108, 4\)"),
        (lambda e, s: (s, e), r"a tangent of shape \(108, 4\): expected \(108, 4, 4\)"),
        (
            lambda e, s: (s * np.nan, e),
            r"a stress that is not finite at 108 particles, the first is 0",
        ),
    ],
)
def test_wrong_results_of_a_law_are_rejected(respond, message):
    scene = scene_with(tawami.NumpyLaw(respond, K, MU))
    with pytest.raises(tawami.InputError, match=message):
        scene.solve()
    assert not scene.particles.stress.any()


@pytest.mark.parametrize(("bulk", "mu"), [(0.0, 1.0), (1.0, -1.0), (np.inf, 1.0), ("a", 1.0)])
def test_wrong_moduli_are_rejected(bulk, mu):
    with pytest.raises(tawami.InputError, match="NumpyLaw: "):
        tawami.NumpyLaw(elastic, bulk, mu)
