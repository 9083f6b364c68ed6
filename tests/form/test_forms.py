"""The contract of a weak form: its places, its error messages, one compilation."""

from __future__ import annotations

import importlib
import sys
import textwrap
import warnings
from itertools import pairwise

import numpy as np
import pytest
from declared import BOTH, form_of
from scenes import COUPLED, FINITE, FORMS, grid_of
from ufl import div, dot, grad, inner, sqrt, sym

import tawami
from tawami.base.errors import InexactSumWarning
from tawami.form import scalar, vector
from tawami.form.files import shipped
from tawami.form.form import Form
from tawami.form.symbols import Symbols

# A form in a driver script: this module is one. It is the shipped u_epsv, written differently.
fields = {"v": vector("w"), "theta": scalar("r", role="volumetric_strain")}
parameters = {"beta": {"default": 0.2, "minimum": 0.0}}


def residual(v, theta, w, r, s, sigma_m, K, mu, h, sum_p, beta):
    """Eqs. (1) and (2): stress split into deviator and mean, stabilisation of two constants."""
    momentum = sum_p(s, grad(w)) + sum_p(sigma_m, div(w))
    volume = sum_p(K, r * div(v)) - sum_p(K, r * theta)
    return momentum + volume - beta * h**2 * sum_p(K * K / mu, inner(grad(r), grad(theta)))


def test_a_form_in_a_driver_script_works_like_a_shipped_one(random_scene):
    mine = random_scene(form=sys.modules[__name__], beta=0.3)
    shipped_one = random_scene(form="u_epsv", alpha=0.3, ghost_penalty="off")
    c = np.random.default_rng(0).standard_normal(mine.num_coefficients)
    np.testing.assert_allclose(mine.residual(c), shipped_one.residual(c), rtol=1e-11, atol=1e-11)
    difference = abs(mine.tangent(c) - shipped_one.tangent(c)).max()
    assert difference < 1e-13 * abs(mine.tangent(c)).max()


def test_a_form_in_a_file_works_like_a_shipped_one(random_scene, tmp_path):
    path = tmp_path / "my_form.py"
    path.write_text(
        textwrap.dedent(
            """
            from ufl import dot, grad
            from tawami.form import vector
            fields = {"u": vector("w")}
            def residual(w, sigma, sum_p):
                return sum_p(sigma, grad(w))
            """
        )
    )
    scenes = [random_scene(form=f) for f in (path, "u")]
    c = np.random.default_rng(0).standard_normal(scenes[0].num_coefficients)
    np.testing.assert_array_equal(*[s.residual(c) for s in scenes])


def test_every_shipped_form_is_in_the_tests():
    tested = [*FORMS.values(), *FINITE.values(), *COUPLED.values()]
    assert {options["form"] for options in tested} == set(shipped())


def test_a_quantity_of_the_law_may_be_scaled_by_constants(random_scene):
    def scaled(w, sum_p, sigma, mu):
        return sum_p(2 * sigma * mu, grad(w))

    def plain(w, sum_p, sigma):
        return sum_p(sigma, grad(w))

    scenes = [random_scene(form=form_of(function)) for function in (scaled, plain)]
    mu = scenes[0].configuration.domain.constants["mu"]
    scenes[1].particles.volume[:] *= 2 * mu
    c = np.random.default_rng(0).standard_normal(scenes[0].num_coefficients)
    for function in (lambda s: s.residual(c), lambda s: s.tangent(c).toarray()):
        a, b = map(function, scenes)
        assert np.abs(a - b).max() < 1e-13 * np.abs(b).max()


def test_a_form_nonlinear_in_the_fields_has_the_right_tangent(random_scene):
    """The derivative is that of UFL: a penalty on (div u)^3 added to the displacement form."""

    def cubic(u, w, sigma, K, sum_p, cell_mean, dx, dx_c):
        extra = cell_mean(K) * div(u) ** 2 * dot(u, w)
        return (
            sum_p(sigma, grad(w))
            + sum_p(K, div(u) ** 3 * div(w))
            + sum_p(inner(sym(grad(u)), sym(grad(w))) * dot(u, u))
            + extra * dx
            + extra * dx_c
        )

    form = Form({"u": vector("w")}, cubic)
    with pytest.warns(InexactSumWarning, match=r"degree \d .* at most degree 4"):
        random_scene(form=form, assembly="dolfinx")
    scene = random_scene(form=form)
    random = np.random.default_rng(3)
    c, d = random.standard_normal((2, scene.num_coefficients))
    step = 1e-5
    difference = (scene.residual(c + step * d) - scene.residual(c - step * d)) / (2 * step)
    predicted = scene.tangent(c) @ d
    assert np.abs(difference - predicted).max() < 1e-8 * np.abs(predicted).max()


