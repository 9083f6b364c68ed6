"""One process writes into a folder; the next one removes what a killed process left behind."""

from __future__ import annotations

import multiprocessing
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from programs import PYTHONPATH
from runs import Kill, block, results_of, run, steps_in

import tawami
from tawami.base.files import remove_leftovers
from tawami.base.lock import hold

RUN = """
import sys, pathlib, tawami
from runs import run
from tawami.base.lock import hold

def wait(solution):
    print("step", flush=True)
    sys.stdin.readline()

hold(pathlib.Path(sys.argv[2]), "study")  # freed at once
lock = hold(pathlib.Path(sys.argv[2]), "study")
run(pathlib.Path(sys.argv[1]), outputs=[tawami.TableOutput()], checkpoint_steps=1, each=wait)
"""
TABLE = [tawami.TableOutput()]


def cost(n: int) -> dict[str, float]:
    return {"error": 1.0 / n}


@pytest.fixture
def other(tmp_path):
    """A process in the second step of a run."""
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, tmp_path / "run", tmp_path / "study"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    with process:
        process.stdout.readline()
        process.stdin.write("\n")
        process.stdin.flush()
        process.stdout.readline()
        yield process
        process.kill()


def test_a_folder_has_one_writer_until_it_is_killed(other, tmp_path):
    """The number of the process is that of the other one; after its end the run is resumed."""
    folder, table = tmp_path / "run", tmp_path / "run" / "motion" / "table.csv"
    before = table.read_text()
    named = f"process {other.pid} on host '{platform.node()}' .* writes into this folder"
    for existing in ("stop", "replace", "resume"):
        with pytest.raises(tawami.InputError, match=named):
            run(folder, outputs=TABLE, existing=existing)
    study = tawami.Study("s", cost, {"n": [1]}, {"error": 0}, folder=tmp_path / "study")
    with pytest.raises(tawami.InputError, match=f"study 's' in .*process {other.pid}"):
        study.run()
    assert table.read_text() == before
    parts = [folder / "checkpoints" / f".{other.pid}@{platform.node()}@01-motion-00000003.npz"]
    parts.append(folder / "motion" / f".{other.pid}@{platform.node()}@table.csv")
    for part in parts:
        part.touch()
    other.kill()
    other.wait()
    kill = Kill()
    run(folder, outputs=TABLE, each=kill)
    assert kill.count == 9
    assert steps_in(table) == list(range(11))
    assert not any(part.exists() for part in parts)


def test_a_process_holds_a_folder_several_times(tmp_path):
    first, second = hold(tmp_path, "first"), hold(tmp_path, "second")
    assert first is second
    assert hold(tmp_path / ".." / tmp_path.name, "third") is first


def test_a_folder_that_was_refused_is_free(tmp_path):
    (tmp_path / "script.py").write_text("mine")
    results = results_of(tmp_path)
    with pytest.raises(tawami.InputError, match="which does not belong to a run"):
        tawami.Dynamics(block()).run(0.01, 0.005, results=results)
    assert hold(tmp_path, "").lock_counter == 1


def test_another_results_of_the_script_takes_the_folder(tmp_path):
    old, new = results_of(tmp_path), results_of(tmp_path / ".." / tmp_path.name, existing="replace")
    motion = tawami.Dynamics(block())
    motion.run(0.01, 0.005, results=old)
    tawami.Dynamics(block()).run(0.01, 0.005, results=new)
    with pytest.raises(tawami.InputError, match="another tawami.Results of this script"):
        motion.run(0.02, 0.005, results=old)


def test_only_leftovers_are_removed(tmp_path):
    """Files of live processes stay, and young ones of other hosts."""
    here, dead = platform.node(), 2**22 + 1  # beyond the largest number of a process
    keep = [
        f".{os.getpid()}@{here}@a.npz",
        f".{dead}@elsewhere@a.npz",
        ".7@a",
        ".a@b@c",
        "table.csv",
    ]
    gone = [f".{dead}@{here}@a.npz", f".{dead}@elsewhere@b.npz"]
    for name in keep + gone:
        (tmp_path / name).touch()
    day_before = (tmp_path / gone[0]).stat().st_mtime - 1e5
    os.utime(tmp_path / gone[1], (day_before, day_before))
    remove_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(keep)


def test_a_forked_process_does_not_write_with_its_parent(tmp_path):
    """The system would give it the lock that its parent holds."""
    held = hold(tmp_path, "parent")
    with multiprocessing.get_context("fork").Pool(1) as pool:
        said = pool.map_async(forked, [tmp_path]).get(60)[0]
    assert "this process was forked" in said
    assert held.is_locked


def forked(folder: Path) -> str:
    """The error message of a forked process that locks the folder."""
    try:
        hold(folder, "child")
    except tawami.InputError as error:
        return str(error)
    return "locked"
