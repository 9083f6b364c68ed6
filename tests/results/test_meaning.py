"""A run is resumed only with functions of the same code that read the same values."""

from __future__ import annotations

import functools
import json
import logging
import os
import sys
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import pytest
from mpi4py import MPI
from runs import Kill, Killed, run

import tawami
from tawami.base.identity import differences, not_compared, text
from tawami.base.meaning import CODE, PYTHON, meaning

SCRIPT = """
import numpy as np
import settings
K, G = {K}, 1e3
WEIGHT = np.array([{weight}, 1.0])
calls = 0

def tangent(n):
    one = np.outer([1, 1, 1, 0], [1, 1, 1, 0])
    return np.tile(K * one + 2 * G * (np.diag([1, 1, 1, 0.5]) - one / 3), (n, 1, 1))

def respond(strain, stress):
    global calls
    calls += 1
    moduli = settings.FACTOR * tangent(len(strain))
    return stress + np.einsum("pij,pj->pi", moduli, strain), moduli

def made(slope, plus=lambda t: {plus}):
    def amplitude(t):
        return WEIGHT[1] + slope * t + plus(t)
    return amplitude

def residual(u, w, sigma, dx):
    from ufl import grad, inner
    return inner(sigma, grad(w)) * dx * {form}
"""


def script(monkeypatch, *, factor=1.0, **given):
    """The names of a script with other constants."""
    settings = ModuleType("settings")
    settings.FACTOR, settings.other = factor, given.pop("other", 0)
    monkeypatch.setitem(sys.modules, "settings", settings)
    values = {"K": 5e3, "weight": 1.0, "plus": "0 * t", "form": "1"} | given
    names = {"__name__": "driver"}
    exec(SCRIPT.format(**values), names)
    return names


def scene(names, slope, leaving="stop"):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 4))
    body = tawami.box(grid, (0.25, 0), (0.75, 0.5), per_axis=2)
    law = tawami.NumpyLaw(names["respond"], 5e3, 1e3)
    made = tawami.Scene(grid, body, law, form="u", density=1000.0, leaving=leaving)
    made.fix("bottom", "y")
    made.fix("bottom", "x")
    made.gravity((0.0, -1.0), amplitude=names["made"](slope))
    return made


@pytest.mark.parametrize(
    ("given", "slope", "leaving", "said"),
    [
        ({"K": 2.5e3}, 0.1, "stop", "laws: respond: tangent: K is 5000.0 there and 2500.0 here"),
        ({"factor": 0.5}, 0.1, "stop", "respond: settings.FACTOR is 1.0 there and 0.5 here"),
        ({}, 0.2, "stop", "loads: amplitude: slope is 0.1 there and 0.2 here"),
        ({"weight": 2.0}, 0.1, "stop", r"amplitude: WEIGHT: first\[0\] is 1.0 there and 2.0 here"),
        ({"plus": "1 * t"}, 0.1, "stop", "amplitude: plus: its code: hash is '.*' there and '"),
        ({}, 0.1, "remove", "leaving is 'stop' there and 'remove' here"),
    ],
)
def test_a_run_is_not_resumed_with_other_values(tmp_path, monkeypatch, given, slope, leaving, said):
    """The message names the variable and both its values."""
    with pytest.raises(Killed):
        run(tmp_path, end=0.02, scene=scene(script(monkeypatch), 0.1), each=Kill(3), keep=1)
    with pytest.raises(tawami.CheckpointError, match=f"belongs to another run: .*{said}"):
        run(tmp_path, end=0.02, scene=scene(script(monkeypatch, **given), slope, leaving))
    kill = Kill()
    run(tmp_path, end=0.02, scene=scene(script(monkeypatch, other=3), 0.1), each=kill)
    assert kill.count == 2


# -- what is compared -------------------------------------------------------------


@dataclass
class Ramp:
    rate: float

    def __call__(self, t: float) -> float:
        return self.rate * t

    def later(self, t: float) -> float:
        return self(t) + 1


def stored(value):
    return json.loads(json.dumps(text(value)))


def different(one, other):
    """Names of the parts that differ, as they are after a checkpoint."""
    return [name for name, *_ in differences(stored(one), stored(other))]