def test_terms_under_two_rules_are_evaluated_under_their_own(random_scene):
    """FFCx confuses the values of a field that one kernel evaluates under two rules."""

    def term(u, w, K, cell_mean):
        return cell_mean(K) * div(u) ** 2 * dot(u, w)

    def both(u, w, K, cell_mean, dx, dx_c):
        return term(u, w, K, cell_mean) * dx + term(u, w, K, cell_mean) * dx_c

    def full(u, w, K, cell_mean, dx):
        return term(u, w, K, cell_mean) * dx

    def centre(u, w, K, cell_mean, dx_c):
        return term(u, w, K, cell_mean) * dx_c

    scenes = [random_scene(form=form_of(function)) for function in (both, full, centre)]
    c = np.random.default_rng(0).standard_normal(scenes[0].num_coefficients)
    residuals = [scene.residual(c) for scene in scenes]
    scale = np.abs(residuals[1]).max()
    np.testing.assert_allclose(residuals[0], residuals[1] + residuals[2], atol=1e-13 * scale)
    tangents = [scene.tangent(c) for scene in scenes]
    difference = abs(tangents[0] - tangents[1] - tangents[2]).max()
    assert difference < 1e-13 * abs(tangents[0]).max()


def test_newton_converges_quadratically_on_a_nonlinear_form():
    """A spring on div u that stiffens needs several iterations; the last ones are quadratic."""

    def stiff(u, w, sigma, mu, sum_p):
        return sum_p(sigma, grad(w)) + sum_p(3e3 * mu, div(u) ** 3 * div(w))

    form = Form({"u": vector("w")}, stiff)
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
    material = tawami.linear_elastic(E=1e3, nu=0.2)
    scene = tawami.Scene(grid, body, material, form=form, tolerance=1e-12)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (120.0, 20.0))
    solution = scene.solve()
    measures = [m for m, _ in solution.history]
    assert 3 < solution.iterations < 12
    assert measures[-1] < 1e-12
    quadratic = [b for a, b in pairwise(measures) if a < 1e-2 and b > 1e-11]
    assert quadratic
    assert measures[-2] < 1e-5


@pytest.mark.parametrize("assembly", ["points", "dolfinx"])
def test_sums_at_vertices_are_row_sum_lumped(random_scene, assembly):
    """sum_p V_p K_p M_v(x_p) on the diagonal, with an independent M_v."""

    def lumped(w, q, eps_v, sigma, K, sum_p, sum_v):
        return sum_p(sigma, grad(w)) + sum_v(K, q * eps_v)

    form = form_of(lumped, BOTH)
    scene = random_scene(form=form, assembly=assembly)
    c = np.zeros(scene.num_coefficients)
    n = scene.configuration.domain.layout.num_displacement
    block = scene.tangent(c).toarray()[n:, n:]
    grid = scene.grid
    s = (np.array(scene.particles.x) - grid.origin) / grid.h
    weight = scene.particles.volume * scene.configuration.domain.constants["K"]
    hats = [np.maximum(0, 1 - np.abs(s[:, [k]] - np.arange(grid.cells[k] + 1))) for k in range(2)]
    expected = np.einsum("p,pj,pi->ji", weight, hats[1], hats[0]).ravel()
    assert np.abs(block - np.diag(expected)).max() < 1e-12 * expected.max()


