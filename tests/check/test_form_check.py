"""`tawami form check`: shipped forms pass, and each kind of mistake fails on its own line."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import FINITE, FORMS
from ufl import div, dot, grad, inner

import tawami
from tawami.check import scenes
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
    notes = {line.subject for line in report.lines if line.verdict == "note"}
    expected = set()
    if name.startswith(("u_bbar", "u_finite")) or name == "u":
        expected.add("stability")  # no field for the volume
    if name.startswith("u_bbar"):
        expected.add("patch test, loaded")
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
    assert (exact.verdict, miss.verdict) == ("ok", "note")
    assert "documentation, Limits" in miss.words
    assert "quadratic splines: 2.0e-01" in miss.words


def test_the_inf_sup_constant_of_taylor_hood():
    """0.43 is the code's own number, which `python -m cases.extremes` prints."""
    form = tawami.Form.load("u_epsv")
    assert scenes.inf_sup(form, {"alpha": 0.0, "basis": "biquadratic"}) == pytest.approx(
        0.43, abs=0.02
    )
    assert scenes.inf_sup(form, {"alpha": 0.0}) < 0.02


def mixed(residual, **more):
    return tawami.Form(MIXED, residual, **more)


def paper(u, eps_v, w, q, sigma, K, mu, h, sum_p, *, alpha=0.01):
    R_q = sum_p(K, q * (div(u) - eps_v))
    return (
        sum_p(sigma, grad(w)) + R_q - sum_p(K**2 / mu, alpha * h**2 * inner(grad(q), grad(eps_v)))
    )


def wrong_sign_of_the_stress(u, eps_v, w, q, sigma, K, mu, t, h, sum_p, ds):
    return paper(u, eps_v, -w, q, sigma, K, mu, h, sum_p) - dot(t, w) * ds


def wrong_sign_of_the_volume(u, eps_v, w, q, sigma, K, mu, t, h, sum_p, ds):
    return sum_p(sigma, grad(w)) + sum_p(K, q * (div(u) + eps_v)) - dot(t, w) * ds


def wrong_sign_of_alpha(u, eps_v, w, q, sigma, K, mu, t, h, sum_p, ds):
    return paper(u, eps_v, w, q, sigma, K, mu, h, sum_p, alpha=-0.01) - dot(t, w) * ds


def without_eps_v(u, eps_v, w, q, sigma, K, mu, t, h, sum_p, ds):
    R_q = sum_p(K, q * div(u)) - sum_p(K**2 / mu, 0.1 * h**2 * inner(grad(q), grad(eps_v)))
    return sum_p(sigma, grad(w)) + R_q - dot(t, w) * ds


def without_the_deviator(u, eps_v, w, q, sigma_m, K, t, sum_p, ds):
    return sum_p(sigma_m, div(w)) + sum_p(K, q * (div(u) - eps_v)) - dot(t, w) * ds


def held_by_springs(u, eps_v, w, q, sigma, K, mu, t, h, sum_p, ds):
    springs = sum_p(mu, dot(u, w))
    return paper(u, eps_v, w, q, sigma, K, mu, h, sum_p) + springs - dot(t, w) * ds


@pytest.mark.parametrize(
    ("residual", "failed"),
    [
        (wrong_sign_of_the_stress, "patch test, loaded"),
        (wrong_sign_of_the_volume, "patch test, displaced"),
        (wrong_sign_of_alpha, "stability"),
        (without_eps_v, "patch test, displaced"),
        (without_the_deviator, "patch test, displaced"),
        (held_by_springs, "rigid motions"),
    ],
)
def test_wrong_terms_fail_on_their_line(residual, failed):
    report = tawami.check_form(mixed(residual))
    assert not report.usable
    assert report.line(failed).verdict == "FAILED", str(report)
    for fine in ("declaration", "arguments", "kernels", "tangent", "dolfinx"):
        assert all(line.verdict == "ok" for line in report.lines if line.subject == fine)


def test_a_term_that_only_costs_gives_a_note():
    def twice_the_volume(u, eps_v, w, q, sigma, K, sum_p):
        return sum_p(sigma, grad(w)) + sum_p(K, 2 * q * (div(u) - eps_v))

    report = tawami.check_form(mixed(twice_the_volume))
    assert report.usable, str(report)
    for subject in ("symmetry", "patch test, loaded", "stability"):
        assert report.line(subject).verdict == "note"
    assert "twice the time" in report.line("symmetry").words
    assert "traction(...) will be rejected" in report.line("patch test, loaded").words


def test_a_wrong_tangent_fails(monkeypatch):
    """The derived tangent is right: here it loses the derivative of the law."""
    monkeypatch.setattr(
        tangent.Linearisation, "_direction", lambda self, density: 0.9 * right(self, density)
    )
    form = tawami.Form(ALONE, lambda w, sigma, sum_p: sum_p(sigma, grad(w)))
    report = tawami.check_form(form)
    assert report.line("tangent").verdict == "FAILED"
    assert report.line("rigid motions").verdict == "ok"
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
            tawami.Form(ALONE, lambda w, t, ds, dx: dot(t, w) * ds),
            "kernels",
            "expected integrals",
        ),
    ],
)
def test_a_form_that_cannot_be_compiled_fails_on_its_line(form, subject, words):
    report = tawami.check_form(form)
    assert report.line(subject).verdict == "FAILED"
    assert words in report.line(subject).words
    later = report.lines[report.lines.index(report.line(subject)) + 1 :]
    assert not any(line.verdict == "ok" for line in later)
    assert "it cannot be used: 1 FAILED" in str(report)


def test_parameters_and_inexact_sums_are_reported():
    with pytest.raises(tawami.InputError, match="has no parameter 'beta'"):
        tawami.check_form("u_epsv", beta=1.0)
    assert "alpha = 2: expected at most 1" in str(tawami.check_form("u_epsv", alpha=2.0))
    form = tawami.Form(
        ALONE,
        lambda u, w, sigma, mu, sum_p: sum_p(sigma, grad(w)) + sum_p(mu, div(u) ** 3 * div(w)),
    )
    line = tawami.check_form(form).line("dolfinx")
    assert line.verdict == "note"
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
