"""Runs with results that several test files start, interrupt and resume."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from tawami.motion.observer import Snapshot
from tawami.results.output import Output

ELASTIC = tawami.linear_elastic(E=1e5, nu=0.4)


class Killed(BaseException):
    """Ends a run as SIGKILL does: no handler of errors catches it."""


class Kill:
    """An `each` that raises an error in the given calls, counted over all runs."""

    def __init__(self, *calls: int, error: BaseException | None = None) -> None:
        self.calls, self.count, self.error = calls, 0, error or Killed()

    def __call__(self, _solution: tawami.Solution) -> None:
        self.count += 1
        if self.count in self.calls:
            raise self.error


class Recorder(Output):
    """An output that writes nothing but records every call."""

    def __init__(self, name: str = "recorder", phases: Any = None) -> None:
        super().__init__((), None, None, name, phases)
        self.began: list[tuple[str, object]] = []
        self.seen: list[tuple[float, int, bool]] = []

    def begin(self, folder, subject, state):
        self.began.append((folder.name, state))
        self.seen = [] if state is None else [tuple(one) for one in state["seen"]]

    def observe(self, moment):
        self.seen.append((moment.time, moment.step, moment.last))

    def state(self):
        return {"seen": self.seen}


def results_of(folder: Path, *outputs: Any, **options: Any) -> tawami.Results:
    """Results in a folder: resumed where they exist, a checkpoint every second step."""
    options = {"existing": "resume", "checkpoint_steps": 2} | options
    return tawami.Results(folder, *outputs, **options)


def block(**options: Any) -> tawami.Scene:
    """A block on a smooth floor under its weight."""
    options = {
        "h": 0.25, "E": 1e4, "density": 1000.0, "alpha": 0.01, "g": -9.81, "phi": None, "shift": 0.0
    } | options  # fmt: skip
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0, 0), h=options["h"], cells=(int(2 / options["h"]), 6)
    )
    body = tawami.box(grid, (0.5, 0), (1.0, 0.5), per_axis=2)
    if options["shift"]:
        body = replace(body, x=body.x + np.array([options["shift"], 0.0]), border=None)
    law = tawami.linear_elastic(E=options["E"], nu=0.4)
    if options["phi"] is not None:
        law = tawami.mohr_coulomb(law, phi=options["phi"])
    scene = tawami.Scene(
        grid, body, law, form="u_epsv_finite", density=options["density"], alpha=options["alpha"]
    )
    scene.fix("bottom", "y")
    scene.gravity((0.0, options["g"]))
    return scene


def plastic_block(**options: Any) -> tawami.Dynamics:
    """A plastic block that strikes a floor; its particles are in a random order."""
    grid, alone = (
        tawami.Grid(comm, origin=(-1.0, 0.5), h=0.25, cells=(6, 5))
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    body = tawami.box(alone, (-0.75, 0.5), (0.0, 1.25), per_axis=2)  # whole on every rank
    order = np.random.default_rng(0).permutation(len(body.x))
    body = tawami.Body(body.x[order], body.volume[order])
    steel = tawami.von_mises(
        tawami.linear_elastic(E=1e3, nu=0.3), yield_stress=20.0, hardening=10.0
    )
    scene = tawami.Scene(grid, body, steel, form="u_epsv_finite", density=1.0, **options)
    scene.fix("bottom", "y")
    scene.gravity((0.0, -10.0))
    return tawami.Dynamics(scene, velocity=(0.3, -1.5))


def run(
    folder: Path,
    *,
    end: float = 0.05,
    each: Any = None,
    velocity: tuple[float, float] = (1.0, 0.0),
    outputs: Any = (),
    scene: tawami.Scene | None = None,
    **options: Any,
) -> tuple[tawami.Dynamics, list[Any]]:
    """Move the block for ten steps, or resume that run; the motion and its steps."""
    motion = tawami.Dynamics(scene or block(), velocity=velocity)
    steps = motion.run(end, 0.005, results=results_of(folder, *outputs, **options), each=each)
    return motion, steps


def steps_in(path: Path) -> list[int]:
    """Numbers of the steps in a table."""
    return [int(line.split(",")[0]) for line in path.read_text().splitlines()[1:]]


def drive(motion, outputs, folder, steps, *, first=0, dt=0.004, states=None, seen=None):
    """Let outputs observe steps `first` to `steps` of a motion, the last as the end of its phase."""
    for k, output in enumerate(outputs):
        output.begin(folder, motion, None if states is None else states[k])
    for step in range(first, steps + 1):
        solution = None if step == 0 else motion.step(dt)
        if seen is not None:
            seen(motion, solution, step)
        for output in outputs:
            look(output, motion.scene, motion, solution, motion.time, step, last=step == steps)


def write_everything(folder: str | Path) -> None:
    """Write the plastic block's motion by every kind of output."""
    outputs = [
        tawami.ParticleOutput("number", "velocity", "plastic_strain", every_steps=4),
        tawami.GridOutput("velocity", "reaction", "stress", every_steps=4, projection="consistent"),
        tawami.GridOutput("mean stress", "particles", name="lumped"),
        tawami.TableOutput(
            "energies", "momentum", "run-out", "displacement (0.0, 1.25)", "particles"
        ),
    ]
    drive(plastic_block(), outputs, Path(folder), 12)


def look(output, scene, motion, solution, time, step, *, last):
    """Show an output the state after a step."""
    output.observe(Snapshot(motion or scene, solution, time, step, last))


def static_scene(form="u_epsv", **options) -> tawami.Scene:
    """A beam held on the left and at a point, under a traction on the right."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(8, 5))
    body = tawami.box(grid, (0.0, 0.0), (2.0, 1.0), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.3), form=form, **options)
    scene.fix("left", "x")
    scene.hold((0.0, 0.5), "y")
    scene.traction("right", (3.0, -1.0))
    return scene