def test_an_edited_and_reloaded_module_is_another_form(random_scene, tmp_path, monkeypatch):
    path = tmp_path / "edited_form.py"
    text = """
from ufl import grad
from tawami.form import vector
fields = {"u": vector("w")}
def residual(w, sigma, sum_p):
    return FACTOR * sum_p(sigma, grad(w))
"""
    monkeypatch.syspath_prepend(tmp_path)
    path.write_text(text.replace("FACTOR", "1"))
    module = importlib.import_module("edited_form")
    c = np.ones(random_scene(form=module).num_coefficients)
    c[::5] = 0
    once = random_scene(form=module).residual(c)
    path.write_text(text.replace("FACTOR", "20"))
    importlib.invalidate_caches()
    twenty = random_scene(form=importlib.reload(module)).residual(c)
    np.testing.assert_allclose(twenty, 20 * once, atol=1e-12 * np.abs(twenty).max())


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"alpha": -0.1}, "alpha = -0.1: expected a finite number of at least 0"),
        ({"alpha": float("nan")}, "alpha = nan"),
        ({"alpha": "much"}, "alpha = 'much': expected a number"),
        ({"stabilisation": "pspg"}, "stabilisation = 'pspg': expected one of 'laplacian'"),
        (
            {"gamma": 1},
            "form 'u_epsv' has no parameter 'gamma': it has 'alpha', 'k', 'k_v', 'stabilisation'",
        ),
    ],
)
def test_wrong_parameters_are_rejected(random_scene, given, message):
    with pytest.raises(tawami.InputError, match=message):
        random_scene(form="u_epsv", **given)


def test_parameters_change_without_compiling_again(random_scene):
    a, b = (random_scene(form="u_epsv", alpha=alpha) for alpha in (0.1, 0.7))
    assert a.configuration.model.compiled is b.configuration.model.compiled
    c = np.ones(a.num_coefficients)
    c[::3] = 0
    assert np.abs(a.residual(c) - b.residual(c)).max() > 1e-3


def test_constants_of_particles_have_arithmetic():
    def residual(w, K, mu, sum_v):
        return sum_v((2 * K + sqrt(mu) ** 2 / K - 1) / (3 - mu) + 1 / K, w[0])

    symbols = Symbols(Form({"u": vector("w")}, residual), {})
    symbols.residual()
    (quantity,) = (d.quantity for d in symbols.data.placeholders if d.rule == "vertex")
    K, mu = np.array([1.0, 2.0, 1.0]), np.array([4.0, 0.5, 4.0])
    expected = (2 * K + mu / K - 1) / (3 - mu) + 1 / K
    np.testing.assert_allclose(quantity.evaluate({"K": K, "mu": mu}), expected)
    assert "sqrt(mu)" in quantity.text


def test_alpha_of_the_residual_based_stabilisation_is_limited():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1.0, nu=0.3)
    options = {"form": "u_epsv", "stabilisation": "residual_based"}
    message = "alpha = 0.3 with 'residual_based': expected at most 0.14, .* use a smaller alpha"
    with pytest.raises(tawami.InputError, match=message):
        tawami.Scene(grid, body, law, alpha=0.3, **options)
    with pytest.raises(tawami.InputError, match="alpha = 'much': expected a number"):
        tawami.Scene(grid, body, law, alpha="much", **options)
    tawami.Scene(grid, body, law, alpha=0.14, **options)
    tawami.Scene(grid, body, law, alpha=0.3)


@pytest.mark.parametrize("form", ["u_epsv", "u_p", "u_epsv_finite"])
def test_an_unusual_alpha_gets_a_warning(form):
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1.0, nu=0.3)
    tawami.Scene(grid, body, law, form=form, alpha=1.0)
    with pytest.warns(tawami.ParameterWarning, match="alpha = 2: expected at most 1, beyond which"):
        tawami.Scene(grid, body, law, form=form, alpha=2.0)


@pytest.mark.parametrize(("form", "nu", "locks"), [
    ("u", 0.4999, True), ("u_finite", 0.4999, True), ("u", 0.48, False), ("u_bbar", 0.4999, False)
])  # fmt: skip
def test_a_form_that_locks_warns(form, nu, locks):
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1.0, nu=nu)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tawami.Scene(grid, body, law, form=form)
    said = [str(w.message) for w in caught if w.category is tawami.LockingWarning]
    assert len(said) == locks
    assert all("K/mu = 5e+03 at particle 0: it locks" in message for message in said)


@pytest.mark.parametrize("form", ["u", "u_bbar"])
@pytest.mark.parametrize("one_minus_2nu", [1e-11, 1e-14])
def test_the_error_of_a_stiffness_beyond_all_digits_names_k_over_mu(form, one_minus_2nu):
    grid = grid_of()
    law = tawami.linear_elastic(E=1.0, one_minus_2nu=one_minus_2nu)
    scene = tawami.Scene(
        grid, tawami.box(grid, grid.origin, grid.upper, per_axis=2), law, form=form
    )
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1e-4))
    with pytest.raises(tawami.TawamiError, match=r"K/mu is 1.0e\+1[14]: .* use form 'u_epsv'"):
        scene.solve()
