"""`tawami form check`: shipped forms pass, and each kind of mistake fails on its own line."""

from __future__ import annotations

from pathlib import Path

import edited
import numpy as np
import pytest
from scenes import FINITE, FORMS
from ufl import cofac, div, dot, grad, inner

import tawami
from tawami.base import dimensions
from tawami.check import assembled, declared, fields, motions, scenes
from tawami.form import scalar, tangent, vector

ALL = {**FORMS, **FINITE}
MIXED = {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}
ALONE = {"u": vector("w")}


@pytest.mark.parametrize("name", ALL)
def test_shipped_forms_can_be_used(name):
    options = dict(ALL[name])
    report = tawami.check_form(options.pop("form"), **options)
    assert report.usable, str(report)
    assert not any(line.verdict == "not tried" for line in report.lines)
    notes = {line.subject for line in report.lines if line.verdict == "cost"}
    expected = set()
    if name.startswith("u_bbar"):
        expected |= {"patch test, loaded", "axisymmetry"}
    if name in ("u", "u_finite"):
        expected.add("locking")
    if name == "u_epsv_residual_based":
        expected.add("symmetry")
    if name == "u_epsv_alpha0":
        expected.add("stability")  # pressures oscillate
    assert notes == expected, str(report)


def test_b_bar_fails_the_loaded_patch_test_as_known():
    report = tawami.check_form("u_bbar")
    exact, miss = [line for line in report.lines if line.subject == "patch test, loaded"]
    assert (exact.verdict, miss.verdict) == ("pass", "cost")
    assert "documentation, Limits" in miss.words
    assert "quadratic splines: 2.0e-01" in miss.words


def test_a_form_with_the_gradient_of_ufl_is_for_plane_strain_only():
    def residual(w, sigma, sum_p):
        return sum_p(sigma, grad(w))

    report = tawami.check_form(tawami.Form(ALONE, residual))
    line = report.line("axisymmetry")
    assert line.verdict == "cost"
    assert "for plane strain only: form of the driver script, line" in line.words
    assert r"shape (3, 3) and an expression of shape (2, 2)" in line.words


def test_the_inf_sup_constant_of_taylor_hood():
    """0.43 is the code's own number, which `python -m cases.extremes` prints."""
    form = tawami.Form.load("u_epsv")
    assert scenes.inf_sup(form, {"alpha": 0.0}, "biquadratic") == pytest.approx(0.43, abs=0.02)
    assert scenes.inf_sup(form, {"alpha": 0.0}) < 0.02


def mixed(residual, **more):
    return tawami.Form(MIXED, residual, **more)


def paper(u, eps_v, w, q, sigma, K, mu, h, sum_p, *, alpha=0.01):
    R_q = sum_p(K, q * (div(u) - eps_v))
    return (
        sum_p(sigma, grad(w)) + R_q - sum_p(K**2 / mu, alpha * h**2 * inner(grad(q), grad(eps_v)))
    )


def wrong_sign_of_the_stress(u, eps_v, w, q, sigma, K, mu, h, sum_p):
    return paper(u, eps_v, -w, q, sigma, K, mu, h, sum_p)


