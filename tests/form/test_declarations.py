"""Wrong declarations and residuals of weak forms raise an error that names the mistake."""

from __future__ import annotations

import inspect
import textwrap

import pytest
import ufl
from declared import BOTH, form_of
from mpi4py import MPI
from ufl import div, dot, grad, inner

import tawami
from tawami.form import scalar, vector
from tawami.form.compilation import compile_form
from tawami.form.form import Form
from tawami.form.symbols import Symbols

WRONG = [
    (lambda: Form.load("u_eps"), r"'u_eps' is not shipped: expected one of 'u', 'u_bbar'"),
    (lambda: Form.load("nowhere.py"), "'nowhere.py' cannot be read"),
    (lambda: Form.load(textwrap), "'textwrap' declares no 'fields', 'residual'"),
    (
        lambda: form_of(None, {"u": ("velocity", "w")}),
        r"field 'u' is \('velocity', 'w'\): expected vector\('w'\)",
    ),
    (lambda: form_of(None, {"u": "displacement"}), "field 'u' is 'displacement': expected vector"),
    (lambda: form_of(None, parameters={"a": {}}), "parameter 'a' has no \"default\""),
    (lambda: form_of(None, parameters={"h": {"default": 1}}), "'h' has two meanings"),
    (lambda: form_of(None, {"u": vector("K")}), "'K' has two meanings"),
    (lambda: Form.load(3), "form = 3: expected the name of a shipped form"),
    (lambda: form_of(None, kinematics="large"), "kinematics = 'large': expected one of"),
    (lambda: form_of(None, kinematics="mixed"), "'mixed' does not take the roles of its fields"),
    (lambda: form_of(None, BOTH, kinematics="cell"), "'cell' does not take the roles"),
    (lambda: form_of(None, {"p": scalar("q")}), "the first of its fields is not the displacement"),
    (lambda: form_of(None, {**BOTH, "v": vector("z")}), "'u', 'v' have the roles 'displacement'"),
    (
        lambda: form_of(None, {**BOTH, "p": scalar("r", role="pressure")}),
        "'eps_v', 'p' have the roles 'pressure', 'volumetric_strain'",
    ),
    (
        lambda: scalar("q", role="damage"),
        "role='damage'.*: expected 'volumetric_strain', 'pressure'",
    ),
    (
        lambda: scalar("q", role="pressure", basis="quadratic_spline"),
        "role='pressure', basis='quadratic_spline'.*: leave it out",
    ),
    (
        lambda: scalar("q", role="volumetric_strain", scale=1e-3),
        "role='volumetric_strain', scale=0.001.*: leave it out",
    ),
    (lambda: scalar("q", basis="cubic"), "basis='cubic'.*: expected one of 'bilinear'"),
    (lambda: scalar("q", role="pressure", unit="kPa"), "unit='kPa'.*: expected 'Pa', or no unit"),
    (lambda: scalar("q", scale=-1), "scale = -1: expected a finite number above 0"),
    (lambda: vector(3), "test function 3: expected a name"),
    (
        lambda: form_of(None, parameters={"a": {"default": 1, "min": 0}}),
        "'a' declares 'min': expected among 'default', 'minimum', 'maximum', 'usual'",
    ),
]


@pytest.mark.parametrize(("make", "message"), WRONG)
def test_wrong_declarations_are_rejected(make, message):
    with pytest.raises(tawami.FormError, match=message):
        make()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda w, sigma, porosity: 0, r"asks for 'porosity', which is not defined: .* 'K'"),
        (
            lambda u, w, mu, sum_p: sum_p(mu, dot(u, w)) + dot(u, w) * ufl.dx,
            "a measure of UFL: expected dx or dx_c as arguments",
        ),
        (lambda w, sigma: 3.0, "residual returned float: expected a UFL form"),
        (lambda u, sum_p, K: sum_p(K, div(u)), "test function 'w' of field 'u' does not appear"),
        (lambda u, w, sum_p, K: sum_p(K, div(u)), "test function 'w' of field 'u' does not appear"),
        (
            lambda w, sum_p, sigma: sum_p(sigma, w),
            r"shape \(2, 2\) and an expression of shape \(2,\)",
        ),
        (lambda w, sum_p: sum_p(1, 2, 3), "not 3 arguments"),
        (lambda w, sum_p: sum_p(w, div(w)), r"shape \(2,\) and an expression of shape \(\)"),
        (
            lambda w, sum_p, dx, x: sum_p(div(w)) + x[0] * w[0] * dx,
            "the position x outside a sum over particles",
        ),
        (lambda w, sum_p, dx: sum_p(div(w)) + w[1] * dx(1), r"as dx\(1\): expected dx"),
        (lambda w, sum_c, sigma_m: sum_c(sigma_m, div(w)), "needs kinematics 'cell'"),
        (lambda w, sum_p, sigma: sum_p(sigma + 2, grad(w)), "its residual raised"),
        (lambda w, sum_v, sigma: sum_v(sigma, grad(w)), r"sum_v\(sigma, ...\): expected constants"),
        (
            lambda w, sum_p, sigma: sum_p(sigma * w[0], grad(w)),
            "Each term must be linear in one test function",
        ),
        (
            lambda w, sum_p, K: sum_p(K * div(w), div(w)),
            "Each term must be linear in one test function",
        ),
        (
            lambda w, cell_mean, sigma, dx: cell_mean(sigma) * div(w) * dx,
            "cell_mean takes data of the particles",
        ),
        (lambda u, w, sum_p: sum_p(div(w) ** 2 * div(u)), "linear in one test function"),
        (
            lambda u, w, mu, h, facet_mean, jump_nn, dG: (
                facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG
            ),
            "expected sums over particles or integrals over cells",
        ),
    ],
)
def test_wrong_residuals_are_rejected(random_scene, function, message):
    with pytest.raises(tawami.FormError, match=message):
        random_scene(form=form_of(function))


