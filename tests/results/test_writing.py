"""Full disks, folders that cannot be written, processes that are killed: an error message, no half
written file, and existing files unchanged.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from programs import python, small_files
from scenes import grid_of

import tawami
from cases.common import figure
from tawami.base.files import atomic_file, host, result_folder, temporary
from tawami.results.single import write_grid, write_particles
from tawami.study import process
from tawami.study.figure import picture
from tawami.study.row import COSTS, Row
from tawami.study.table import Table

BEFORE = "before"


@pytest.fixture(scope="module")
def solution() -> tawami.Solution:
    grid = grid_of((20, 10), 0.25)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e6, nu=0.3))
    scene.fix("left", "x")
    scene.fix("left", "y")
    return scene.solve()


def drawn(path: Path) -> None:
    picture, axes = plt.subplots()
    axes.plot([0, 1], [0, 1])
    try:
        figure.save(picture, path)
    finally:
        plt.close(picture)


def table() -> Table:
    costs = dict.fromkeys(COSTS, 1.0)
    rows = [Row("MPM", {"n": n}, {}, {"x": 1.0 / n}, costs | {"wall_s": n}) for n in range(1, 200)]
    return Table("toy", rows)


def csv(path: Path) -> None:
    with atomic_file(path) as part:
        part.write_text(table().as_csv())


#: Functions that write a whole file, by the name of the file.
WRITERS = {
    "p.vtu": lambda path, solution: write_particles(path, solution),
    "g.vtu": lambda path, solution: write_grid(path, solution),
    "figure.png": lambda path, _: drawn(path),
    "study.png": lambda path, _: picture(table(), path),
    "study.csv": lambda path, _: csv(path),
}


@contextlib.contextmanager
def nobody() -> Iterator[None]:
    """Act as a user without rights: root may write anywhere."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that every user may read."""
    path = Path(tempfile.mkdtemp())
    path.chmod(0o755)
    yield path
    path.chmod(0o755)
    shutil.rmtree(path, ignore_errors=True)


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_the_old_file(name, solution, folder):
    """The size of files is limited, or the part file is /dev/full."""
    path, write = folder / name, WRITERS[name]
    path.write_text(BEFORE)
    for why in ("File too large", "No space left on device"):
        limit = contextlib.nullcontext()
        if why[0] == "F":
            limit = small_files(2000)
        else:
            temporary(path).symlink_to("/dev/full")
        with limit, pytest.raises(tawami.OutputError, match=f"{name}' cannot be written: {why}"):
            write(path, solution)
        assert path.read_text() == BEFORE
        assert list(folder.iterdir()) == [path]
    write(path, solution)  # no part file is left behind
    assert path.stat().st_size > 2000


@pytest.mark.parametrize("name", ["p.vtu", "g.vtu", "figure.png", "study.csv"])
def test_a_folder_that_cannot_be_written_is_named(name, solution, folder):
    write = WRITERS[name]
    write(folder / name, solution)  # also imports what is imported late
    before = (folder / name).read_bytes()
    folder.chmod(0o555)
    with nobody(), pytest.raises(tawami.OutputError, match="cannot be written: Permission denied"):
        write(folder / name, solution)
    folder.chmod(0o755)
    assert (folder / name).read_bytes() == before
    (folder / "file").touch()
    (folder / f"folder-{name}").mkdir()
    long = folder / f"{'a' * 300}{Path(name).suffix}"
    gone = folder / "gone"
    gone.mkdir()
    write(gone / name, solution)
    shutil.rmtree(gone)
    for path, why in (
        (folder / "file" / name, "Not a directory"),
        (folder / f"folder-{name}", "Is a directory"),
        (long, "File name too long"),
        (gone / name, "No such file or directory"),
        (Path("/proc") / name, "No such file or directory|Permission denied"),
    ):
        with pytest.raises(tawami.OutputError, match=f"cannot be written: {why}"):
            write(path, solution)
    assert sorted(p.name for p in folder.iterdir()) == sorted([name, "file", f"folder-{name}"])


def test_a_result_folder_that_cannot_be_made_is_named(folder):
    folder.chmod(0o555)
    with nobody(), pytest.raises(tawami.OutputError, match="cannot be written .Permission denied"):
        result_folder(folder)
    with pytest.raises(tawami.OutputError, match="cannot be written .File name too long"):
        result_folder(folder / ("a" * 300))
    assert not list(folder.iterdir())


def runs(n: int) -> dict[str, float]:
    """The function of the study below."""
    return {"x": 1.0 + 1 / n}


def test_a_study_keeps_its_runs_on_a_full_disk(folder, monkeypatch):
    """A line that does not fit is removed; earlier runs are kept, and the study can be resumed."""
    outcome = {"values": runs(1)} | dict.fromkeys(COSTS, 1.0)
    monkeypatch.setattr(process, "measure", lambda *_: outcome)
    study = tawami.Study("toy", runs, {"n": (1,)}, {"x": 1.0}, folder=folder)
    kept = folder / "runs.jsonl"
    kept.write_text('{"label": "other", "knobs": {}, "fingerprint": "0"}\n')
    before = kept.read_text()
    with (
        small_files(len(before) + 20),
        pytest.raises(tawami.OutputError, match="runs.jsonl' cannot be written"),
    ):
        study.run(quiet=True)
    assert kept.read_text() == before
    assert [p.name for p in folder.glob("[!.]*")] == ["runs.jsonl"]
    assert len(study.run(quiet=True).rows) == 1


KILLED = """
import sys, time
from pathlib import Path
from tawami.base.files import atomic_file
with atomic_file(sys.argv[1]) as part, part.open("w") as file:
    file.write("half of what")
    file.flush()
    print("now", flush=True)
    time.sleep(60)
"""


def test_a_killed_process_leaves_the_old_file(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(BEFORE)
    command = [sys.executable, "-c", KILLED, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "now\n"
        child.send_signal(signal.SIGKILL)
    assert path.read_text() == BEFORE
    left = {f".{child.pid}@{host()}@x.csv"}  # hidden
    assert {p.name for p in tmp_path.iterdir()} == {"x.csv"} | left
    with atomic_file(path) as part:
        part.write_text("after")
    assert path.read_text() == "after"


MADE = """
import resource, sys
import tawami
from scenes import grid_of
def main():
    most = int(sys.argv[1])
    grid = grid_of((2, 2))
    body = tawami.box(grid, grid.origin, grid.upper)
    if most:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u")
tawami.run(main, "scene")
"""


@pytest.mark.parametrize(
    ("place", "most", "why"), [("file", 0, "Not a directory"), (".", 500, "too large")]
)
def test_a_cache_of_kernels_that_cannot_be_written_is_named(place, most, why, tmp_path):
    (tmp_path / "file").touch()
    run = python("-c", MADE, most, variables={"XDG_CACHE_HOME": str(tmp_path / place)})
    assert run.returncode == 1
    said = run.stderr.splitlines()[-1]
    assert said.startswith("scene: form 'u': the cache of compiled forms '"), run.stderr
    assert why in said
    assert "XDG_CACHE_HOME" in said