def wrong_sign_of_the_volume(u, eps_v, w, q, sigma, K, mu, h, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(K, q * (div(u) + eps_v))


def wrong_sign_of_alpha(u, eps_v, w, q, sigma, K, mu, h, sum_p):
    return paper(u, eps_v, w, q, sigma, K, mu, h, sum_p, alpha=-0.01)


def without_eps_v(u, eps_v, w, q, sigma, K, mu, h, sum_p):
    R_q = sum_p(K, q * div(u)) - sum_p(K**2 / mu, 0.1 * h**2 * inner(grad(q), grad(eps_v)))
    return sum_p(sigma, grad(w)) + R_q


def without_the_deviator(u, eps_v, w, q, sigma_m, K, sum_p):
    return sum_p(sigma_m, div(w)) + sum_p(K, q * (div(u) - eps_v))


def held_by_springs(u, eps_v, w, q, sigma, K, mu, h, sum_p):
    springs = sum_p(mu, dot(u, w))
    return paper(u, eps_v, w, q, sigma, K, mu, h, sum_p) + springs


@pytest.mark.parametrize(
    ("residual", "failed"),
    [
        (wrong_sign_of_the_stress, "patch test, loaded"),
        (wrong_sign_of_the_volume, "patch test, displaced"),
        (wrong_sign_of_alpha, "stability"),
        (without_eps_v, "patch test, displaced"),
        (without_the_deviator, "patch test, displaced"),
    ],
)
def test_wrong_terms_fail_on_their_line(residual, failed):
    report = tawami.check_form(mixed(residual))
    assert not report.usable
    assert report.line(failed).verdict == "broken", str(report)
    for fine in ("declaration", "arguments", "kernels", "tangent", "dolfinx"):
        assert all(line.verdict == "pass" for line in report.lines if line.subject == fine)


def report_of(residual, **more):
    return tawami.check_form(edited.form(residual, **more))


def costs(report):
    return {line.subject for line in report.lines if line.verdict == "cost"}


def words_of(report, verdict):
    return [line.words for line in report.lines if line.verdict == verdict]


@pytest.mark.slow  # many kernels
def test_springs_and_drag_are_costs_and_not_faults():
    springs = report_of(edited.foundation, parameters={"k_s": {"default": 1e6, "unit": "Pa/m2"}})
    assert springs.usable
    assert costs(springs) == {"rigid motions"}
    assert "springs forget the earlier steps" in springs.line("rigid motions").words
    assert springs.line("patch test, loaded").verdict == "not tried"
    drag = report_of(edited.drag, parameters={"c_d": {"default": 1e6, "unit": "Pa s/m2"}})
    assert drag.usable
    assert "a drag" in drag.line("rigid motions").words
    assert drag.line("patch test, displaced").verdict == "pass"


@pytest.mark.slow  # many kernels
def test_viscosity_carries_a_part_of_a_traction():
    """eta = 5 Pa s over 1 s acts as moduli: mu + eta, and K + 2/3 eta for the volume."""
    report = report_of(edited.viscosity, **edited.VISCOUS)
    assert report.usable
    assert report.line("rigid motions").verdict == "pass"
    [share] = [w for w in words_of(report, "cost") if "carry" in w]

    def strain(K, mu):  # under the traction, with a free edge, in plane strain
        stiff, other = K + 4 / 3 * mu, K - 2 / 3 * mu
        return -0.2 * np.diag([1, -other / stiff]) / (stiff - other**2 / stiff)

    stress, exact = scenes.stress_of(strain(5 + 10 / 3, 7)), scenes.stress_of(strain(5, 2))
    error = np.abs(stress - exact).max() / np.abs(exact).max()
    assert f"carry {100 * error:.2g} %" in share
    turning = report_of(edited.viscosity_of_rotations, **edited.VISCOUS)
    assert turning.line("rigid motions").verdict == "broken"
    assert "grad(u) where eps(u) is right" in turning.line("rigid motions").words


def test_operators_of_ufl_are_named_with_their_line():
    report = report_of(edited.operators_of_ufl)
    line = report.line("operators")
    assert line.verdict == "cost"
    assert "ufl.grad(w)" in line.words
    assert "take grad as an argument" in line.words
    assert report.line("axisymmetry").verdict == "cost"
    assert report.usable


@pytest.mark.parametrize(
    ("residual", "declarations", "name"),
    [
        (edited.consolidation, edited.WATER, "p_w"),
        pytest.param(edited.conduction, edited.HEAT, "theta", marks=pytest.mark.slow),
    ],
)
def test_each_field_of_the_user_is_checked(residual, declarations, name):
    report = report_of(residual, **declarations)
    assert report.usable, str(report)
    assert costs(report) == {"dolfinx", "locking"}
    balance, definite = [one for one in report.lines if one.subject == f"field {name}"]
    assert "in balance" in balance.words
    assert "definite" in definite.words
    assert "dt = 0.001, 1, 1000 s, 4 blocks" in report.line("tangent").words


@pytest.mark.slow
def test_a_reaction_is_no_fault():
    damage = report_of(
        edited.damage,
        fields={**edited.ALONE, "d": scalar("r")},
        parameters={"G_c": {"default": 1.0, "unit": "J/m2"}},
    )
    assert damage.usable
    assert "a uniform d [-] changes by itself" in damage.line("field d").words


def test_a_small_part_of_the_stress_may_be_carried_by_a_term():
    """1e-6 of the stress, as the residual stiffness of a damaged material."""

    def residual(w, sigma, grad, sum_p):
        return (1 + 1e-6) * sum_p(sigma, grad(w))

    [(verdict, words)] = motions.compressed(edited.form(residual), {})
    assert verdict == "cost"
    assert "1.0e-06" in words


def test_a_flux_of_the_wrong_sign_is_broken():
    form = edited.form(edited.conduction_backwards, **edited.HEAT)
    [_, (verdict, words)] = assembled.field("theta")(form, {})
    assert verdict == "broken"
    assert "opposite signs" in words


def test_a_flux_that_forgets_the_old_field_is_broken():
    forgetful = edited.form(edited.conduction_of_increments, **edited.HEAT)
    [(verdict, words)] = assembled.field("theta")(forgetful, {})
    assert verdict == "broken"
    assert words == (
        "the flux acts on the increment of theta alone: expected grad(old.theta + theta)"
    )
    right = edited.form(edited.conduction, **edited.HEAT)
    assert not fields.forgets(right, {}, "theta")
    assert not fields.forgets(edited.form(edited.consolidation, **edited.WATER), {}, "p_w")


@pytest.mark.parametrize(("of", "wrong"), [("value", True), ("increment", False), ("rate", False)])
def test_a_volume_equation_with_the_value_of_an_old_field_is_broken(of, wrong):
    form = edited.form(edited.expansion(of), **edited.EXPANSION)
    broken = [words for verdict, words in assembled.field("theta")(form, {}) if verdict == "broken"]
    assert len(broken) == wrong
    if wrong:
        assert broken[0].startswith(
            "the volume equation of increments contains the value old.theta: the body expands in each "
            "step at rest"
        )


def test_units_that_contradict_name_the_line():
    [(verdict, words)] = declared.check_units(edited.form(edited.without_dt, **edited.HEAT), {})
    assert verdict == "cost"
    assert "return R_u + sum_p(c * theta * r)" in words
    assert "equation of 'theta'" in words
    silent = edited.form(edited.foundation, parameters={"k_s": {"default": 1e6}})
    [(verdict, words)] = declared.check_units(silent, {})
    assert verdict == "cost"
    assert "give 'k_s' a \"unit\"" in words
    as_asked = edited.form(edited.foundation, parameters={"k_s": {"default": 1e6, "unit": "Pa/m2"}})
    assert [verdict for verdict, _ in declared.check_units(as_asked, {})] == ["pass"]


SHIPPED = sorted(path.stem for path in (Path(tawami.__file__).parent / "forms").glob("u*.py"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_forms_declare_the_units_of_their_parameters(name):
    form = tawami.Form.load(name)
    assert [n for n, given in form.parameters.items() if "unit" not in given] == []
    for options in ({}, *({n: c} for n, many in form.options.items() for c in many[1:])):
        assert [verdict for verdict, _ in declared.check_units(form, options)] == ["pass"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("W/(m K)", "kg m s-3 K-1"), ("Pa s", "kg m-1 s-1"), ("m²", "m2"), ("1/Pa", "kg-1 m s2"),
        ("m^2/(Pa*s)", "kg-1 m3 s"), ("-", "-"), ("J/(m3 K)", "kg m-1 s-2 K-1"), ("kPa", "kPa"),
    ],
)  # fmt: skip
def test_units_are_read(text, expected):
    assert sorted(dimensions.text_of(dimensions.dimension(text)).split()) == sorted(
        expected.split()
    )


@pytest.mark.parametrize("text", ["", "(m", "m)", "?", "3 m"])
def test_text_that_is_no_unit(text):
    with pytest.raises(ValueError, match="is no unit"):
        dimensions.dimension(text)


def test_a_term_that_only_costs_is_a_cost():
    def twice_the_volume(u, eps_v, w, q, sigma, K, sum_p):
        return sum_p(sigma, grad(w)) + sum_p(K, 2 * q * (div(u) - eps_v))

    report = tawami.check_form(mixed(twice_the_volume))
    assert report.usable, str(report)
    for subject in ("symmetry", "stability", "operators"):
        assert report.line(subject).verdict == "cost"
    assert "twice the time" in report.line("symmetry").words


def test_a_wrong_tangent_fails(monkeypatch):
    """The derived tangent is right: here it loses the derivative of the law."""
    monkeypatch.setattr(
        tangent.Linearisation, "_direction", lambda self, density: 0.9 * right(self, density)
    )
    form = tawami.Form(ALONE, lambda w, sigma, sum_p: sum_p(sigma, grad(w)))
    report = tawami.check_form(form)
    assert report.line("tangent").verdict == "broken"
    assert report.line("rigid motions").verdict == "pass"
    assert report.line("patch test, displaced").verdict == "not tried"


right = tangent.Linearisation._direction


@pytest.mark.parametrize(
    ("form", "subject", "words"),
    [
        ("nowhere.py", "declaration", "cannot be read"),
        (
            tawami.Form(ALONE, lambda w, porosity: 0),
            "arguments",
            "asks for 'porosity'",
        ),
        (tawami.Form(ALONE, lambda u: 3.0), "arguments", "expected a UFL form"),
        (
            tawami.Form(ALONE, lambda w: 0, parameters={"a": {"default": -1, "minimum": 0}}),
            "parameters",
            "a = -1.0: expected",
        ),
        (
            tawami.Form(ALONE, lambda u, w, jump_nn, dG: inner(jump_nn(u), jump_nn(w)) * dG),
            "kernels",
            "expected sums over particles",
        ),
    ],
)
def test_a_form_that_cannot_be_compiled_fails_on_its_line(form, subject, words):
    report = tawami.check_form(form)
    assert report.line(subject).verdict == "broken"
    assert words in report.line(subject).words
    later = report.lines[report.lines.index(report.line(subject)) + 1 :]
    assert not any(line.verdict == "pass" for line in later)
    assert "it cannot be used: 1 broken" in str(report)


def test_parameters_and_inexact_sums_are_reported():
    with pytest.raises(tawami.InputError, match="has no parameter 'beta'"):
        tawami.check_form("u_epsv", beta=1.0)
    assert "alpha = 2: expected at most 1" in str(tawami.check_form("u_epsv", alpha=2.0))
    form = tawami.Form(
        ALONE,
        lambda u, w, sigma, mu, sum_p: sum_p(sigma, grad(w)) + sum_p(mu, div(u) ** 3 * div(w)),
    )
    line = tawami.check_form(form).line("dolfinx")
    assert line.verdict == "cost"
    assert "the second is not exact for this form" in line.words


def test_the_plastic_law_yields_in_the_check():
    """The tangent of at least half of the particles is not the elastic one."""
    form = tawami.Form.load("u_epsv_finite")
    elastic, plastic = (scenes.cloud(form, {}, law) for law in (None, scenes.soil(form, {})))
    c = (
        0.05
        * elastic.grid.h
        * np.random.default_rng(1).standard_normal((2, elastic.num_coefficients))
    )
    change = abs(elastic.tangent(c[0]) - plastic.tangent(c[0])).max()
    assert change > 0.1 * abs(elastic.tangent(c[0])).max()


def test_a_form_with_sums_over_the_border():
    """The parts of the border have names that the bodies of the check do not have."""

    def residual(u, T, w, r, sigma, grad, I, sum_p, sum_b, dot_n, old, p, k, c):  # noqa: E741
        pressure = p * dot(dot_n(cofac(I + grad(u))), w)
        R = sum_p(sigma, grad(w)) + sum_b(pressure, on=["crest", "top"])
        R += sum_b(k * dot(old.u + u, w), on="base")
        R += sum_p(dot(grad(old.T + T), grad(r)))
        return R + sum_b(c * (old.T + T) * r, on=["a", "b", "c"])

    own = {**ALONE, "T": scalar("r", unit="K")}
    numbers = {name: {"default": 1.0, "unit": unit} for name, unit in (("p", "Pa"), ("c", "1/m"))}
    foundation = {"k": "stiffness of the foundation [Pa/m]"}
    report = tawami.check_form(tawami.Form(own, residual, parameters=numbers, data=foundation))
    assert report.usable, str(report)
    found = {line.subject for line in report.lines if line.verdict != "pass"}
    loads = {"patch test, loaded", "locking"}
    assert found - loads == {"symmetry", "dolfinx", "field T"}, str(report)
    wrong = tawami.Form(own, residual, parameters=numbers, data={"k": "stiffness [Pa]"})
    ((verdict, words),) = declared.check_units(wrong, {})
    assert verdict == "cost"
    assert 'on="base"' in words
