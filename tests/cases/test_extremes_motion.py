"""Extremes of motion, the short forms of `cases.extremes`: no wrong result, rejections explained."""

from __future__ import annotations

import re
from typing import Any

import pytest
from petsc4py import PETSc

from cases.extremes import (
    corruption,
    density,
    departure,
    endurance,
    friction_angle,
    impact,
    rotation,
    stretch,
    sudden_load,
    time_step,
)
from cases.extremes.attempt import attempted

#: Patterns of the settings that must be rejected, and of their messages; all others must survive.
REFUSED: dict[Any, dict[str, str]] = {
    time_step: {},
    density: {"free fall, 1e-09 kg/m3": "Newton did not converge in 20 iterations"},
    stretch: {
        "to 2, hanging": "Newton did not converge .* at 0.0.* of the load",
        "greatest load": "Newton did not converge .* at 0.[89].* of the load|tangent is singular",
    },
    rotation: {},
    friction_angle: {" 0 degrees": "c = 0: expected a positive cohesion where phi = 0"},
    impact: {"10 of the waves": "Newton did not converge .* smallest step|would leave the grid"},
    sudden_load: {
        "dynamic, 1000 times": "particle 7 would leave the grid at 0.0125 s",
        "ramp, 1000 times": "inside out .* at 0.00[67].* of the load, with the smallest step of",
    },
    corruption: {
        "NaN in (x|volume|stress|displacement|eps_v|velocity|acceleration|velocity_gradient|"
        "acceleration_gradient|plastic_strain|dilatancy)$":
            r": 1 entries are not finite; the first is NaN at particle 37",
        "(NaN|infinity|0|-1) as dt": "dt = .*: expected a finite number of at least 1e-100",
        " as end": "end = ",
        " as gravity": r"gravity\[1\] = .*: expected a finite number",
        " as load": r"load\(...\): force\[0\] = ",
        " as traction": r"traction\('top'\): .* expected a finite number",
        " as velocity of a support": r"fix\('left'\): velocity at .* expected a finite number",
        " as velocity at the start": r"velocity of particle 0 is .* expected finite numbers",
    },
    departure: {
        "(0.7|3) cells a step, stop": r"particle \d+ would leave the grid at \d s, .*others with it",
        "1000 cells a step, stop": "and 199 others with it",
        "1000 cells a step, remove": "the last particle would leave the grid",
    },
    endurance: {},
}  # fmt: skip


SHORT = (sudden_load, corruption, departure)


@pytest.mark.parametrize(
    "subject",
    [pytest.param(s, marks=[] if s in SHORT else pytest.mark.slow) for s in REFUSED],
    ids=[subject.__name__.rsplit(".")[-1] for subject in REFUSED],
)
def test_extremes_survive_or_are_rejected(subject):
    expected, seen = REFUSED[subject], set()
    for row in subject.attempts(short=True):
        place = f"{row.setting}: {row.error} of {row.bound}, {row.says}"
        assert row.outcome != "WRONG", place
        words = [key for key in expected if re.search(key, row.setting)]
        # of the nearly incompressible columns that hang, only the stretched ones must be refused
        if subject is stretch and "hanging" in row.setting and "0.4999" not in row.setting:
            words = []
        if not words:
            assert row.outcome == "survived", place
            continue
        seen.update(words)
        assert row.outcome == "refused", place
        assert re.search(expected[words[0]], row.says), place
    assert seen == set(expected)


def test_objects_of_petsc_are_counted():
    before = endurance.objects()
    hidden = before == endurance.HIDDEN
    assert not hidden or PETSc.Sys.getVersion() >= (3, 23)
    vectors = [PETSc.Vec().createMPI((3, PETSc.DETERMINE)) for _ in range(3)]
    assert endurance.objects() == (before if hidden else before + 3)
    for vector in vectors:
        vector.destroy()
    assert endurance.objects() == before


def test_wrong_results_are_found():
    """A result beyond its bound, NaN, a result instead of a rejection, an error without a message."""

    def fails():
        raise ZeroDivisionError("division by zero")

    assert attempted("", "", 1.0, lambda: 1.0).outcome == "survived"
    assert attempted("", "", 1.0, lambda: 1.1).outcome == "WRONG"
    assert attempted("", "", 1.0, lambda: float("nan")).outcome == "WRONG"
    assert attempted("", "", None, lambda: 0.0).outcome == "WRONG"
    assert attempted("", "", 1.0, fails).says == "ZeroDivisionError: division by zero"
