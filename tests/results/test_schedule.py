"""When outputs write: by time, by number of steps, and at the end of a phase."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from runs import look, plastic_block

import tawami
from tawami.results.output import Output


class Times(Output):
    """An output that writes nothing but records the times at which it would."""

    def __init__(self, **when):
        super().__init__((), when.get("every"), when.get("every_steps"), "times")
        self.times = []

    def _resolve(self, subject):
        pass

    def _open(self, folder, last, subject):
        pass

    def _write(self, moment, size):
        self.times.append(moment.time)


@pytest.fixture(scope="module")
def scene():
    return plastic_block().scene


def observed(output, scene, times, state=None, first=0):
    """Show an output the steps at these times, the last as the end of its phase."""
    output.begin(Path(), scene, state)
    for step in range(first, len(times)):
        look(output, scene, None, None, times[step], step, last=step == len(times) - 1)


@given(
    every=st.sampled_from([0.1, 0.25, 1.0, 3.0]),
    sizes=st.lists(st.sampled_from([0.1, 0.05, 1 / 3, 0.7, 2.0]), min_size=1, max_size=40),
    cut=st.integers(0, 40),
)
def test_the_first_step_at_or_after_each_multiple_is_written(scene, every, sizes, cut):
    """Also where the run is interrupted after some step and resumed."""
    times = [0.0, *np.cumsum(sizes)]
    wanted = {0.0, times[-1]}
    for multiple in np.arange(1, times[-1] / every + 1) * every:
        wanted |= set([t for t in times if t > multiple - 1e-9][:1])
    whole, cut = Times(every=every), min(cut, len(sizes))
    observed(whole, scene, times)
    assert whole.times == sorted(wanted)
    first, second = Times(every=every), Times(every=every)
    first.begin(Path(), scene, None)
    for step in range(cut + 1):
        look(first, scene, None, None, times[step], step, last=False)
    observed(second, scene, times, json.loads(json.dumps(first.state())), first=cut)
    assert sorted(first.times + second.times) == sorted(wanted)


def test_every_third_step_and_the_last_are_written(scene):
    times = [0.1 * k for k in range(8)]
    for when, steps in (({"every_steps": 3}, [0, 3, 6, 7]), ({}, range(8))):
        output = Times(**when)
        observed(output, scene, times)
        assert output.times == [times[k] for k in steps]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tawami.ParticleOutput(every=0.0), r"every = 0.0: expected a finite number above 0"),
        (lambda: tawami.ParticleOutput(every_steps=0), r"every_steps = 0: expected a whole number, at"),
        (lambda: tawami.TableOutput(every=1.0, every_steps=1), "both given: expected one of them"),
        (lambda: tawami.GridOutput(projection="l2"), "projection = 'l2': expected 'lumped' or '"),
        (lambda: tawami.TableOutput(3), r"TableOutput\(..., 3, ...\): expected names of quantities"),
        (lambda: tawami.TableOutput(name="a/b"), "name = 'a/b': expected the name of a file without"),
    ],
)  # fmt: skip
def test_wrong_options_of_outputs_are_rejected(make, message):
    with pytest.raises(tawami.InputError, match=message):
        make()
