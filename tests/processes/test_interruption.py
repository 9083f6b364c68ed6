"""Ctrl-C at any line of a step: the state is that before the step or that after it, never between."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

import numpy as np
import pytest
from scenes import grid_of

import tawami
from tawami.base.signals import deferred

PACKAGE = os.path.dirname(tawami.__file__)


def falling(form: str) -> tawami.Dynamics:
    """A block that spins and falls on a wall, yields, and loses particles at an edge of the grid."""
    grid = grid_of((6, 4))
    body = tawami.box(grid, (0.5, 0.5), (2.0, 1.5), per_axis=2)
    law = tawami.von_mises(tawami.linear_elastic(E=1e4, nu=0.3), yield_stress=50.0)
    scene = tawami.Scene(grid, body, law, form=form, density=1000.0, leaving="remove")
    scene.gravity((0.0, -9.81))
    scene.wall("bottom", 0.3)
    centre = np.array([1.25, 1.0])
    motion = tawami.Dynamics(scene, velocity=(body.x - centre)[:, ::-1] * [-1, 1] + [8.0, -1.0])
    motion.step(0.01)
    return motion


def state(motion: tawami.Dynamics) -> dict[str, Any]:
    """Everything that a step changes."""
    scene, particles, energies = motion.scene, motion.scene.particles, motion.energies
    arrays = {
        name: getattr(particles, name)
        for name in ("x", "number", "stress", "displacement", "eps_v")
    }
    arrays |= {name: particles.history(name) for name in particles.history_names}
    arrays |= {
        name: particles.carried(name)
        for name in ("velocity", "acceleration", "velocity_gradient", "acceleration_gradient")
    }
    (wall,) = scene.configuration.supports.walls
    arrays |= {"touching": wall.state.touching, "slip": wall.state.slip}
    arrays["total"] = scene.configuration.total
    arrays["cell"] = scene.configuration.domain.location.cell
    balance = (energies.kinetic, energies.elastic, energies.dissipated, energies.left)
    carried = scene.configuration.loads.all[0].terms[0].share.carried
    arrays["numbers"] = [motion.time, motion.steps, *balance, len(scene.left), carried]
    return {name: np.array(values) for name, values in arrays.items()}


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in one)


def traced(run: Callable[[], object], at: int) -> int:
    """Run, with Ctrl-C at one line of the package; the number of lines that were run.

    Args:
        run: Command of the run.
        at: Number of the line that Ctrl-C arrives at, counted as lines are run.
    """
    lines = 0

    def local(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal lines
        if event == "line":
            lines += 1
            if lines == at:
                signal.raise_signal(signal.SIGINT)
        return local

    def tracer(frame: FrameType, *_: Any) -> Any:
        # Python ignores exceptions in destructors, which petsc.py frees its objects in
        name = frame.f_code.co_filename
        return local if name.startswith(PACKAGE) and not name.endswith("petsc.py") else None

    before = sys.gettrace()
    sys.settrace(tracer)
    try:
        run()
    finally:
        sys.settrace(before)
    return lines


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_an_interrupted_step_is_complete_or_undone(form):
    motion = falling(form)
    before = state(motion)
    lines = traced(lambda: motion.step(0.01), 0)
    after = state(motion)
    assert not same(before, after)
    if form.endswith("finite"):
        assert len(after["x"]) < len(before["x"])
    seen = {"before": 0, "after": 0}
    # everywhere, and at more lines near the end, where the step is stored
    for at in sorted(
        {*range(1, lines, lines // 8), *range(lines // 2, lines, max(lines // 30, 1))}
    ):
        motion = falling(form)
        try:
            traced(lambda motion=motion: motion.step(0.01), at)
        except KeyboardInterrupt:
            now = state(motion)
            which = "before" if same(now, before) else "after"
            assert same(now, before if which == "before" else after), f"line {at} of {lines}"
            seen[which] += 1
            if which == "before":  # and the step can be taken again
                motion.step(0.01)
                np.testing.assert_allclose(motion.scene.particles.x, after["x"], atol=1e-5)
    assert min(seen.values()) > 0, seen


def test_a_deferred_signal_waits_for_the_end_of_the_block():
    said = []

    def twice() -> None:
        with deferred():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            said.append("done")

    with pytest.raises(KeyboardInterrupt):
        twice()
    assert said == ["done"]
    with pytest.raises(KeyboardInterrupt):  # the handler is restored
        signal.raise_signal(signal.SIGINT)


def test_other_threads_leave_the_handlers_alone():
    handler, seen = signal.getsignal(signal.SIGINT), []

    def look() -> None:
        with deferred():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert seen == [handler]
