"""Wrong input raises one clear error message and changes nothing."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from scenes import grid_of

import tawami
from tawami import _rust
from tawami.form import scalar, vector

ELASTIC = {"E": 1e6, "nu": 0.3}


def body_of(grid: tawami.Grid) -> tawami.Body:
    return tawami.box(grid, grid.origin, grid.upper, per_axis=2)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"E": 1.0, "nu": 0.51}, r"linear_elastic: nu = 0.51: expected -1 < nu <= 0.5"),
        ({"E": 1.0, "nu": -1.0}, r"nu = -1: expected"),
        ({"E": 0.0, "nu": 0.3}, r"E = 0: expected a positive, finite modulus in Pa"),
        ({"E": -5.0, "nu": 0.3}, r"E = -5: expected a positive"),
        ({"E": float("nan"), "nu": 0.3}, r"E = NaN: expected a positive"),
        ({"K": 1.0, "mu": 0.0}, r"mu = 0: expected a positive"),
        ({"E": 1.0, "one_minus_2nu": 3.0}, r"one_minus_2nu = 3: expected 0 <= 1 - 2 nu < 3"),
        ({"E": 1.0, "K": 1.0}, r"got E, K: expected \(E, nu\), \(K, mu\) or"),
        ({"E": 1.0, "nu": "much"}, r"nu = 'much': expected a number"),
        ({}, r"got nothing: expected"),
    ],
)
def test_wrong_materials_are_rejected(parameters, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.linear_elastic(**parameters)
    law = message.replace("linear_elastic", "neo_hookean")
    with pytest.raises(tawami.InputError, match=law):
        tawami.neo_hookean(**parameters)


def test_a_neo_hookean_material_is_compressible():
    with pytest.raises(
        tawami.InputError, match="neo_hookean: K = inf: expected a positive, finite"
    ):
        tawami.neo_hookean(E=1.0, nu=0.5)


@pytest.mark.parametrize("form", ["u", "u_bbar", "u_epsv"])
@pytest.mark.parametrize("incompressible", [{"nu": 0.5}, {"one_minus_2nu": 0.0}])
def test_only_u_p_takes_an_incompressible_material(form, incompressible):
    grid = grid_of()
    material = tawami.linear_elastic(E=1.0, **incompressible)
    with pytest.raises(tawami.InputError, match=r"particle 0 .*nu = 0.5.*Use form 'u_p'"):
        tawami.Scene(grid, body_of(grid), material, form=form)


def test_a_form_that_names_k_rejects_an_incompressible_material():
    """Kinematics 'deviatoric' takes such a material, but K in a sum would be infinite."""

    def residual(u, p, w, q, sigma, K, sum_p):
        from ufl import div, grad

        return sum_p(sigma, grad(w)) + sum_p(p * div(w)) + sum_p(K, q * div(u)) - sum_p(q * p)

    form = tawami.Form(
        fields={"u": vector("w"), "p": scalar("q", role="pressure")},
        residual=residual,
    )
    grid = grid_of()
    material = tawami.linear_elastic(E=1.0, nu=0.5)
    with pytest.raises(tawami.InputError, match="'K' is not finite at particle 0"):
        tawami.Scene(grid, body_of(grid), material, form=form)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"h": 0.0}, "h = 0: expected a positive cell size"),
        ({"h": float("nan")}, "h = nan: expected a finite number"),
        ({"cells": (0, 2)}, r"cells\[0\] = 0: expected a whole number, at least 1"),
        ({"cells": (2, -1)}, r"cells\[1\] = -1: expected a whole number, at least 1"),
        ({"cells": (2.5, 1)}, r"cells\[0\] = 2.5: expected a whole number"),
        ({"cells": (2, 40000)}, r"cells\[1\] = 40000: expected between 1 and 32768"),
        ({"origin": (float("inf"), 0.0)}, r"origin\[0\] = inf: expected a finite"),
        ({"origin": (0.0,)}, r"origin = \(0.0,\): expected two"),
    ],
)
def test_wrong_grids_are_rejected(options, message):
    given = {"origin": (0.0, 0.0), "h": 1.0, "cells": (2, 2), **options}
    with pytest.raises(tawami.InputError, match=message):
        tawami.Grid(MPI.COMM_WORLD, **given)


def scene_of(x, volume=None, **options):
    grid = grid_of()
    volume = np.full(len(x), 0.1) if volume is None else volume
    return tawami.Scene(grid, tawami.Body(x, volume), tawami.linear_elastic(**ELASTIC), **options)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"x": np.array([[0.0, 1.0], [3.0, 1.0], [0.0, -9.0]])},
            r"2 of 3 particles lie outside the grid; the first is particle 1 at \(3, 1\)",
        ),
        ({"x": np.zeros((0, 2))}, "the body has no particles"),
        (
            {"x": np.array([[0.0, np.nan]])},
            "x: 1 entries are not finite; the first is NaN at particle 0",
        ),
        ({"x": np.array([[0.0, 1.0]]), "volume": np.array([0.0])}, "volume of particle 0 is 0"),
        (
            {"x": np.array([[0.0, 1.0]]), "volume": np.ones(2)},
            r"volume has shape \[2\]: expected \(1,\)",
        ),
        ({"x": np.zeros(4)}, r"x has shape \(4,\): expected 2 dimensions"),
        ({"x": np.zeros((4, 3))}, r"x has shape \[4, 3\]: expected \(particles, 2\)"),
        ({"x": [["a", "b"]]}, "x: expected an array of real numbers"),
        ({"x": np.array([[0.0, 1.0j]])}, "x: expected an array of real numbers"),
        ({"x": np.array([[0.0, 1.0]]), "material_of": 1}, r"material_of has shape \(\)"),
        ({"x": np.array([[0.0, 1.0]]), "basis": "cubic"}, "basis 'cubic': expected one of"),
        ({"x": np.array([[0.0, 1.0]]), "tolerance": 0.0}, "tolerance = 0.0: expected"),
        ({"x": np.array([[0.0, 1.0]]), "max_iterations": 0}, "max_iterations = 0: expected"),
        (
            {"x": np.array([[0.0, 1.0]]), "material_of": [1]},
            "particle 0 names material 1, but there are 1",
        ),
        (
            {"x": np.array([[0.0, 1.0]]), "material_of": [-1]},
            r"material_of\[0\] = -1: expected the number",
        ),
        ({"x": np.array([[0.0, 1.0]]), "material_of": [0.5]}, r"material_of\[0\] = 0.5"),
    ],
)
def test_wrong_bodies_are_rejected(arguments, message):
    with pytest.raises(tawami.InputError, match=message):
        scene_of(**arguments)


def test_wrong_boxes_are_rejected():
    grid = grid_of()
    with pytest.raises(tawami.InputError, match=r"its x range \[-1, 2\] m leaves the grid"):
        tawami.box(grid, (-1.0, 0.5), (2.0, 2.0), per_axis=2)
    with pytest.raises(
        tawami.InputError, match=r"\[0, 0\] m is empty, so the body has no particles"
    ):
        tawami.box(grid, (0.0, 0.5), (0.0, 2.0), per_axis=2)
    with pytest.raises(tawami.InputError, match="expected lower < upper"):
        tawami.box(grid, (0.3, 0.5), (0.1, 2.0), per_axis=2)
    with pytest.raises(tawami.InputError, match=r"is round-off on cells of 0.5 m"):
        tawami.box(grid, (0.0, 0.5), (1e-8, 2.0), per_axis=2)
    with pytest.raises(tawami.InputError, match="per_axis = 0"):
        tawami.box(grid, (-1.0, 0.5), (0.0, 2.0), per_axis=0)


@pytest.mark.parametrize("array", ["volume", "stress", "displacement", "eps_v"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nan_in_any_particle_array_stops_before_anything_is_solved(array, value):
    grid = grid_of()
    scene = tawami.Scene(grid, body_of(grid), tawami.linear_elastic(**ELASTIC))
    scene.fix("left", "x")
    scene.fix("left", "y")
    values = getattr(scene.particles, array)
    values[3] = value
    with pytest.raises(
        tawami.InputError, match=rf"{array}: \d+ entries are not finite; .* particle 3"
    ):
        scene.solve()


def test_positions_and_materials_of_the_particles_cannot_be_written():
    scene = scene_of(np.array([[0.0, 1.0]]))
    for array in (scene.particles.x, scene.particles.material):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_other_objects_than_grid_body_and_material_are_rejected():
    grid = grid_of()
    with pytest.raises(tawami.InputError, match=r"Scene\(Grid, ndarray, ...\): expected"):
        tawami.Scene(grid, np.zeros((3, 2)), tawami.linear_elastic(**ELASTIC))
    with pytest.raises(tawami.InputError, match="material = 'steel': expected a material"):
        tawami.Scene(grid, body_of(grid), "steel")
    with pytest.raises(tawami.InputError, match="material = 3: expected a material"):
        tawami.Scene(grid, body_of(grid), 3)
    with pytest.raises(tawami.InputError, match="comm = None: expected a communicator"):
        tawami.Grid(None, origin=(0, 0), h=1.0, cells=(1, 1))


def test_numpy_numbers_are_numbers():
    material = tawami.linear_elastic(E=np.int64(3), nu=np.float32(0.25))
    assert material.shear_modulus == pytest.approx(1.2)
    assert tawami.linear_elastic(E=1, one_minus_2nu=-0.0).bulk_modulus == np.inf


def test_wrong_supports_and_loads_are_rejected():
    grid = grid_of()
    scene = tawami.Scene(grid, body_of(grid), tawami.linear_elastic(**ELASTIC))
    for call, message in [
        (
            lambda: scene.fix("west", "x"),
            r"fix\('west'\): the border has no part 'west', .* expected one of 'bottom', 'right', 'top'",
        ),
        (
            lambda: scene.fix("left", "z"),
            "component 'z': expected one of 'x', 'y', 'normal', 'tangent'",
        ),
        (lambda: scene.hold((9.0, 1.0), "x"), r"hold.*expected a point within the grid"),
        (lambda: scene.hold((0.0, 1.0), "z"), "component 'z'"),
        (lambda: scene.hold((0.0,), "x"), r"expected two numbers, a point \(x, y\)"),
        (lambda: scene.hold(5, "x"), r"hold\(point=5\) = 5: expected two numbers"),
        (lambda: scene.hold((0.0, "a"), "x"), r"\[1\] = 'a': expected a number"),
        (lambda: scene.hold((0.0, 1.0), "x", np.nan), "nan: expected a finite"),
        (lambda: scene.traction("up", (0, 0)), r"traction\('up'\): the border has no part 'up'"),
        (
            lambda: scene.pressure("left", (0, 1)),
            r"pressure\('left'\) = \(0, 1\): expected a number or a func",
        ),
        (lambda: scene.pressure(lambda x, y: x > 9, 1.0), "no point of the border is in this part"),
        (lambda: scene.fix(lambda x, y: x, "x"), r"fix\(where f\(x, y\)\): .*expected"),
        (
            lambda: scene.traction(np.ones(3, dtype=bool), (0, 1)),
            r"a mask of type bool and shape \(3,\): expected True or False for each of the \d+ points",
        ),
        (
            lambda: scene.traction("right", 5.0),
            r"traction\('right'\) = 5.0: expected two comp",
        ),
        (lambda: scene.traction("right", (0, 1, 2)), "expected two comp"),
    ]:
        with pytest.raises(tawami.InputError, match=message):
            call()
    scene.fix("left", "x", lambda x, y: np.nan * x)
    with pytest.raises(tawami.InputError, match=r"fix\('left'\): nan at .*: expected a finite"):
        scene.solve()
    scene = tawami.Scene(grid, body_of(grid), tawami.linear_elastic(**ELASTIC))
    scene.fix("left", "x", lambda x, y: x.sum(axis=3))
    with pytest.raises(tawami.InputError, match=r"fix\('left'\): expected a number or a function"):
        scene.solve()


def test_an_error_of_newton_holds_its_history_and_changes_nothing():
    from ufl import div, grad

    def residual(u, w, sigma, mu, sum_p):
        return sum_p(sigma, grad(w)) + sum_p(3e5 * mu, div(u) ** 3 * div(w))

    form = tawami.Form(fields={"u": vector("w")}, residual=residual)
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    material = tawami.linear_elastic(**ELASTIC)
    scene = tawami.Scene(grid, body, material, form=form, max_iterations=3)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (5e5, 0.0))
    with pytest.raises(
        tawami.ConvergenceError, match=r"in 3 iterations.*0: .*; 1: .*; 2: "
    ) as caught:
        scene.solve()
    assert len(caught.value.history) == 4
    assert not scene.particles.stress.any()
    assert not scene.particles.displacement.any()


def test_views_are_the_storage_and_outlive_the_scene():
    grid = grid_of()
    scene = tawami.Scene(grid, body_of(grid), tawami.linear_elastic(**ELASTIC))
    for name in ("x", "volume", "material", "stress", "displacement", "eps_v"):
        assert np.shares_memory(getattr(scene.particles, name), getattr(scene.particles, name))
    stress = scene.particles.stress
    stress[5, 2] = 7.0
    assert scene.particles.stress[5, 2] == 7.0
    del scene
    gc.collect()
    stress[:] = 1.0
    assert stress.sum() == stress.size


def test_only_the_arrays_that_a_scene_needs_exist():
    grid = grid_of()
    bytes_of = {}
    for form in ("u", "u_epsv"):
        scene = tawami.Scene(grid, body_of(grid), tawami.linear_elastic(**ELASTIC), form=form)
        bytes_of[form] = scene.particles.bytes_per_particle
        if form == "u":
            with pytest.raises(tawami.InputError, match=r"no volumetric strain.*form='u_epsv'"):
                _ = scene.particles.eps_v
        else:
            assert scene.particles.eps_v.shape == scene.particles.volume.shape
    assert bytes_of == {"u": 112, "u_epsv": 120}


@given(
    nu=st.floats(allow_nan=True, allow_infinity=True),
    modulus=st.floats(allow_nan=True, allow_infinity=True),
)
def test_any_number_makes_a_material_or_an_input_error(nu, modulus):
    try:
        material = tawami.linear_elastic(E=modulus, nu=nu)
    except tawami.InputError as error:
        assert "expected" in str(error)
    else:
        assert material.shear_modulus > 0
        assert material.bulk_modulus > 0


@given(
    x=st.floats(allow_nan=True, allow_infinity=True),
    h=st.floats(allow_nan=True, allow_infinity=True),
    cells=st.tuples(st.integers(-3, 40000), st.integers(-3, 40000)),
)
def test_any_numbers_make_a_grid_or_an_input_error(x, h, cells):
    try:
        tawami.Grid(MPI.COMM_WORLD, origin=(x, x), h=h, cells=cells)
    except tawami.InputError as error:
        assert "expected" in str(error)


def test_internal_shapes_are_checked_at_the_border_and_never_panic():
    grid = grid_of()
    scene = tawami.Scene(grid, body_of(grid), tawami.linear_elastic(**ELASTIC))
    with pytest.raises(RuntimeError, match="wrong number of grid coefficients"):
        scene.configuration.domain.stage.commit(np.zeros(3), None)
    with pytest.raises(tawami.InputError, match="coefficients: expected an array of real"):
        scene.split(None)
    u, v = scene.split(np.zeros(scene.num_coefficients))
    data = np.zeros((len(scene.particles), 2))
    requests = _rust.Requests([[("sigma", "value", 0, None)]])
    with pytest.raises(RuntimeError, match="outside the particle data"):
        scene.configuration.domain.stage.evaluate(u, v, requests, [data])
    with pytest.raises(RuntimeError, match="row of no active cell"):
        _rust.densities(
            scene.configuration.domain.location, scene.particles.volume, data, [(0, 0)], False,
            np.array([999], dtype=np.uint32), [0], 0, np.zeros((1, 1)),
        )  # fmt: skip