def test_objects_methods_and_partial_functions_are_compared():
    assert different(Ramp(1.0), Ramp(1.0)) == different(Ramp(1.0).later, Ramp(1.0).later) == []
    assert different(Ramp(1.0), Ramp(2.0)) == ["Ramp: rate"]
    assert different(Ramp(1.0).later, Ramp(2.0).later) == ["later: self: rate"]
    one, other = (functools.partial(pow, exp=k) for k in (2, 3))
    assert different(one, other) == ["partial: partial: exp"]
    assert different(lambda t, k=1: k * t, lambda t, k=2: k * t) == ["a function: k="]
    assert different(lambda t, *, k=1: k * t, lambda t, *, k=2: k * t) == ["a function: k="]
    assert different(np.sin, np.sin) == []
    assert different(np.sin, np.cos) != []


def test_names_lines_and_comments_make_no_difference():
    def one(t):
        """A docstring."""
        return t * 2.0

    def other(time):
        # a comment
        return time * 2.0

    assert meaning(one) == meaning(other)


@pytest.mark.parametrize(
    ("value", "changed"),
    [
        (np.arange(1e4), np.where(np.arange(1e4) == 5000, 1.0, np.arange(1e4))),
        (np.array([1.0, np.nan]), np.array([1.0, np.inf])),
        (np.array([1, 2], dtype=np.int32), np.array([1, 2], dtype=np.int64)),
        (np.array([1j]), np.array([2j])),
        (np.array(["a"]), np.array(["b"])),
        ([0.5] * 1000, [0.5] * 999 + [0.25]),
        ({"E": [1, (2, 3)]}, {"E": [1, (2, 4)]}),
        ({"E": 1}, {"nu": 1}),
        ([1, 2], [1, 2, 3]),
        ({1, 2}, {1, 3}),
        ("a", "b"),
        (b"a", b"b"),
        (1.0, 1.0 + 1e-8),
        (True, False),
        (None, 0),
        (tawami.linear_elastic(E=1.0, nu=0.3), tawami.linear_elastic(E=2.0, nu=0.3)),
    ],
)
def test_values_of_every_kind_are_compared(value, changed):
    one, same, other = (json.loads(json.dumps(meaning(v))) for v in (value, value, changed))
    assert not list(differences(one, same))
    assert list(differences(one, other))
    assert not list(not_compared(one, same))


def test_the_scene_in_a_function_is_not_compared_again():
    """Its state changes in each step; its grid has a communicator."""
    names = {"respond": lambda strain, stress: (stress, strain), "made": lambda _: 1.0}
    made = scene(names, 0.0)
    before = stored(lambda t: made.num_particles * made.grid.h * t)
    made.particles.stress[:] = 1.0
    after = stored(lambda t: made.num_particles * made.grid.h * t)
    assert not [*differences(before, after), *not_compared(before, after)]
    coarse = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 4))
    facts = [stored(lambda t, grid=grid: grid.h * t) for grid in (made.grid, coarse)]
    assert list(differences(*facts))
    assert not list(not_compared(*facts))


def test_the_environment_and_loggers_make_no_difference(monkeypatch):
    log = logging.getLogger("tawami")

    def one(t):
        log.info("%s %s", os.environ, sys.argv)
        return np.pi * t

    before = stored(one)
    monkeypatch.setenv("ANOTHER", "1")
    monkeypatch.setattr(sys, "argv", ["another"])
    log.addHandler(handler := logging.NullHandler())
    after = stored(one)
    log.removeHandler(handler)
    assert not [*differences(before, after), *not_compared(before, after)]


def test_what_cannot_be_compared_is_named():
    file, loop = object(), []
    loop.append(loop)

    def reads(t):
        return file, loop, t

    facts = stored(reads)
    assert list(not_compared(facts, facts)) == ["reads: file (builtins.object)"]
    newer = json.loads(json.dumps(facts))
    newer["reads"][CODE] |= {PYTHON: "3.99", "hash": "another"}
    assert not list(differences(facts, newer))
    assert len(list(not_compared(facts, newer))) == 2


def test_a_run_that_cannot_be_compared_is_resumed_with_a_warning(tmp_path):
    def build():
        source = object()
        made = tawami.Scene(
            tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 4)),
            tawami.Body(np.array([[0.3, 0.3], [0.4, 0.4]]), np.full(2, 0.01)),
            tawami.linear_elastic(E=1e4, nu=0.3), form="u_finite", density=1.0,
        )  # fmt: skip
        made.gravity((0.0, -1.0), amplitude=lambda t: 1.0 if source else t)
        return made

    with pytest.raises(Killed):
        run(tmp_path, end=0.02, scene=build(), each=Kill(3))
    with pytest.warns(tawami.CheckpointWarning, match="amplitude|a function: source .builtins.obj"):
        run(tmp_path, end=0.02, scene=build())
