"""Error estimates without a reference, compared with the closed forms of cases; no limit is found."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from cases.costs.trade import coverage
from tawami.study import process
from tawami.study.adjoint import combined
from tawami.study.estimate import estimate
from tawami.study.knobs import Knob


@pytest.mark.parametrize(
    ("scene", "knobs"),
    [
        ("beam", [Knob("n", (4, 8, 16), 8), Knob("particles", (2, 3), 3)]),
        ("column", [Knob("h", (5.0, 2.5, 1.25, 0.625), 1.25), Knob("increments", (5, 10), 5)]),
    ],
)
def test_error_bars_cover_the_true_error(scene, knobs):
    function, exact = coverage.SCENES[scene]
    names = [knob.name for knob in knobs]
    points, errors = {}, {}
    for setting in itertools.product(*(knob.values for knob in knobs)):
        values, estimated = process.evaluated(function(**dict(zip(names, setting, strict=True))))
        (points[setting],) = values.values()
        if estimated:
            (errors[setting],) = estimated.values()
    refined = estimate("value", knobs, points)
    found = combined("value", knobs, refined, points, errors)
    assert (found.uncertainty < 0.5 * refined.uncertainty) == bool(errors)
    covered = [
        abs(abs(value - exact) - abs(value - found.value)) <= found.uncertainty
        for value in points.values()
    ]
    assert np.mean(covered) >= 0.9
    assert found.uncertainty < 5e-3 * abs(exact)


def test_the_support_of_the_paper_has_no_limit():
    knob = Knob("n", (4, 8, 16, 32), 8)
    runs = {(n,): process.evaluated(coverage.paper(n, particles=2)) for n in knob.values}
    points = {setting: values["tip"] for setting, (values, _) in runs.items()}
    errors = {setting: estimated["tip"] for setting, (_, estimated) in runs.items()}
    found = combined("tip", [knob], estimate("tip", [knob], points), points, errors)
    assert found.uncertainty == math.inf
    assert "'tip' does not converge with 'n'" in found.remarks[0]
