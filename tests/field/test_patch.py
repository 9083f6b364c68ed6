"""Patch tests, rigid motions and other properties of a correct discretisation."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from mpi4py import MPI
from scenes import FORMS, grid_of, linear_field

import tawami
from tawami.grid.basis import BASES, extraction

GRADIENT = np.array([[2e-3, -1e-3], [4e-4, -1.5e-3]])
E, NU = 3e6, 0.45
K, MU = E / (3 * (1 - 2 * NU)), E / (2 * (1 + NU))
PULL = 1e3


def rectangle(options, *, per_axis, gauss, basis="quadratic_spline", cells=(4, 3)):
    """A scene of a rectangle that fills its grid."""
    grid = grid_of(cells)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=per_axis, gauss=gauss)
    material = tawami.linear_elastic(E=E, nu=NU)
    return tawami.Scene(grid, body, material, basis=basis, tolerance=1e-13, **options)


def tension_error(options, **kind):
    """Largest error of the stress in plain tension, divided by the tension, and relative L2 error."""
    scene = rectangle(options, **kind)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (PULL, 0.0))
    scene.solve()
    exact = PULL * np.tile([1, 0, NU, 0], (len(scene.particles), 1))
    error = scene.particles.stress - exact
    return np.abs(error).max() / PULL, np.linalg.norm(error) / np.linalg.norm(exact)


def test_a_linear_displacement_of_the_border_gives_one_stress(form, basis):
    """Patch test with particles at Gauss points."""
    scene = rectangle(form, per_axis=3, gauss=True, basis=basis)
    for edge in ("left", "right", "bottom", "top"):
        for k, component in enumerate("xy"):
            scene.fix(edge, component, lambda x, y, k=k: GRADIENT[k, 0] * x + GRADIENT[k, 1] * y)
    scene.solve()
    div = np.trace(GRADIENT)
    exact = K * div + 2 * MU * (np.array([GRADIENT[0, 0], GRADIENT[1, 1], 0]) - div / 3)
    exact = np.append(exact, MU * (GRADIENT[0, 1] + GRADIENT[1, 0]))
    assert np.abs(scene.particles.stress - exact).max() < 1e-12 * np.abs(exact).max()
    displacement = np.array(scene.particles.x) @ GRADIENT.T
    assert np.abs(scene.particles.displacement - displacement).max() < 1e-14


def test_plain_tension_gives_one_stress(form, basis):
    """Patch test with a loaded edge and particles at Gauss points.

    B-bar with quadratic functions fails it: div w at the centre of a cell is its mean for bilinear
    functions only, so no quadrature makes its mean stress exact. The sizes of this known error, 0.218
    and 0.417, are the code's own numbers.
    """
    largest, _ = tension_error(form, per_axis=3, gauss=True, basis=basis)
    if form["form"] == "u_bbar" and basis != "bilinear":
        expected = {"quadratic_spline": 0.218, "biquadratic": 0.417}[basis]
        assert largest == pytest.approx(expected, abs=0.002)
    else:
        assert largest < 1e-12


@pytest.mark.parametrize(
    ("name", "per_axis", "largest", "l2"),
    [
        ("u_epsv", 2, 0.077, 0.0130),
        ("u_epsv", 3, 0.040, 0.0049),
        ("u_epsv", 4, 0.026, 0.0026),
        ("u", 2, 0.112, 0.0202),
        ("u_bbar", 2, 0.162, 0.0342),
    ],
)
def test_evenly_spaced_particles_under_integrate_the_end_splines(name, per_axis, largest, l2):
    """8 x 6 cells in plain tension: the largest error of the stress is in the cells of the border and
    does not fall on finer grids; its L2 norm falls like h (documentation, Limits). The numbers are the
    code's own.
    """
    options = FORMS[name] | {"volumes": "own"}
    errors = tension_error(options, per_axis=per_axis, gauss=False, cells=(8, 6))
    assert errors[0] == pytest.approx(largest, rel=0.03)
    assert errors[1] == pytest.approx(l2, rel=0.03)
    finer = tension_error(options, per_axis=per_axis, gauss=False, cells=(16, 12))
    assert finer[0] == pytest.approx(largest, rel=0.05)
    assert finer[1] == pytest.approx(errors[1] / 2, rel=0.05)


@pytest.mark.parametrize("per_axis", [3, 4])
def test_nine_particles_in_a_full_cell_pass(per_axis):
    assert tension_error({"form": "u_epsv"}, per_axis=per_axis, gauss=False)[0] < 1e-12


@pytest.mark.parametrize("per_axis", [1, 2])
def test_biquadratic_lagrange_functions_need_more_particles(per_axis):
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=per_axis)
    material = tawami.linear_elastic(E=E, nu=NU)
    scene = tawami.Scene(grid, body, material, form="u_epsv", basis="biquadratic")
    scene.fix("left", "x")
    scene.hold(grid.origin, "y")
    scene.traction("right", (0.0, -1.0))
    weakest = rf"singular.*'biquadratic'.*\(i, j\).* with {per_axis**2} particles"
    with pytest.raises(tawami.SingularError, match=weakest):
        scene.solve()
    assert not scene.particles.stress.any()


def test_three_rigid_motions_give_no_force(random_scene, form, basis):
    scene = random_scene(basis=basis, **form)
    n = scene.num_coefficients
    tangent = scene.tangent(np.zeros(n))
    scale = abs(tangent).max()
    for a, gradient in (
        ([1, 0], np.zeros((2, 2))),
        ([0, 1], np.zeros((2, 2))),
        ([0, 0], np.array([[0, -1], [1, 0]])),
    ):
        mode = np.zeros(n)
        u = linear_field(scene.grid, basis, np.array(a, dtype=float), gradient)
        mode[: len(u)] = u
        assert np.abs(tangent @ mode).max() < 1e-13 * scale
        assert np.abs(scene.residual(mode)).max() < 1e-13 * scale


def test_the_tangent_is_symmetric(random_scene, form, basis):
    scene = random_scene(basis=basis, **form)
    tangent = scene.tangent(np.zeros(scene.num_coefficients))
    difference = abs(tangent - tangent.T).max() / abs(tangent).max()
    if form.get("stabilisation") == "residual_based" and basis != "bilinear":
        assert difference > 1e-4
    elif form.get("stabilisation") != "residual_based":
        assert difference < 1e-14


def test_the_tangent_is_the_derivative_of_the_residual(random_scene, form, basis):
    scene = random_scene(basis=basis, **form)
    random = np.random.default_rng(1)
    c, direction = 1e-2 * random.standard_normal((2, scene.num_coefficients))
    difference = (scene.residual(c + direction) - scene.residual(c - direction)) / 2
    predicted = scene.tangent(c) @ direction
    assert np.abs(difference - predicted).max() < 1e-12 * np.abs(predicted).max()


def test_doubling_all_volumes_doubles_residual_and_tangent(random_scene, form):
    once, twice = random_scene(**form), random_scene(**form)
    twice.particles.volume[:] *= 2
    c = np.random.default_rng(2).standard_normal(once.num_coefficients)
    if form.get("stabilisation") == "projection":
        # its stabilisation is an integral over whole cells, not over particles: left out here
        _, eps_v = once.split(c)
        eps_v[:] = 0.7
        np.testing.assert_allclose(twice.residual(c), 2 * once.residual(c), rtol=1e-12, atol=1e-12)
        return
    np.testing.assert_allclose(twice.residual(c), 2 * once.residual(c), rtol=1e-12, atol=1e-13)
    change = twice.tangent(c) - 2 * once.tangent(c)
    assert abs(change).max() < 1e-13 * abs(once.tangent(c)).max()


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("cells", [(1, 1), (2, 1), (5, 4)])
def test_rows_of_the_extraction_sum_to_one(basis, cells):
    for degree in (1, 2):
        matrix = extraction(basis, cells, degree)
        assert np.abs(matrix.sum(axis=1) - 1).max() < 1e-15


@pytest.mark.parametrize("name", FORMS)
def test_results_do_not_depend_on_units_or_place(name):
    """Metres or millimetres, pascals or megapascals, here or a kilometre away: the same strains."""
    options = FORMS[name]

    def solve(length, stress, shift):
        h = 0.25 * length
        grid = tawami.Grid(MPI.COMM_WORLD, origin=(shift, -shift), h=h, cells=(8, 4))
        body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
        material = tawami.linear_elastic(E=3e6 * stress, nu=0.4999)
        scene = tawami.Scene(grid, body, material, **options)
        scene.fix("left", "x")
        scene.fix("left", "y")
        scene.traction("right", (0.0, -1e3 * stress))
        return scene.solve().displacement((grid.upper[0], grid.upper[1]))[1] / length

    reference = solve(1.0, 1.0, 0.0)
    for arguments in ((1e3, 1e-6, 0.0), (1e-6, 1.0, 0.0), (1.0, 1e6, 1e3)):
        # without a field for the volume the condition number is that of K/mu
        accuracy = 1e-8 if options["form"] in ("u", "u_bbar") else 1e-9
        assert solve(*arguments) == pytest.approx(reference, rel=accuracy)


@pytest.mark.parametrize("name", ["u", "u_epsv"])
def test_particles_anywhere_release_a_stress(name, basis):
    """A body under -C : eps whose border moves by eps x is free of stress, whatever its quadrature. For
    biquadratic functions, some of which are negative at most particles, too.
    """
    grid = grid_of()
    random = np.random.default_rng(0)
    x = np.vstack([random.random((4, 2)) + np.array([i, j]) for j in range(3) for i in range(4)])
    x = grid.origin + grid.h * x
    law = tawami.linear_elastic(E=E, nu=NU)
    body = tawami.Body(x, np.full(len(x), grid.h**2 / 4))
    scene = tawami.Scene(grid, body, law, basis=basis, tolerance=1e-12, **FORMS[name])
    div = np.trace(GRADIENT)
    stress = K * div + 2 * MU * (np.array([GRADIENT[0, 0], GRADIENT[1, 1], 0]) - div / 3)
    stress = np.append(stress, MU * (GRADIENT[0, 1] + GRADIENT[1, 0]))
    scene.particles.stress[:] = -stress
    for edge in ("left", "right", "bottom", "top"):
        for k, component in enumerate("xy"):
            scene.fix(edge, component, lambda x, y, k=k: GRADIENT[k, 0] * x + GRADIENT[k, 1] * y)
    scene.solve()
    assert np.abs(scene.particles.stress).max() < 1e-9 * np.abs(stress).max()
    assert np.abs(scene.particles.displacement - x @ GRADIENT.T).max() < 1e-11


CORNER = 0.1 * np.array([[0.2, 0.2], [0.8, 0.2], [0.2, 0.8], [0.8, 0.8]])


@pytest.mark.parametrize(("of_cell", "message"), [
    (lambda r: CORNER, "on one side, their centroid 0.45 h off the centre"),
    (lambda r: 0.5 + 9 * (CORNER - 0.05), None),
    (lambda r: 0.75 + 5 * (CORNER - 0.05), None),  # a lattice that is moved by a quarter of a cell
    (lambda r: 0.5 + 15 * (CORNER - 0.05), r"at its border, 0.45 h \(rms\)"),
    (lambda r: 0.5 + 5 * (CORNER - 0.05) + 0.15 * r.choice([-1, 1], 2), "its neighbour .* by 0.3 h"),
    (lambda r: np.vstack([0.5 + 5 * (CORNER - 0.05)] * 2), "holds 2 times its area"),
])  # fmt: skip
def test_particles_that_integrate_badly_get_a_warning(of_cell, message):
    grid, random = grid_of(), np.random.default_rng(0)
    x = np.vstack([of_cell(random) + np.array([i, j]) for i in range(4) for j in range(3)])
    body = tawami.Body(grid.origin + grid.h * x, np.full(len(x), grid.h**2 / 4))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU))
    for point, component in ((x[0], "x"), (x[0], "y"), (x[-1], "x")):
        scene.hold(grid.origin + grid.h * point, component)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scene.solve()
        scene.solve()
    said = [str(w.message) for w in caught if w.category is tawami.QuadratureWarning]
    assert len(said) == (message is not None)
    assert all(re.search(message, text) for text in said)
