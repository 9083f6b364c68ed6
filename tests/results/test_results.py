"""Runs that are stopped and gone on with; checkpoints that are damaged or foreign; log and live line."""

from __future__ import annotations

import errno
import io
import json
import logging
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from programs import small_files

import tawami
from tawami.base import archive
from tawami.base.ranks import mpirun
from tawami.results import phase as phase_module
from tawami.results import progress
from tawami.results.output import Output

ROOT = Path(__file__).parents[2]
ELASTIC = tawami.linear_elastic(E=1e5, nu=0.4)
LAWS = {
    "elastic": ELASTIC,
    "von Mises": tawami.von_mises(ELASTIC, yield_stress=4e3, hardening=1e4),
    "Mohr-Coulomb": tawami.mohr_coulomb(ELASTIC, phi=30.0, c=1e3),
}


class Killed(BaseException):
    """What no handler of errors catches."""


class Kill:
    """Ends a run at the given calls, counted over all runs."""

    def __init__(self, *calls: int, error: BaseException | None = None) -> None:
        self.calls, self.count, self.error = calls, 0, error or Killed()

    def __call__(self, _solution: tawami.Solution) -> None:
        self.count += 1
        if self.count in self.calls:
            raise self.error


class Recorder(Output):
    """What outputs are told."""

    def __init__(self, name="recorder", phases=None) -> None:
        super().__init__((), None, None, name, phases)
        self.began: list[tuple[str, object]] = []
        self.seen: list[tuple[float, int, bool]] = []

    def begin(self, folder, subject, state):
        self.began.append((folder.name, state))
        self.seen = [] if state is None else [tuple(one) for one in state["seen"]]

    def look(self, moment):
        self.seen.append((moment.time, moment.step, moment.last))

    def state(self):
        return {"seen": self.seen}


