"""Checkpoints: when they are written, and that one that is damaged or of another run is rejected."""

from __future__ import annotations

import contextlib
import errno
import os
from itertools import count

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from programs import small_files
from runs import Kill, Killed, block, results_of, run

import tawami
from tawami.base import archive
from tawami.results import checkpoints

# -- which ones are rejected ------------------------------------------------------


def test_a_damaged_checkpoint_is_rejected_and_the_one_before_it_used(interrupted):
    newest = results_of(interrupted).checkpoints[-1]
    newest.write_bytes(newest.read_bytes()[:-300])  # half written
    kill = Kill()
    with pytest.warns(tawami.CheckpointWarning, match="it is damaged") as warned:
        run(interrupted, each=kill)
    assert newest.name in str(warned[0].message)
    assert kill.count == 6  # from the fourth step


def test_without_a_valid_checkpoint_nothing_is_solved(interrupted):
    for path in results_of(interrupted).checkpoints:
        path.write_bytes(b"PK")
    kill = Kill(1)
    with (
        pytest.warns(tawami.CheckpointWarning),
        pytest.raises(tawami.CheckpointError, match="No other checkpoint of 'motion' can be used"),
    ):
        run(interrupted, each=kill)


@given(st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_damage_to_a_file_is_found(tmp_path, data):
    path = tmp_path / "state.npz"
    state = {"a": np.arange(30.0), "b": [1, {"c": np.array([[np.nan, -0.0]])}], "d": None, "e": 0.1}
    archive.write(path, {"run": 1}, state)
    whole = path.read_bytes()
    assert str(archive.read(path)[1]) == str(state)
    if data.draw(st.booleans()):
        damaged = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        at = data.draw(st.integers(0, len(whole) - 1))
        flipped = whole[at] ^ data.draw(st.integers(1, 255))
        damaged = whole[:at] + bytes([flipped]) + whole[at + 1 :]
    path.write_bytes(damaged)
    try:
        identity, found = archive.read(path)
    except tawami.CheckpointError:
        return
    assert identity == {"run": 1}
    assert str(found) == str(state)  # a date, or another byte without meaning


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
def test_a_checkpoint_of_another_scene_is_rejected(interrupted, changed, named):
    with (
        pytest.warns(tawami.CheckpointWarning, match="belongs to another run"),
        pytest.raises(tawami.CheckpointError, match=named),
    ):
        run(interrupted, scene=block(**changed))


def test_a_checkpoint_of_another_motion_is_rejected(interrupted):
    with (
        pytest.warns(tawami.CheckpointWarning),
        pytest.raises(tawami.CheckpointError, match="'velocity' of the particles at its start"),
    ):
        run(interrupted, velocity=(1.1, 0.0))


def test_a_checkpoint_of_another_format_is_rejected(interrupted):
    path = results_of(interrupted).checkpoints[-1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(archive, "FORMAT", 99)
        archive.write(path, {}, {})
    with pytest.warns(tawami.CheckpointWarning, match="format 99: this version of tawami reads"):
        run(interrupted)


# -- when they are written --------------------------------------------------------


def test_a_failed_step_leaves_a_checkpoint_of_the_state_before_it(tmp_path):
    """The driver fails after a step, and a ramp fails at its smallest step."""
    with pytest.raises(tawami.InputError) as error:
        run(tmp_path / "a", each=Kill(3, error=tawami.InputError("no")), checkpoint_steps=None)
    (note,) = error.value.__notes__
    (path,) = (tmp_path / "a" / "checkpoints").iterdir()
    assert note == f"the state after the last accepted step, at 0.015 s, is in '{path}'"
    kill = Kill()
    run(tmp_path / "a", each=kill)
    assert kill.count == 7
    scene = block()
    scene.fix("bottom", "x")
    scene.load([0], (0.0, -1e9))
    with pytest.raises(tawami.TawamiError):
        tawami.ramp(scene, 0.01, smallest=0.004, results=results_of(tmp_path / "b"), stop="raise")
    log = (tmp_path / "b" / "log.txt").read_text()
    assert "failed, now 0.005" in log
    assert "ramp ended by" in log


def test_an_error_names_a_checkpoint_only_if_it_exists(tmp_path):
    """The disk is full before the first checkpoint, and after it."""
    for at, notes in ((1, []), (3, ["the state after step 2 of 3 is in '{}'"])):
        folder = tmp_path / f"{at}"

        calls = count(1)

        def fill(_solution, at=at, calls=calls):
            if next(calls) == at:
                limit.enter_context(small_files(4000))
                raise tawami.InputError("no")

        with (
            contextlib.ExitStack() as limit,
            pytest.warns(tawami.CheckpointWarning, match="no checkpoint:") as warned,
            pytest.raises(tawami.InputError) as error,
        ):
            run(folder, each=fill)
        files = list((folder / "checkpoints").glob("*.npz"))
        assert getattr(error.value, "__notes__", []) == [n.format(*files) for n in notes]
        said = str(warned[0].message)
        assert ("the last one is" in said) == bool(notes) == ("none yet" not in said)
        assert "continues" not in said


def test_checkpoints_are_written_by_the_clock(tmp_path, monkeypatch):
    """The clock advances three seconds a step: twelve seconds pass in four or five steps."""
    clock = iter(np.arange(0.0, 1e4, 1.5))
    monkeypatch.setattr(checkpoints, "monotonic", lambda: next(clock))
    written, write = [], archive.write

    def recorded(path, *state):
        written.append(path.name)
        write(path, *state)

    monkeypatch.setattr(archive, "write", recorded)
    run(tmp_path / "run", checkpoint_steps=None, checkpoint_minutes=0.2)
    assert 2 <= len(written) <= 5
    assert written[-1] == "01-motion-00000010.npz"


def test_a_full_disk_stops_no_run_before_its_end(tmp_path):
    """A checkpoint that cannot be written is a warning, and the last one an error."""
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(5))
    with (
        pytest.warns(tawami.CheckpointWarning, match=r"no checkpoint: .*'.*-00000004.npz'"),
        pytest.raises(tawami.OutputError, match=os.strerror(errno.EFBIG)),
        small_files(9000),
    ):
        run(tmp_path / "run")
    names = [path.name for path in (tmp_path / "run" / "checkpoints").iterdir()]
    assert sorted(names) == ["01-motion-00000002.npz", "01-motion-00000004.npz"]
    kill = Kill()
    run(tmp_path / "run", each=kill)
    assert kill.count == 6
