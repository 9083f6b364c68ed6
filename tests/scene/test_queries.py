"""Queries change nothing: a run that prints everything ends with the same bits as one that does not."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.conditions import constraints

ELASTIC = tawami.linear_elastic(E=1e5, nu=0.3)
PLASTIC = tawami.von_mises(ELASTIC, yield_stress=2e3)


def falling(form, law):
    """A block that slides and lifts off on a wall, is held at a point and loaded."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(10, 8))
    body = tawami.box(grid, (0.75, 0.0), (1.25, 0.5), per_axis=2)
    scene = tawami.Scene(grid, body, law, form=form, density=1000.0)
    handles = [
        scene.gravity((2.0, -9.81), amplitude=lambda t: np.cos(90 * t)),
        scene.wall("bottom", 0.3),
        scene.wall("right", 0.0),
        scene.hold((1.0, 0.4), "x", velocity=lambda t: 0.1),
        scene.load([3, 4], (1.0, 0.0)),
        scene.traction("bottom", (1.0, lambda x, y: x)),
    ]
    return tawami.Dynamics(scene, velocity=(0.5, 0.0)), handles


def asked(thing, depth=0):
    """The text of an object, and of what its attributes and queries hold."""
    texts = [repr(thing), str(thing)]
    for name in sorted(dir(thing)):
        if name.startswith("_") or depth > 1:
            continue
        try:
            value = getattr(thing, name)
        except tawami.TawamiError as error:
            texts.append(f"{error}")
            continue
        if not callable(value):
            texts.append(f"{value}")
            if type(value).__module__.startswith("tawami.scene"):
                texts += asked(value, depth + 1)
    return texts


def look(motion, handles, solution):
    """Ask for everything that a script can print."""
    scene = motion.scene
    for thing in (scene, motion, solution, *handles, scene.configuration, scene.grid):
        asked(thing)
    motion.header()
    scene.header()
    scene.identity()
    motion.state()
    motion.angular_momentum()
    scene.split(scene.configuration.total)
    for place in ("bottom", "right", (1.0, 0.4)):
        solution.reaction(place)
    solution.displacement((1.0, 0.4))
    constraints.num_free(scene.configuration.supports, scene.configuration.domain)


def texts_of(value):
    return repr(
        {k: texts_of(v) for k, v in value.items()} if isinstance(value, dict)
        else [texts_of(v) for v in value] if isinstance(value, list | tuple)
        else value.tobytes() if isinstance(value, np.ndarray) else value
    )  # fmt: skip


@pytest.mark.parametrize("form", ["u_epsv_finite", "u_epsv"])
def test_queries_change_nothing(form):
    ends = []
    for asks in (False, True):
        motion, handles = falling(form, PLASTIC)
        for step in range(5):
            solution = motion.step(0.008)
            if asks and step in (0, 3):
                before = texts_of(motion.state())
                look(motion, handles, solution)
                assert texts_of(motion.state()) == before
        ends.append(texts_of(motion.state()))
    assert ends[0] == ends[1]


def test_queries_change_nothing_in_statics():
    ends = []
    for asks in (False, True):
        motion, handles = falling("u_epsv", ELASTIC)
        scene = motion.scene
        handles[3].release()
        scene.hold((1.0, 0.4), "x", 1e-4)
        scene.hold((0.8, 0.4), "x", 1e-4)

        def see(solution, asks=asks, motion=motion, handles=handles):
            if asks:
                look(motion, handles, solution)
                motion.scene.reduction()
                motion.scene.residual(np.zeros(motion.scene.num_coefficients))
                motion.scene.tangent(np.zeros(motion.scene.num_coefficients))

        tawami.ramp(scene, 0.25, each=see)
        handles[4].release()
        tawami.ramp(scene, 0.5, each=see)
        ends.append(texts_of(scene.state()))
    assert ends[0] == ends[1]