def drive(folder, results, *, form, law, transfer, leaving, each):
    """A block, loaded in a ramp and settled where it can, falls on a rough wall; all there is of it."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.125, cells=(16, 10))
    body = tawami.box(grid, (-0.25, -1.0), (0.25, -0.5))
    scene = tawami.Scene(
        grid, body, LAWS[law], form=form, density=1000.0, leaving=leaving, alpha=0.01
    )
    finite = form.endswith("finite")
    scene.fix("bottom", "y")
    scene.fix("bottom", "x")
    scene.gravity((0.0, -9.81))
    steps = [tawami.ramp(scene, 0.3, results=results, each=each)]
    scene.load(scene.particles.x[:, 1] > -0.6, (0.0, -20.0))  # where they are after the ramp
    if finite:
        scene.hold((0.0, -0.75), "x", 1e-3)
        steps.append(tawami.ramp(scene, 0.5, results=results, each=each))
        scene.release((0.0, -0.75))
    scene.release("bottom")
    scene.wall("bottom", 0.3)
    if not finite:
        scene.hold((0.0, -0.75), "x", velocity=lambda t: 0.02 * t)
    motion = tawami.Dynamics(scene, velocity=(0.3, 0.0), transfer=transfer, gamma=0.6)
    scene.particles.displacement[:, 0] += 1e-7  # between two phases
    steps.append(motion.run(0.05, 0.004, results=results, each=each))
    steps.append(motion.run(0.08, 0.005, results=results, each=each))
    return {
        "rows": scene.particles.rows(),
        "energies": str(motion.energies),
        "time": (motion.time, motion.steps),
        "steps": steps,
        "left": scene.left,
    }


VARIANTS = [
    ("u_epsv", "elastic", "affine_flip", (2, 9, 17)),
    ("u_epsv_finite", "elastic", "affine_flip", (3, 6, 12)),
    ("u_epsv_finite", "Mohr-Coulomb", "apic", (11, 20)),
    ("u_epsv_finite", "von Mises", "flip", (1, 2, 21)),
]


@pytest.mark.parametrize(("form", "law", "transfer", "kills"), VARIANTS)
def test_a_killed_run_goes_on_to_the_bit(tmp_path, form, law, transfer, kills):
    options = {"form": form, "law": law, "transfer": transfer, "leaving": "stop"}
    recorders = {name: Recorder() for name in ("whole", "killed")}
    whole = drive(
        tmp_path,
        tawami.Results(tmp_path / "whole", recorders["whole"], checkpoint_steps=2),
        each=None,
        **options,
    )
    kill, attempts = Kill(*kills), 0
    while True:
        attempts += 1
        results = tawami.Results(
            tmp_path / "killed", recorders["killed"], checkpoint_steps=2, existing="resume"
        )
        try:
            found = drive(tmp_path, results, each=kill, **options)
            break
        except Killed:
            continue
    assert attempts == len(kills) + 1
    assert found.pop("rows").tobytes() == whole.pop("rows").tobytes()
    assert found == whole
    reused = any(step.krylov[0] > 0 for step in whole["steps"][-1])
    assert reused == (form == "u_epsv")  # a factorisation of an earlier step
    assert recorders["killed"].seen == recorders["whole"].seen
    # once more: nothing is solved, the end is loaded
    again = drive(tmp_path, results_of(tmp_path / "killed"), each=Kill(1), **options)
    assert again.pop("rows").tobytes() != b""
    assert again == found


def results_of(folder, *outputs, **options):
    options = {"existing": "resume", "checkpoint_steps": 2} | options
    return tawami.Results(folder, *outputs, **options)


def block(**options):
    """A block on the floor under its weight, that is to be set in motion."""
    options = {
        "h": 0.25, "E": 1e4, "density": 1000.0, "alpha": 0.01, "g": -9.81, "phi": None, "shift": 0.0
    } | options  # fmt: skip
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0, 0), h=options["h"], cells=(int(2 / options["h"]), 6)
    )
    body = tawami.box(grid, (0.5, 0), (1.0, 0.5))
    body.x[:, 0] += options["shift"]
    law = tawami.linear_elastic(E=options["E"], nu=0.4)
    if options["phi"] is not None:
        law = tawami.mohr_coulomb(law, phi=options["phi"])
    scene = tawami.Scene(
        grid, body, law, form="u_epsv_finite", density=options["density"], alpha=options["alpha"]
    )
    scene.fix("bottom", "y")
    scene.gravity((0.0, options["g"]))
    return scene


def run(folder, *, end=0.05, each=None, velocity=(1.0, 0.0), outputs=(), scene=None, **options):
    motion = tawami.Dynamics(scene or block(), velocity=velocity)
    steps = motion.run(end, 0.005, results=results_of(folder, *outputs, **options), each=each)
    return motion, steps


@pytest.fixture
def stopped(tmp_path):
    """The folder of a run that was killed in its eighth step, checkpoints after the fourth and sixth."""
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(8))
    names = [path.name for path in results_of(tmp_path / "run").checkpoints]
    assert names == ["01-motion-00000004.npz", "01-motion-00000006.npz"]
    return tmp_path / "run"


def test_a_later_end_goes_on_from_the_old_one(tmp_path):
    run(tmp_path / "run")
    kill = Kill()
    motion, steps = run(tmp_path / "run", end=0.07, each=kill)
    assert kill.count == 4  # of 14 steps
    assert len(steps) == 14
    whole, _ = run(tmp_path / "whole", end=0.07)
    assert motion.scene.particles.x == pytest.approx(np.array(whole.scene.particles.x), abs=1e-12)


def test_an_extended_run_that_is_killed_goes_on_from_its_newest_state(tmp_path):
    run(tmp_path / "run", end=0.02)
    with pytest.raises(Killed):
        run(tmp_path / "run", end=0.05, each=Kill(5))  # in the ninth step of all
    kill = Kill()
    run(tmp_path / "run", end=0.05, each=kill)
    assert kill.count == 2
    assert np.array_equal(
        tawami.earlier(tmp_path / "run").x, run(tmp_path / "run")[0].scene.particles.x
    )


def test_an_error_before_the_first_step_changes_nothing(stopped):
    before = {path: path.read_bytes() for path in stopped.rglob("*.npz")}
    with pytest.raises(tawami.InputError, match="'pressure' is unknown"):
        run(stopped, outputs=[tawami.ParticleOutput("pressure")])
    assert {path: path.read_bytes() for path in stopped.rglob("*.npz")} == before
    kill = Kill()
    run(stopped, each=kill)
    assert kill.count == 4


def test_a_mistake_in_the_outputs_can_be_mended_and_the_script_run_again(tmp_path):
    with pytest.raises(tawami.InputError, match="'velocty' is unknown"):
        run(tmp_path / "run", outputs=[tawami.ParticleOutput("velocty")], existing="stop")
    kill = Kill()
    run(
        tmp_path / "run",
        outputs=[tawami.ParticleOutput("velocity")],
        existing="stop",
        each=kill,
    )
    assert kill.count == 10


def test_other_outputs_begin_where_the_run_goes_on(tmp_path):
    """Outputs find their own state by their names."""
    first = [tawami.TableOutput("energies"), tawami.ParticleOutput("velocity")]
    with pytest.raises(Killed):
        run(tmp_path / "run", outputs=first, each=Kill(6))
    then = [tawami.ParticleOutput("velocity"), tawami.TableOutput("energies"),
            tawami.TableOutput("run-out", name="front")]  # fmt: skip
    run(tmp_path / "run", outputs=then)
    folder = tmp_path / "run" / "motion"
    assert steps_in(folder / "table.csv") == list(range(11))
    assert steps_in(folder / "front.csv") == list(range(5, 11))
    assert len(list((folder / "particles").glob("*.vtu"))) == 11


def steps_in(path):
    return [int(line.split(",")[0]) for line in path.read_text().splitlines()[1:]]


def test_what_a_driver_raises_leaves_no_hole_in_the_outputs(tmp_path):
    table = tawami.TableOutput("energies")
    for number in (3, 10):
        kill = Kill(number, error=tawami.InputError("no"))
        with pytest.raises(tawami.InputError):
            run(tmp_path / str(number), outputs=[table], each=kill)
        run(tmp_path / str(number), outputs=[tawami.TableOutput("energies")])
        folder = tmp_path / str(number) / "motion"
        assert steps_in(folder / "table.csv") == list(range(11))


def test_an_output_that_fails_leaves_no_hole(tmp_path):
    class Failing(Recorder):
        def look(self, moment):
            if moment.step == 5:
                raise tawami.OutputError("full")
            super().look(moment)

    with pytest.raises(tawami.OutputError):
        run(tmp_path / "run", outputs=[tawami.TableOutput("energies"), Failing()])
    run(tmp_path / "run", outputs=[tawami.TableOutput("energies"), Recorder()])
    assert steps_in(tmp_path / "run" / "motion" / "table.csv") == list(range(11))


def test_replacing_removes_nothing_but_what_a_run_wrote(stopped, tmp_path):
    for name in ("motion-analysis", "ramps"):
        (stopped / name).mkdir()
    (stopped / "motion-energy.png").write_text("")
    run(stopped, existing="replace")
    assert (stopped / "motion-energy.png").exists()
    assert (stopped / "motion-analysis").is_dir()
    other = tmp_path / "mine"
    other.mkdir()
    (other / "script.py").write_text("mine")
    with pytest.raises(tawami.InputError, match="holds 'script.py', which is of no run"):
        run(other, existing="replace")
    assert (other / "script.py").read_text() == "mine"


def test_a_finished_run_without_checkpoints_is_not_begun_anew(tmp_path):
    run(tmp_path / "run", outputs=[tawami.TableOutput("energies")])
    for path in results_of(tmp_path / "run").checkpoints:
        path.unlink()
    with pytest.raises(tawami.InputError, match="finished motion, and no checkpoint to go on from"):
        run(tmp_path / "run")
    assert steps_in(tmp_path / "run" / "motion" / "table.csv") == list(range(11))


def test_gravity_that_changes_on_the_way_is_part_of_the_state(tmp_path):
    def driven(folder, each):
        scene = block()
        motion = tawami.Dynamics(scene, velocity=(1.0, 0.0))

        def turned(solution):
            if motion.steps == 3:
                scene.gravity((0.0, 5.0))
            if each is not None:
                each(solution)

        motion.run(0.05, 0.005, results=results_of(folder), each=turned)
        return scene.particles.rows()

    with pytest.raises(Killed):
        driven(tmp_path / "run", Kill(6))
    whole = driven(tmp_path / "whole", None)
    assert driven(tmp_path / "run", None).tobytes() == whole.tobytes()


def test_loads_that_come_on_the_way_are_refused_in_a_sentence(tmp_path):
    def driven(each):
        scene = block()
        motion = tawami.Dynamics(scene)

        def loaded(solution):
            if motion.steps == 3:
                scene.load([0], (0.0, -1.0))
            each(solution)

        motion.run(0.05, 0.005, results=results_of(tmp_path / "run"), each=loaded)

    with pytest.raises(Killed):
        driven(Kill(6))
    with pytest.raises(tawami.CheckpointError, match="1 loads of a kind .* the script has made 0"):
        driven(Kill())


def test_a_failure_that_the_script_expects_does_not_cost_what_comes_after(tmp_path):
    """A limit load: the ramp fails, the motion begins from there and is killed."""

    def driven(each):
        scene = block()
        scene.fix("bottom", "x")
        scene.load([0], (0.0, -4e4))
        results = results_of(tmp_path / "run")
        with pytest.raises(tawami.ConvergenceError):
            tawami.ramp(scene, 0.1, smallest=0.03, results=results)
        motion = tawami.Dynamics(scene)
        motion.run(0.005, 0.0005, results=results, each=each)

    with pytest.raises(Killed):
        driven(Kill(8))
    kill = Kill()
    driven(kill)
    assert kill.count == 4


def test_a_shorter_step_is_taken_where_the_run_goes_on(stopped):
    motion = tawami.Dynamics(block(), velocity=(1.0, 0.0))
    steps = motion.run(0.05, 0.0025, results=results_of(stopped))
    assert [step.size for step in steps[6:]] == pytest.approx([0.0025] * 8)


def test_a_signal_in_the_end_of_a_phase_is_not_lost(tmp_path, monkeypatch):
    write = archive.write

    def signalled(*arguments):
        write(*arguments)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(phase_module.archive, "write", signalled)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "run", checkpoint_steps=None)


def test_iterations_may_be_more_in_a_run_that_goes_on(stopped):
    scene = block()
    scene.numerics = replace(scene.numerics, max_iterations=30, factorise="always")
    kill = Kill()
    run(stopped, scene=scene, each=kill)
    assert kill.count == 4


def test_a_terminal_that_is_gone_does_not_end_a_run(tmp_path, monkeypatch):
    class Gone(Terminal):
        def write(self, text):
            raise OSError(errno.EIO, "gone")

    monkeypatch.setattr(sys, "stderr", Gone())
    motion, _ = run(tmp_path / "run")
    assert motion.time == pytest.approx(0.05)


def test_settling_that_takes_too_long_can_be_gone_on_with(tmp_path):
    def settled(most):
        return tawami.settle(block_held(), max_resets=most, results=results_of(tmp_path / "run"))

    with pytest.raises(tawami.ConvergenceError):
        settled(2)
    assert len(settled(50)) == len(tawami.settle(block_held(), max_resets=50))


def block_held():
    scene = block()
    scene.fix("bottom", "x")
    return scene


def test_a_damaged_checkpoint_is_refused_and_the_one_before_it_used(stopped):
    newest = results_of(stopped).checkpoints[-1]
    newest.write_bytes(newest.read_bytes()[:-300])  # half written
    kill = Kill()
    with pytest.warns(tawami.CheckpointWarning, match="it is damaged") as warned:
        run(stopped, each=kill)
    assert newest.name in str(warned[0].message)
    assert kill.count == 6  # from the fourth step


def test_without_any_good_checkpoint_nothing_is_solved(stopped):
    for path in results_of(stopped).checkpoints:
        path.write_bytes(b"PK")
    kill = Kill(1)
    with (
        pytest.warns(tawami.CheckpointWarning),
        pytest.raises(tawami.CheckpointError, match="No other checkpoint of 'motion' can be used"),
    ):
        run(stopped, each=kill)


@given(st.data())
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_damage_to_a_file_is_missed(tmp_path, data):
    path = tmp_path / "state.npz"
    state = {"a": np.arange(30.0), "b": [1, {"c": np.array([[np.nan, -0.0]])}], "d": None, "e": 0.1}
    archive.write(path, {"run": 1}, state)
    whole = path.read_bytes()
    assert str(archive.read(path, {"run": 1})) == str(state)
    if data.draw(st.booleans()):
        damaged = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        at = data.draw(st.integers(0, len(whole) - 1))
        flipped = whole[at] ^ data.draw(st.integers(1, 255))
        damaged = whole[:at] + bytes([flipped]) + whole[at + 1 :]
    path.write_bytes(damaged)
    try:
        found = archive.read(path, {"run": 1})
    except tawami.CheckpointError:
        return
    assert str(found) == str(state)  # a date, or another byte that means nothing


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"h": 0.125}, "grid"),
        ({"E": 2e4}, "laws"),
        ({"phi": 30.0}, "laws"),
        ({"density": 900.0}, "density"),
        ({"alpha": 0.02}, "parameters"),
        ({"g": -9.8}, "loads"),
        ({"shift": 0.01}, "'x' of the particles at its start"),
    ],
)
def test_a_checkpoint_of_another_run_is_refused(stopped, changed, named):
    with (
        pytest.warns(tawami.CheckpointWarning, match="is of another run"),
        pytest.raises(tawami.CheckpointError, match=named),
    ):
        run(stopped, scene=block(**changed))


def test_another_motion_is_refused_too(stopped):
    with (
        pytest.warns(tawami.CheckpointWarning),
        pytest.raises(tawami.CheckpointError, match="'velocity' of the particles at its start"),
    ):
        run(stopped, velocity=(1.1, 0.0))


def test_a_file_of_another_format_is_refused(stopped):
    path = results_of(stopped).checkpoints[-1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(archive, "FORMAT", 99)
        archive.write(path, {}, {})
    with pytest.warns(tawami.CheckpointWarning, match="format 99: this version of tawami reads"):
        run(stopped)


def test_a_folder_with_a_run_is_not_written_over(stopped):
    (stopped / "mine.txt").write_text("mine")
    with pytest.raises(tawami.InputError, match="holds a run, last checkpoint '01-motion-0") as no:
        run(stopped, existing="stop")
    assert "existing='resume'" in str(no.value)
    kill = Kill()
    run(stopped, existing="replace", each=kill)
    assert kill.count == 10
    assert (stopped / "mine.txt").read_text() == "mine"


def test_the_environment_takes_precedence(stopped, monkeypatch):
    monkeypatch.setenv("TAWAMI_EXISTING", "resume")
    kill = Kill()
    run(stopped, existing="stop", each=kill)
    assert kill.count == 4
    monkeypatch.setenv("TAWAMI_EXISTING", "again")
    with pytest.raises(
        tawami.InputError, match="TAWAMI_EXISTING = 'again': expected one of 'stop'"
    ):
        results_of(stopped)


def test_a_step_that_fails_leaves_a_checkpoint(tmp_path):
    """At the smallest step, and in what the driver does after a step."""
    with pytest.raises(tawami.InputError) as error:
        run(tmp_path / "a", each=Kill(3, error=tawami.InputError("no")), checkpoint_steps=None)
    assert "the state after the last accepted step, at 0.015 s" in error.value.__notes__[0]
    kill = Kill()
    run(tmp_path / "a", each=kill)
    assert kill.count == 7
    scene = block()
    scene.fix("bottom", "x")
    scene.load([0], (0.0, -1e9))
    with pytest.raises(tawami.TawamiError):
        tawami.ramp(scene, 0.01, smallest=0.004, results=results_of(tmp_path / "b"))
    log = (tmp_path / "b" / "log.txt").read_text()
    assert "failed, now 0.005" in log
    assert "ramp ended by" in log


def test_a_ramp_that_failed_goes_on_where_it_was(tmp_path):
    def loaded(each, size):
        scene = block()
        scene.fix("bottom", "x")
        steps = tawami.ramp(scene, size, results=results_of(tmp_path / "run"), each=each)
        return scene, steps

    with pytest.raises(tawami.InputError):
        loaded(Kill(3, error=tawami.InputError("no")), 0.125)
    scene, steps = loaded(None, 0.125)
    assert [step.end for step in steps] == [0.125 * k for k in range(1, 9)]
    weight = scene.solve().reaction("bottom")[1]
    assert weight == pytest.approx(0.25 * 1000 * 9.81, rel=1e-4)


def test_checkpoints_by_the_clock(tmp_path, monkeypatch):
    """Three seconds a step on this clock: every five steps a quarter of a minute has gone by."""
    clock = iter(np.arange(0.0, 1e4, 1.5))
    monkeypatch.setattr(phase_module, "monotonic", lambda: next(clock))
    written = []
    monkeypatch.setattr(phase_module.archive, "write", lambda path, *_: written.append(path.name))
    run(tmp_path / "run", checkpoint_steps=None, checkpoint_minutes=0.2)
    assert 2 <= len(written) <= 5
    assert written[-1] == "01-motion-00000010.npz"


def test_a_full_disk_does_not_end_a_run(tmp_path):
    """The checkpoint before it stays; at the end, where nothing could make up for it, it is an error."""
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(5))
    with (
        pytest.warns(tawami.CheckpointWarning, match="no checkpoint: .*The run goes on"),
        pytest.raises(tawami.OutputError, match=os.strerror(errno.EFBIG)),
        small_files(9000),
    ):
        run(tmp_path / "run")
    names = [path.name for path in (tmp_path / "run" / "checkpoints").iterdir()]
    assert sorted(names) == ["01-motion-00000002.npz", "01-motion-00000004.npz"]
    kill = Kill()
    run(tmp_path / "run", each=kill)
    assert kill.count == 6


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(tawami.OutputError, match=r"result folder '.*file/run' cannot be written"):
        run(tmp_path / "file" / "run")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"folder": 3}, "folder = 3"),
        ({"checkpoint_steps": 0}, "checkpoint_steps = 0"),
        ({"checkpoint_minutes": -1.0}, "checkpoint_minutes = -1.0"),
        ({"keep": 0}, "keep = 0"),
        ({"existing": "append"}, "existing = 'append'"),
        ({"outputs": ["stress"]}, "'stress'"),
        (
            {"outputs": [tawami.TableOutput(), tawami.TableOutput("energies")]},
            "2 outputs are called 'table'.*expected another name",
        ),
    ],
)
def test_wrong_settings(tmp_path, options, message):
    folder, outputs = options.pop("folder", tmp_path), options.pop("outputs", [])
    with pytest.raises(tawami.InputError, match=message):
        tawami.Results(folder, *outputs, **options)


def test_the_end_of_a_run_is_the_start_of_another_scene(tmp_path):
    motion, _ = run(tmp_path / "run")
    end = motion.scene.particles
    for path in (tmp_path / "run", results_of(tmp_path / "run").checkpoints[-1]):
        state = tawami.earlier(path)
        scene = tawami.Scene(
            motion.scene.grid, state.body, ELASTIC, form="u_epsv_finite", density=1000.0
        )
        scene.initial("stress", state)
        again = tawami.Dynamics(scene, velocity=state)
        for mine, others in (
            (scene.particles.x, end.x),
            (scene.particles.stress, end.stress),
            (again.velocity, motion.velocity),
        ):
            assert np.array_equal(mine, others)
    with pytest.raises(tawami.InputError, match="a folder of results with checkpoints"):
        tawami.earlier(tmp_path)


def test_run_json_knows_the_phases(tmp_path):
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(5))
    run(tmp_path / "run")
    known = json.loads((tmp_path / "run" / "run.json").read_text())
    assert known["script"] is not None
    (motion,) = known["phases"]
    assert (motion["name"], motion["reached"], motion["steps"]) == ("motion", 0.05, 10)
    assert motion["began"] <= motion["finished"]
    assert any(line.startswith("motion ") for line in motion["input"])


def test_outputs_see_the_phases_that_they_are_for(tmp_path):
    phases = [None, ["motion"], ["ramp"]]
    outputs = [Recorder(f"recorder-{k}", phases=of) for k, of in enumerate(phases)]
    scene = block()
    scene.fix("bottom", "x")
    results = results_of(tmp_path / "run", *outputs)
    tawami.ramp(scene, 0.5, results=results)
    scene.release("bottom", "x")
    tawami.Dynamics(scene).run(0.02, 0.01, results=results)
    began = [[name for name, _ in output.began] for output in outputs]
    assert began == [["ramp", "motion"], ["motion"], ["ramp"]]
    with pytest.raises(
        tawami.InputError, match="phases = 'ramp': expected a list with some of 'ramp'"
    ):
        tawami.ParticleOutput(phases="ramp")


def test_other_results_are_refused():
    motion = tawami.Dynamics(block())
    with pytest.raises(tawami.InputError, match=r"results = 'folder': expected tawami\.Results"):
        motion.run(0.1, 0.01, results="folder")


# -- what is said while it runs -----------------------------------------------


@pytest.fixture
def talkative():
    """The tests otherwise silence what is not a warning."""
    logging.disable(logging.NOTSET)
    yield
    logging.disable(logging.INFO)


@pytest.mark.usefixtures("talkative")
def test_the_log_has_the_whole_history(tmp_path):
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(8))
    run(tmp_path / "run")
    lines = (tmp_path / "run" / "log.txt").read_text().splitlines()
    steps = [line for line in lines if ": step " in line]
    assert len(steps) == 8 + 4
    assert "motion: step 10 to 0.05 s, size 0.005, " in steps[-1]
    assert "Newton iterations to " in steps[-1]
    assert steps[-1].endswith("16 particles")
    assert any("goes on at 0.03 s" in line for line in lines)


@pytest.mark.usefixtures("talkative")
def test_what_python_warns_of_is_in_the_log(tmp_path):
    def warns(_):
        import warnings

        warnings.warn("a noteworthy thing", tawami.EnergyWarning, stacklevel=1)

    with pytest.warns(tawami.EnergyWarning):
        run(tmp_path / "run", each=warns)
    assert "WARNING EnergyWarning: a noteworthy thing" in (tmp_path / "run" / "log.txt").read_text()


@pytest.mark.usefixtures("talkative")
def test_the_level_of_the_log(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("TAWAMI_LOG_LEVEL", "info")
    run(tmp_path / "a")
    assert capfd.readouterr().err.count("INFO motion: step ") == 10
    monkeypatch.setenv("TAWAMI_LOG_LEVEL", "loud")
    with pytest.raises(tawami.InputError, match="TAWAMI_LOG_LEVEL = 'LOUD': expected one of DEBUG"):
        run(tmp_path / "b")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_one_live_line_at_a_terminal(tmp_path, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    monkeypatch.setenv("COLUMNS", "120")
    run(tmp_path / "run")
    text = terminal.getvalue()
    states = text.split("\r")[1:]
    assert len(states) == 10
    assert text.count("\n") == 1
    for part in ("motion 0.05 of 0.05 s", "step 10 (0.005)", "Newton", "16 particles", "0 s left"):
        assert part in states[-1]
    assert all(len(state.rstrip("\n")) == 119 for state in states)


def test_no_live_line_elsewhere(tmp_path, capfd):
    run(tmp_path / "run")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0 s"), (59.6, "1 min 0 s"), (61, "1 min 1 s"), (7384, "2 h 3 min"), (2e5, "2 d 7 h")],
)
def test_durations(seconds, text):
    assert progress.duration(seconds) == text


# -- processes ----------------------------------------------------------------


def child(folder, **variables):
    """The run of `python tests/results/test_results.py FOLDER` in a process of its own."""
    path = f"{ROOT / 'python'}:{ROOT}:{ROOT / 'tests'}"
    environment = os.environ | {"PYTHONPATH": path, "TAWAMI_EXISTING": "resume"} | variables
    return subprocess.Popen(
        [sys.executable, __file__, str(folder)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def main(folder: str) -> None:
    """Slow enough to be stopped; where the particles are in the end, into a file."""
    logging.disable(logging.NOTSET)
    results = results_of(folder, checkpoint_steps=5)
    motion = tawami.Dynamics(block(), velocity=(1.0, 0.0))
    motion.run(0.3, 0.002, results=results, each=lambda _: time.sleep(0.01))
    if MPI.COMM_WORLD.size == 1:
        np.save(Path(folder) / "end.npy", motion.scene.particles.rows())


def wait_for_steps(folder, number):
    """Until a process has written a checkpoint after so many steps more than there are."""

    def newest():
        paths = sorted(Path(folder, "checkpoints").glob("*.npz"))
        return int(paths[-1].stem.rpartition("-")[2]) if paths else 0

    before = newest()
    for _ in range(1200):
        if newest() >= before + number:
            return
        time.sleep(0.05)
    raise AssertionError("no checkpoint within 60 s")


def test_signals_write_a_last_checkpoint_and_a_killed_process_goes_on(tmp_path):
    whole = child(tmp_path / "whole")
    _, errors = whole.communicate(timeout=100)
    assert whole.returncode == 0, errors
    folder = tmp_path / "run"
    for sent, code in ((signal.SIGKILL, -9), (signal.SIGTERM, 143), (signal.SIGINT, -2)):
        process = child(folder)
        wait_for_steps(folder, 8)
        process.send_signal(sent)
        _, errors = process.communicate(timeout=60)
        assert process.returncode == code, errors
        if sent != signal.SIGKILL:
            assert f"motion: stopped by {sent.name} at" in errors
            assert f"tawami resume {folder}" in errors
    last = child(folder)
    _, errors = last.communicate(timeout=100)
    assert last.returncode == 0, errors
    ends = [np.load(tmp_path / name / "end.npy") for name in ("whole", "run")]
    assert ends[0].tobytes() == ends[1].tobytes()


@pytest.mark.mpi
def test_on_another_number_of_ranks(tmp_path):
    """Begun on one, gone on with on two, then on three ranks, which SIGTERM stops."""
    whole = child(tmp_path / "whole")
    whole.communicate(timeout=100)
    folder = tmp_path / "run"
    process = child(folder)
    wait_for_steps(folder, 8)
    process.kill()
    process.communicate()
    path = f"{ROOT / 'python'}:{ROOT}:{ROOT / 'tests'}"
    for number in (2, 3):
        command, environment = mpirun(number, [sys.executable, __file__, str(folder)])
        environment |= {"PYTHONPATH": path, "TAWAMI_EXISTING": "resume", "OMP_NUM_THREADS": "1"}
        several = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
        wait_for_steps(folder, 8)
        several.terminate()
        several.communicate(timeout=60)
        log = (folder / "log.txt").read_text()
        assert f"tawami on {number} ranks" in log
    last = child(folder)
    last.communicate(timeout=100)
    ends = [np.load(tmp_path / name / "end.npy") for name in ("whole", "run")]
    assert np.abs(ends[1] - ends[0]).max() <= 1e-10 * np.abs(ends[0]).max()
    assert (ends[0] != ends[1]).any()  # the ranks took part


if __name__ == "__main__":
    main(sys.argv[1])
