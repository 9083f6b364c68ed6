"""Any argument of any function that a driver script calls works, or an error message names it.

Each function has good arguments in a table, and one of them is replaced. `make test` draws a
few examples for each function, always the same; `make fuzz` draws many.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
import shutil
import tempfile
import warnings
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from mpi4py import MPI
from profiles import examples, seed_of
from scenes import grid_of

import tawami
from tawami.base.files import atomic_file, result_folder
from tawami.form import vector
from tawami.results.plot import plot
from tawami.results.single import write_grid, write_particles

KINDS = ["?", "i1", "u8", "f4", "f8", "c16", "O", "U3", "M8[s]", [("a", "f8"), ("b", "i4")]]
NUMBERS: list[Any] = [
    math.nan, math.inf, -math.inf, 0, 1, 2, -1, -0.0, 5e-324, 1e-300, 1e308, -1e308, 2**63, 10**400,
    10**9, 10**6, 0.5, 1e-9, 1j, Decimal("0.3"), Decimal("NaN"), Fraction(10**400, 3), True, False,
]  # fmt: skip
OBJECTS: list[Any] = [
    None, "", "x", "left", "u", "a/b", "\0", "\ud800", "a" * 300, b"ab", [], (), {}, {1, 2},
    [None, None], ["a", "b"], [[]], [[0.0, 1.0], [2.0]], [1, 2], [1.0, math.nan], (1, 2, 3),
    [[0, 0], [1, 0], [1, 1]], {"x": 1}, {"E": {"default": "much"}}, {1: 2}, [10**400, 1], range(2),
    (i for i in (1, 2)), Path("x"), Path(), Path("/"), Path("a" * 300), object(), object,
    np.ma.masked, np.ma.masked_array([0.0, 1.0], [True, False]), MPI.COMM_NULL, tawami.Body(None, None),
    tawami.linear_elastic(E=1.0, nu=0.5), tawami.neo_hookean(E=1.0, nu=0.3),
]  # fmt: skip
FUNCTIONS: list[Any] = [
    lambda: 0.0, lambda *_: None, lambda *_: "a", lambda *_: math.nan, lambda *_: 1 / 0,
    lambda *_: [[0.0, 1.0], [2.0]], lambda *_: np.zeros((3, 3, 3)), lambda *_: 1j, dict,
]  # fmt: skip
SHAPES = [(), (0,), (1,), (2,), (3,), (0, 2), (2, 2), (3, 2), (2, 3), (16, 2), (16,)]


@st.composite
def arrays(draw: st.DrawFn) -> Any:
    """An array of some type, shape, order and content; also a scalar of NumPy."""
    kind, shape = np.dtype(draw(st.sampled_from(KINDS))), draw(st.sampled_from(SHAPES))
    values = np.zeros(shape, dtype=kind)
    if kind.kind == "f":
        with np.errstate(all="ignore"):
            values[...] = draw(st.sampled_from([0.5, -0.0, math.nan, math.inf, 5e-324, 1e308]))
    turn = draw(st.sampled_from([np.asarray, np.asfortranarray, np.flip, np.ma.masked_array]))
    if shape == () and draw(st.booleans()):
        return values[()]
    return turn(values)


PLAIN = st.one_of(st.sampled_from(NUMBERS), st.sampled_from(OBJECTS), arrays())
NASTY = st.one_of(PLAIN, st.tuples(PLAIN, PLAIN), st.sampled_from(FUNCTIONS))
#: Functions of the driver: their errors are its own.
CALLS = {"respond", "each", "main"}


class EnoughError(Exception):
    """Ends a run after its first step."""


def enough(_: tawami.Solution) -> None:
    raise EnoughError


def scene_of(form: str = "u_epsv", **options: Any) -> tawami.Scene:
    grid = grid_of((2, 2))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    material = tawami.linear_elastic(E=1e3, nu=0.3)
    scene = tawami.Scene(grid, body, material, form=form, **{"density": 1.0} | options)
    scene.hold((-1.0, 0.5), "x")
    scene.hold((-1.0, 0.5), "y")
    scene.hold((-1.0, 1.5), "x")
    return scene


def without_supports() -> tawami.Scene:
    scene = scene_of()
    scene.release((-1.0, 0.5))
    scene.release((-1.0, 1.5))
    return scene


def motion_of() -> tawami.Dynamics:
    return tawami.Dynamics(scene_of("u_finite"))


def solved(scene: tawami.Scene, method: str) -> Callable[..., Any]:
    """Call a method of a scene, then take a step with what it was given."""

    def call(**arguments: Any) -> None:
        getattr(scene, method)(**arguments)
        if any(support.has_velocity for support in scene.configuration.supports.all):
            tawami.Dynamics(scene).step(0.01)
        else:
            scene.solve()

    return call


def run_of(**knobs: Any) -> dict[str, float]:
    """The function of the studies below, whose runs exist already."""
    return {"x": 1.0, **knobs}


def study_of(**options: Any) -> tawami.Study:
    folder = tempfile.mkdtemp()
    good = {"name": "toy", "function": run_of, "knobs": {"n": (1, 2)}, "reference": {"x": 1.0},
            "folder": folder}  # fmt: skip
    return tawami.Study(**good | options)


def studied(**arguments: Any) -> Any:
    """Call Study.run where all of its runs exist already."""
    study = study_of()
    result_folder(study.path)
    head = {"label": "MPM", "fingerprint": study.series[0].fingerprint, "values": {"x": 1.5}}
    costs = dict.fromkeys(
        ("wall_s", "cpu_s", "peak_MB", "newton_iterations", "steps", "unknowns"), 1.0
    )
    lines = [json.dumps(head | costs | {"knobs": {"n": n}}) for n in (1, 2)]
    (study.path / "runs.jsonl").write_text("\n".join(lines))
    return study.run(**arguments)


ELASTIC = tawami.linear_elastic(E=1e3, nu=0.3)
FRICTION = {"phi": 30.0, "c": 1.0, "psi": 0.0, "eps_v_max": math.inf, "tiny_angle": False}


def law(strain: np.ndarray, stress: np.ndarray, history: Any = None) -> tuple[Any, Any]:
    return stress + strain, np.tile(np.eye(4), (len(strain), 1, 1))


def residual(w: Any, sigma: Any, sum_p: Any) -> Any:
    from ufl import grad

    return sum_p(sigma, grad(w))


def in_motion(method: str) -> Callable[..., Any]:
    return lambda **arguments: getattr(motion_of(), method)(**arguments)


def on_scene(method: str) -> Callable[..., Any]:
    return lambda **arguments: getattr(scene_of(), method)(**arguments)


def in_folder(write: Callable[..., Any]) -> Callable[..., Any]:
    """Call a writer in a folder of its own."""

    def call(path: Any, **arguments: Any) -> None:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            write(path, **arguments)

    return call


@functools.cache
def folder_of_a_run() -> Path:
    folder = Path(tempfile.mkdtemp()) / "run"
    results = tawami.Results(folder, tawami.ParticleOutput(), tawami.TableOutput())
    tawami.ramp(scene_of(), 1.0, results=results)
    return folder


def beside_a_run(read: Callable[..., Any]) -> Callable[..., Any]:
    """Call a reader in a folder that holds a run."""

    def call(path: Any, **arguments: Any) -> None:
        shutil.copytree(folder_of_a_run(), "run")
        read(path, **arguments)

    return in_folder(call)


def tabled(path: Any, column: Any, outside: Any) -> None:
    Path("field.csv").write_text("x,y,value\n0,0,1\n1,0,1\n0,1,1\n")
    tawami.table(path, column, outside=outside)


def resulting(path: Any, **arguments: Any) -> None:
    """Take a step with results."""
    results = tawami.Results(path, **arguments)
    tawami.ramp(scene_of(), 1.0, results=results, each=enough)


def observed(kind: Any) -> Callable[..., Any]:
    """Take a step with an output whose files are called `path`."""

    def call(path: Any, quantity: Any, **arguments: Any) -> None:
        output = kind(quantity, name=path, **arguments)
        tawami.ramp(scene_of(), 1.0, results=tawami.Results("run", output))

    return call


def whole(path: Any) -> None:
    with atomic_file(path) as part:
        part.write_text("x")


#: Functions and good arguments.
TABLE: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Grid": (tawami.Grid, {"comm": MPI.COMM_WORLD, "origin": (0, 0), "h": 1.0, "cells": (2, 2)}),
    "Body": (lambda **a: tawami.Scene(grid_of(), tawami.Body(**a), ELASTIC),
             {"x": np.array([[0.0, 1.0]]), "volume": np.array([0.1])}),
    "box": (lambda **a: tawami.box(**a),
            {"grid": grid_of(), "lower": (-1.0, 0.5), "upper": (0.0, 1.0), "per_axis": 2,
            "gauss": False}),
    "polygon": (tawami.polygon, {"grid": grid_of(), "shape": [(-1, 0.5), (0, 0.5), (0, 1.2)],
                                 "holes": [], "names": ["a", "b", "c"], "per_axis": 2, "gauss": True}),
    "polyline": (tawami.polyline, {"corners": [(-1, 0.5), (0, 0.5), (0, 1.2)],
                                   "names": ["a", "b", "c"], "closed": True}),
    "disc": (tawami.disc, {"grid": grid_of(), "centre": (0.0, 1.2), "radius": 0.6, "inner": 0.2,
                           "per_axis": 2, "gauss": True}),
    "level_set": (tawami.level_set, {
        "grid": grid_of(), "f": lambda x, y: np.hypot(x, y - 1.2) - 0.6, "ends": (),
        "tolerance": 1e-3, "samples": 4, "name": "skin", "per_axis": 2, "gauss": True}),
    "mesh": (tawami.mesh, {
        "grid": grid_of(), "source": meshio.Mesh([(-1, 0.5), (0, 0.5), (0, 1.2)],
                                                 [("triangle", [[0, 1, 2]])]),
        "tags": None, "groups": None, "per_axis": 2, "gauss": True}),
    "table": (in_folder(tabled), {"path": "field.csv", "column": "value", "outside": "stop"}),
    "earlier": (beside_a_run(tawami.earlier), {"path": "run", "outside": "stop"}),
    "initial": (on_scene("initial"), {"name": "stress", "source": (1.0, 1.0, 1.0, 0.0),
                                      "beyond": "stop"}),
    "Results": (in_folder(resulting), {
        "path": "run", "checkpoint_steps": 2, "checkpoint_minutes": 1.0, "keep": 2,
        "existing": "stop", "progress": False}),
    "ramp, results": (lambda **a: tawami.ramp(scene_of(), 1.0, **a), {"results": None}),
    **{
        kind.__name__: (in_folder(observed(kind)), {
            "path": "output", "quantity": quantity, "every": 0.5, "phases": ["ramp"]} | more)
        for kind, quantity, more in (
            (tawami.ParticleOutput, "stress", {}),
            (tawami.GridOutput, "stress", {"projection": "lumped"}),
            (tawami.TableOutput, "run-out", {}))
    },
    "every_steps": (in_folder(observed(tawami.TableOutput)), {
        "path": "output", "quantity": "run-out", "every_steps": 2}),
    "check_form": (tawami.check_form, {"form": "u_p", "alpha": 0.1}),
    "plot": (beside_a_run(plot), {"path": "run", "quantity": "mean stress", "movie": "gif"}),
    "linear_elastic": (tawami.linear_elastic, {"E": 1.0, "nu": 0.3}),
    "neo_hookean": (tawami.neo_hookean, {"K": 1.0, "mu": 0.3}),
    "von_mises": (tawami.von_mises, {"elastic": ELASTIC, "yield_stress": 1.0, "hardening": 0.0}),
    "drucker_prager": (tawami.drucker_prager, {"elastic": ELASTIC, **FRICTION}),
    "mohr_coulomb": (tawami.mohr_coulomb, {"elastic": ELASTIC, **FRICTION}),
    "cam_clay": (tawami.cam_clay, {
        "elastic": ELASTIC, "M": 1.0, "lambda_star": 0.2, "kappa_star": 0.05,
        "preconsolidation": 0.1, "tension": 1e-3}),
    "NumpyLaw": (tawami.NumpyLaw, {"respond": law, "K": 1.0, "mu": 1.0, "history": ("kappa",)}),
    "Form": (lambda **a: scene_of(form=tawami.Form(**a)), {
        "fields": {"u": vector("w")}, "residual": residual,
        "parameters": {}, "options": {}, "strain": "small", "whole_cells": (), "name": "own"}),
    "Scene": (lambda **a: tawami.Scene(**a), {
        "grid": grid_of(), "body": tawami.Body(np.array([[0.0, 1.0]]), np.array([0.1])),
        "material": ELASTIC, "material_of": [0], "form": "u_epsv", "basis": "quadratic_spline",
        "tolerance": 1e-6, "max_iterations": 20, "assembly": "points",
        "factorise": "always", "linear_solver": "direct", "density": 1.0, "leaving": "stop",
        "alpha": 0.1, "stabilisation": "laplacian"}),
    "fix": (lambda **a: solved(scene_of(), "fix")(**a),
            {"where": "left", "component": "y", "value": 0.0, "amplitude": 1.0, "velocity": None}),
    "fix, a part": (lambda **a: solved(scene_of(), "fix")(**a),
                    {"where": lambda x, y: (x < -0.9) & (y < 0.8), "component": "tangent",
                     "value": 0.0}),
    "fix, moving": (lambda **a: solved(scene_of(), "fix")(**a),
                    {"where": "left", "component": "y", "velocity": 0.0}),
    "hold": (lambda **a: solved(scene_of(), "hold")(**a),
             {"point": (0.0, 1.0), "component": "x", "value": 0.0, "amplitude": 1.0,
              "velocity": None}),
    "wall": (lambda **a: solved(scene_of(), "wall")(**a),
             {"edge": "bottom", "friction": 0.1, "separates": True}),
    "release": (on_scene("release"), {"place": (-1.0, 0.5), "component": "x"}),
    "traction": (lambda **a: solved(scene_of(), "traction")(**a),
                 {"where": "right", "value": (1.0, 0.0), "amplitude": 1.0}),
    "pressure": (lambda **a: solved(scene_of(), "pressure")(**a),
                 {"where": ["right", "top"], "value": 1.0, "amplitude": 1.0}),
    "load": (lambda **a: solved(scene_of(), "load")(**a), {"particles": [0, 3], "force": (1.0, 0.0)}),
    "load, each": (on_scene("load"), {
        "particles": lambda x, y: x < 9, "force": np.ones((16, 2)), "amplitude": 1.0}),
    "remove": (lambda **a: without_supports().remove(**a), {"where": [0, 3]}),
    "change_material": (on_scene("change_material"), {"where": [0, 3], "material": ELASTIC}),
    "named": (lambda **a: tawami.box(grid_of(), (-1.0, 0.5), (0.0, 1.0)).named(**a),
              {"name": "clay"}),
    "gravity": (lambda **a: solved(scene_of(), "gravity")(**a),
                {"acceleration": (0.0, -1.0), "amplitude": 1.0}),
    "change": (lambda **a: scene_of().gravity((0.0, -1.0)).change(**a),
               {"value": (0.0, 1.0), "amplitude": 2.0}),
    "solve": (on_scene("solve"), {"until": 1.0}),
    "residual": (on_scene("residual"), {"coefficients": np.zeros(41)}),
    "tangent": (on_scene("tangent"), {"coefficients": np.zeros(41)}),
    "displacement": (lambda **a: scene_of().solve().displacement(**a), {"point": (0.0, 1.0)}),
    "reaction": (lambda **a: scene_of().solve().reaction(**a), {"place": (-1.0, 0.5)}),
    "Dynamics": (lambda **a: tawami.Dynamics(**a), {
        "scene": scene_of("u_finite"), "velocity": (0.0, 0.0), "transfer": "flip", "damping": 1.0,
        "gamma": 0.5}),
    "step": (in_motion("step"), {"dt": 0.01}),
    "run": (in_motion("run"), {"end": 0.02, "dt": 0.01, "smallest": 1e-3, "each": enough}),
    "angular_momentum": (in_motion("angular_momentum"), {"about": (0.0, 0.0)}),
    "ramp": (lambda **a: tawami.ramp(**a),
             {"scene": scene_of(), "size": 0.5, "smallest": 0.1, "until": 1.0, "each": enough}),
    "settle": (lambda **a: tawami.settle(**a),
               {"scene": scene_of("u_finite"), "tolerance": 1e-10, "max_resets": 3}),
    "Series": (tawami.Series, {"label": "own", "run": run_of, "knobs": {"n": (1, 2)}}),
    "Study": (lambda **a: study_of(**a), {
        "name": "toy", "function": run_of, "knobs": {"n": (1, 2)}, "reference": {"x": 1.0},
        "finest": {"n": 3}, "beside": (), "colour": "n", "folder": None}),
    "Study.run": (studied, {"sample": 1, "seed": 0, "limit": 10.0, "quiet": True}),
    "recommend": (tawami.recommend, {"study": Path("cases/costs/trade/cook.csv"), "tolerance": 0.1,
                                     "cost": "wall_s"}),
    "run, a driver": (tawami.run, {"main": lambda: None, "name": "toy"}),
    "write_particles": (in_folder(write_particles), {"path": "p.vtu", "solution": scene_of().solve()}),
    "write_grid": (in_folder(write_grid), {"path": "g.vtu", "solution": scene_of().solve()}),
    "atomic_file": (in_folder(whole), {"path": "x.csv"}),
    "result_folder": (in_folder(result_folder), {"path": "results"}),
}  # fmt: skip
#: Words for an argument in messages that do not name it.
CALLED = {
    "place": "release|reaction|edge", "lower": "box", "upper": "box", "shape": "polygon|vertices",
    "holes": "hole", "radius": "disc", "centre": "disc", "inner": "disc", "f": "level_set",
    "ends": "level_set|edge", "source": "mesh|initial|stress", "column": "table",
    "quantity": "particles|grid|table|Output", "coefficients": "residual", "particles": "load",
    "force": "load", "function": "run|series", "stabilisation": "stabilisation", "label": "series",
    "main": "run", "path": "'|folder|name", "acceleration": "gravity",
    "body": "Body|Scene|particles|volume", "grid": "Grid|grid|mesh", "body.x": "x",
    "where": "border", "value": "pressure|fix|traction|hold|gravity|Newton", "edge": "edge|wall",
    "cells": "grid",
    "folder": "folder|'",
    "volume": "volume|particle|body", "x": "particle|body", "material": "elastic|particle|law|form",
    "material_of": "particle", "fields": "field|declare|form", "residual": "form",
    "options": "option|form", "parameters": "parameter|form", "kinematics": "form", "strain": "form",
    "name": "form|initial", "point": "hold|displacement", "velocity": "velocity|hold|Newton",
    "tolerance": "within|quantity", "knobs": "knob", "finest": "finest|knob",
    "density": "density|mass", "h": "origin|h", "origin": "origin",
}  # fmt: skip


@pytest.mark.fuzz
@pytest.mark.parametrize("name", TABLE)
def test_any_argument_works_or_is_named(name):
    function, good = TABLE[name]
    with contextlib.suppress(EnoughError):
        function(**good)

    @seed(seed_of(name))
    @settings(max_examples=examples(15))
    @given(st.sampled_from(sorted(good)), NASTY)
    def replaced(argument: str, value: Any) -> None:
        if argument in CALLS and callable(value):
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                function(**good | {argument: value})
            except (EnoughError, tawami.ConvergenceError, tawami.SingularError):
                pass  # numbers that are possible, but too large to be solved for
            except tawami.TawamiError as error:
                words = [argument, *CALLED.get(argument, argument).split("|")]
                assert any(word in str(error) for word in words), f"{argument}: {error}"
                assert len(str(error)) < 2000, error

    replaced()