def test_b_bar_takes_deviators_at_particles_and_means_at_centres(random_scene):
    for function, message in [
        (lambda w, sigma, sum_p: sum_p(sigma, grad(w)), r"sum_p\(sigma"),
        (lambda w, s, sum_c: sum_c(s, grad(w)), r"sum_c\(s,"),
    ]:
        with pytest.raises(tawami.FormError, match=message + r".* 'cell': expected sum_p\(s"):
            random_scene(form=form_of(function, kinematics="cell"))


def test_a_missing_test_function_is_named(random_scene):
    form = form_of(lambda w, q, sigma, sum_p: sum_p(sigma, grad(w)), BOTH)
    with pytest.raises(tawami.FormError, match="'q' of field 'eps_v' does not appear"):
        random_scene(form=form)


def test_a_file_with_a_mistake_is_named(tmp_path):
    path = tmp_path / "broken.py"
    path.write_text("fields = {")
    with pytest.raises(tawami.FormError, match=r"'broken.py' cannot be read: SyntaxError"):
        Form.load(path)


def test_static_options_are_the_defaults_of_scenes_without_a_density():
    form = tawami.Form.load("u_epsv_finite")
    assert form.settings({})[1] == {"ghost_penalty": "off"}
    assert form.settings({}, static=True)[1] == {"ghost_penalty": "on"}
    assert form.settings({"ghost_penalty": "off"}, static=True)[1] == {"ghost_penalty": "off"}
    for static_options in ({"ghost": "on"}, {"ghost_penalty": "perhaps"}):
        with pytest.raises(tawami.FormError, match="expected one of the option's values"):
            tawami.Form(
                {"u": vector("w")},
                "displacement",
                lambda w, sigma, sum_p: sum_p(sigma, w),
                options={"ghost_penalty": ("off", "on")},
                static_options=static_options,
            )


def test_a_parameter_in_the_place_of_a_quantity_is_named():
    form = form_of(
        lambda u, w, stiffness, sum_v: sum_v(stiffness, dot(u, w)),
        parameters={"stiffness": {"default": 1.0}},
    )
    with pytest.raises(tawami.FormError, match=r"expected parameter \* sum_v\(D, f\)"):
        Symbols(form, {}).residual()


def _two_lines(u, w, sigma, sum_p):
    R = sum_p(inner(sigma, grad(w)))
    return R + sum_p(dot(w, w))


def test_a_message_names_the_line_of_the_term():
    form = form_of(_two_lines)
    line = inspect.getsourcelines(_two_lines)[1] + 2
    message = rf"line {line} \(return R \+ sum_p\(dot\(w, w\)\)\): .*linear in one test function"
    with pytest.raises(tawami.FormError, match=message):
        compile_form(MPI.COMM_SELF, form, {})


def test_a_penalty_may_add_inner_products_to_plain_ones():
    """UFL marks the test function of `inner` as conjugated, which means nothing for real numbers."""

    def residual(u, w, sigma, mu, sum_p, facet_mean, jump_nn, dG):
        bend, tested = jump_nn(u), jump_nn(w)
        return (
            sum_p(sigma, grad(w)) + facet_mean(mu) * (inner(bend, tested) + dot(bend, tested)) * dG
        )

    assert compile_form(MPI.COMM_SELF, form_of(residual), {}).penalises
