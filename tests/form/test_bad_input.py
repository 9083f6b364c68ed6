"""Wrong forms: one sentence each, with the form, the line and the remedy."""

from __future__ import annotations

import re

import dolfinx
import pytest
import ufl
from mpi4py import MPI
from scenes import random_scene
from ufl import dot, inner

import tawami
from tawami.fem.dolfinx import lagrange
from tawami.form import scalar, vector

ALONE = {"u": vector("w")}
WATER = {**ALONE, "p_w": scalar("r", unit="Pa")}
DATA = {"kappa": "permeability [m2]"}
LINEAR = lagrange(1)


def scene_of(residual, fields=ALONE, **more):
    return random_scene(form=tawami.Form(fields=fields, residual=residual, **more))


def momentum(w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w))


def own_measure(u, w, mu, sigma, grad, sum_p):
    first = sum_p(sigma, grad(w))
    return first + inner(grad(u), grad(w)) * ufl.dx


def own_edges(u, w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w)) - dot(u, w) * ufl.ds


def constant(count):
    def residual(u, w, sigma, grad, h, sum_p):
        c = ufl.Constant(h.ufl_domain(), count=count)
        return sum_p(sigma, grad(w)) + sum_p(h * c * dot(u, w))

    return residual


def constant_of_dolfinx(u, w, sigma, grad, sum_p):
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    return sum_p(sigma, grad(w)) + sum_p(dolfinx.fem.Constant(mesh, 3.0) * dot(u, w))


def coefficient(u, w, sigma, grad, sum_p):
    k = ufl.Coefficient(ufl.FunctionSpace(u.ufl_domain(), LINEAR), count=0)
    return sum_p(sigma, grad(w)) + sum_p(k * dot(u, w))


def own_test_function(u, w, sigma, grad, sum_p):
    v = ufl.TestFunction(ufl.FunctionSpace(u.ufl_domain(), LINEAR))
    return sum_p(sigma, grad(w)) + sum_p(v * u[0])


