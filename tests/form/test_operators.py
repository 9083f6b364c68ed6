"""The operators of axisymmetry are those of space: differences in Cartesian coordinates."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from ufl.algorithms import expand_derivatives

import tawami
from tawami.base.space import AXISYMMETRIC, PLANE
from tawami.fem import dolfinx
from tawami.form.operators import Operators

DOMAIN = dolfinx.domain()
X = ufl.SpatialCoordinate(DOMAIN)
AXI, FLAT = Operators(AXISYMMETRIC, DOMAIN), Operators(PLANE, DOMAIN)
#: Radius and height of the point; it lies in the plane y = 0 of space, and the axis is z.
POINT = (0.7, 0.4)


def value(expression, point=POINT):
    """An expression of x at a point."""
    expanded = ufl.algorithms.apply_algebra_lowering.apply_algebra_lowering(expression)
    expanded = expand_derivatives(expanded)
    shape = expression.ufl_shape
    entries = [expanded[i](point) if i else expanded(point) for i in np.ndindex(shape)]
    return np.array(entries, dtype=float).reshape(shape)


def frame(x):
    """Radius and height of a point of space, and the directions r, z and around as columns."""
    r = np.hypot(x[0], x[1])
    c, s = x[0] / r, x[1] / r
    return (r, x[2]), np.array([[c, 0, -s], [s, 0, c], [0, 1, 0]])


def slopes(field):
    """Derivatives of a field of space at the point along x, y and z, the last index."""
    at, step = np.array([POINT[0], 0.0, POINT[1]]), 1e-4
    each = [(field(at + step * e) - field(at - step * e)) / (2 * step) for e in np.eye(3)]
    return np.stack(each, axis=-1)


def in_space(expression):
    """The field of space with these components along r, z and around."""

    def field(x):
        place, q = frame(x)
        components = value(expression, place)
        return [lambda: components, lambda: q @ components, lambda: q @ components @ q.T][
            components.ndim
        ]()

    return field


TO_SPACE = frame((POINT[0], 0.0, POINT[1]))[1]
V = [X[0] ** 2 * X[1], X[1] ** 3 * X[0] + X[0], X[0] * X[1] ** 2]
S = ufl.as_matrix([[X[0] * X[1], X[1] ** 2, X[0] ** 2], [X[0] ** 3, X[1] * X[0] ** 2, X[1]],
                   [X[0] * X[1] ** 2, X[1] ** 3, X[1] * X[0] ** 3]])  # fmt: skip


def test_gradient_of_a_scalar():
    f = X[0] ** 2 * X[1]
    assert TO_SPACE @ value(AXI.grad(f)) == pytest.approx(slopes(in_space(f)), abs=1e-7)


@pytest.mark.parametrize("components", [2, 3])
def test_gradient_and_divergence_of_a_vector(components):
    v = ufl.as_vector(V[:components])
    expected = slopes(in_space(ufl.as_vector([*V[:components], *[0 * X[0]] * (3 - components)])))
    assert TO_SPACE @ value(AXI.grad(v)) @ TO_SPACE.T == pytest.approx(expected, abs=1e-7)
    assert value(AXI.div(v)) == pytest.approx(np.trace(expected), abs=1e-7)
    strain = (expected + expected.T) / 2
    assert TO_SPACE @ value(AXI.eps(v)) @ TO_SPACE.T == pytest.approx(strain, abs=1e-7)


def test_divergence_of_a_tensor():
    expected = np.trace(slopes(in_space(S)), axis1=1, axis2=2)
    assert TO_SPACE @ value(AXI.div(S)) == pytest.approx(expected, abs=1e-7)


def test_components_have_the_order_of_the_rust_part():
    u = ufl.as_vector(V[:2])
    g = value(AXI.grad(u))
    assert [float(value(c)) for c in AXI.gradient(u)] == [*g[:2, :2].ravel(), g[2, 2]]
    strain = [g[0, 0], g[1, 1], g[0, 1] + g[1, 0], g[2, 2]]
    assert [float(value(c)) for c in AXI.strain(u)] == pytest.approx(strain)
    assert value(AXI.tensor([1, 2, 3, 4])).tolist() == [[1, 3, 0], [3, 2, 0], [0, 0, 4]]
    assert value(AXI.tensor([1, 2, 3, 4, 5])).tolist() == [[1, 2, 0], [3, 4, 0], [0, 0, 5]]
    assert value(FLAT.tensor([1, 2, 3])).tolist() == [[1, 3], [3, 2]]
    assert value(FLAT.tensor([1, 2, 3, 4])).tolist() == [[1, 2], [3, 4]]


def test_the_volume_change_is_the_derivative_of_the_volume():
    u, du = ufl.as_vector(V[:2]), ufl.as_vector([V[1], V[0]])
    step = 1e-5
    ahead, behind = (
        np.log(np.linalg.det(np.eye(3) + value(AXI.grad(u + s * step * du)))) for s in (1, -1)
    )
    found = value(AXI.volume_change(u, du, finite=True))
    assert found == pytest.approx((ahead - behind) / (2 * step), rel=1e-8)
    assert value(AXI.volume_change(u, du, finite=False)) == pytest.approx(value(AXI.div(du)))


def test_in_plane_strain_they_are_those_of_ufl():
    v = ufl.as_vector(V[:2])
    assert FLAT.grad(v) == ufl.grad(v)
    assert FLAT.div(v) == ufl.div(v)
    assert FLAT.eps(v) == ufl.sym(ufl.grad(v))
    assert (FLAT.dim, FLAT.I.ufl_shape, AXI.dim, AXI.I.ufl_shape) == (2, (2, 2), 3, (3, 3))
    assert value(AXI.volume) == pytest.approx(2 * np.pi * POINT[0])
    assert value(FLAT.volume) == 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: AXI.div(X[0]), "div of a scalar: expected a vector or a tensor"),
        (lambda: FLAT.div(X[0]), "div of a scalar: expected a vector or a tensor"),
        (lambda: AXI.grad(S), r"grad of an expression of shape \(3, 3\): expected a scalar or a v"),
        (lambda: AXI.div(ufl.grad(X)), r"div .* shape \(2, 2\): .* a tensor of shape \(3, 3\)"),
        (lambda: AXI.eps(X[0]), r"eps of an expression of shape \(\): expected a vector"),
        (lambda: FLAT.eps(ufl.grad(X)), r"eps of an expression of shape \(2, 2\): expected a vec"),
        (lambda: AXI.tensor([1.0]), "a tensor of 1 components: expected 4 of a stress, or 5 of a"),
    ],
)  # fmt: skip
def test_expressions_of_another_shape_are_rejected(call, message):
    with pytest.raises(tawami.FormError, match=message):
        call()