def complex_number(u, w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p((1 + 2j) * dot(u, w))


def imaginary_part(u, w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(ufl.imag(u[0]) * w[0])


def not_a_number(u, w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(float("nan") * dot(u, w))


def numbered(u, w, sigma, grad, sum_p, dx):
    return sum_p(sigma, grad(w)) + dot(u, w) * dx(1)


def without_a_test_function(u, w, sigma, grad, sum_p):
    R = sum_p(sigma, grad(w))
    return R + sum_p(dot(u, u))


def old_displacement(u, w, sigma, old, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(dot(old.u, w))


def misspelt(w, sigm, grad, sum_p):
    return sum_p(sigm, grad(w))


def forgotten(u, w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(dot(u / dt, w))  # noqa: F821


def misspelt_inside(u, w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(dot(u, w) * sigm)  # noqa: F821


def not_imported(u, w, sigma, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(sqrt(2.0) * dot(u, w))  # noqa: F821


def sum_of_shapes(u, w, sigma, grad, sum_p):
    R = sum_p(sigma, grad(w))
    return R + sum_p(grad(u) + dot(u, w))


def product_of_shapes(u, w, sigma, grad, sum_p):
    R = sum_p(sigma, grad(w))
    return R + sum_p(u * w)


@pytest.mark.parametrize(
    ("residual", "source", "message"),
    [
        (own_measure, "inner(grad(u), grad(w)) * ufl.dx", "a measure of UFL: expected dx or dx_c"),
        (own_edges, "dot(u, w) * ufl.ds", "a measure of UFL"),
        *((constant(k), "h * c * dot(u, w)", "a Constant of UFL: expected a number") for k in (0, 77)),
        (constant_of_dolfinx, "dolfinx.fem.Con", "one of 'parameters'"),
        (coefficient, "sum_p(k * dot(u, w))", 'scene.data("kappa", ...)'),
        (own_test_function, "sum_p(v * u[0])", "expected those of 'fields'"),
        (complex_number, "(1 + 2j)", "a complex number: expected real ones"),
        (imaginary_part, "ufl.imag", "a complex number: expected real ones"),
        (not_a_number, 'float("nan")', "NaN or infinity: expected finite numbers"),
        (numbered, "dx(1)", "a measure with a number"),
        (without_a_test_function, "R + sum_p(dot(u, u))", "expected one in each term"),
        (old_displacement, "old.u", "only fields without a role have an old value"),
        (misspelt, "def misspelt(w, sigm", "did you mean 'sigma'?"),
        (forgotten, "u / dt", "the residual uses 'dt', which is not among its arguments: expected "
                              "residual(..., dt)"),
        (misspelt_inside, "* sigm)", "'sigm', which is not defined; did you mean 'sigma'?"),
        (not_imported, "sqrt(2.0)", "'sqrt', which is not defined; 'from ufl import sqrt' is missing"),
        *((one, "return R + sum_p(", "a number in each term of sum_p, as dot(a, b) of vectors or inner")
          for one in (sum_of_shapes, product_of_shapes)),
    ],
)  # fmt: skip
def test_a_message_names_form_line_and_remedy(residual, source, message, capsys):
    with pytest.raises(tawami.FormError) as caught:
        scene_of(residual)
    said = str(caught.value)
    assert re.match(r"form of the driver script, line \d+ \(", said)
    assert source in said
    assert message in said
    assert "\n" not in said
    assert capsys.readouterr().err == ""


def test_a_field_without_its_equation():
    with pytest.raises(tawami.FormError, match=r"line \d+ .*'r' of field 'p_w' does not appear .*"
                       r"every field needs its equation, as a term sum_p\(r \* ...\)"):  # fmt: skip
        scene_of(momentum, WATER)


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        (
            {"fields": {**ALONE, "a": scalar("q", role="pressure"), "b": scalar("r", role="pressure")}},
            "fields 'a', 'b' have the roles 'pressure': expected one displacement, and at most one",
        ),
        (
            {"fields": {**ALONE, "p": scalar("q", role="pressure")}, "strain": "finite"},
            "strain = 'finite' with a field of the role 'pressure': expected 'small'",
        ),
        (
            {"fields": {**ALONE, "p": scalar("q", role="pressure")}, "kinematics": "cell"},
            "kinematics 'cell' does not take the roles of its fields, which make it 'deviatoric'",
        ),
        ({"data": {"kappa": "permeability"}}, "with a unit in brackets, as 'permeability \\[m2\\]'"),
        ({"parameters": {"a": {"default": 1j}}}, "'a': 'default': 1j: expected a number"),
        ({"parameters": {"a": {"default": 1.0, "unit": 3}}}, "'unit': 3: expected text"),
    ],
)  # fmt: skip
def test_declarations_that_do_not_fit(declared, message):
    with pytest.raises(tawami.FormError, match=message):
        tawami.Form(**{"fields": ALONE, "residual": momentum, **declared})


def test_units_that_contradict_a_role():
    with pytest.raises(tawami.FormError, match="unit='m'.: expected 'Pa', or no unit"):
        scalar("q", role="pressure", unit="m")


def drained(w, sigma, kappa, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(kappa * w[0])


def test_data_that_are_not_given_or_of_another_shape():
    scene = scene_of(drained, data=DATA)
    with pytest.raises(tawami.InputError, match=r"'kappa' \(permeability \[m2\]\), which the scene "
                       r"does not have: expected scene.data\('kappa', ...\)"):  # fmt: skip
        scene.residual([0.0] * scene.num_coefficients)
    for wrong in ([1.0, 2.0], [[1.0, 2.0]] * 60, 1 + 2j, "1e-12"):
        with pytest.raises(
            tawami.InputError,
            match=r"data 'kappa' has .*expected a number, an array of 60 \(one for each particle\), a",
        ):
            scene.data("kappa", wrong)
    with pytest.raises(tawami.InputError, match="declares no such data: .* did you mean 'kappa'"):
        scene.data("kapa", 1.0)
    scene.data("kappa", 1e-12)
    scene.residual([0.0] * scene.num_coefficients)


def test_a_form_with_edge_terms_has_to_remove_them():
    """Forms took tractions on edges of the grid as - dot(t, w) * ds once."""

    def residual(w, sigma, t, grad, sum_p, ds):
        return sum_p(sigma, grad(w)) - dot(t, w) * ds

    words = (
        r"asks for 't', 'ds': tractions act without a term of the form: remove - dot\(t, w\) \* ds"
    )
    with pytest.raises(tawami.FormError, match=words):
        scene_of(residual)
    scene_of(lambda w, sigma, grad, sum_p: sum_p(sigma, grad(w)))
