"""Paths that cannot be used: every argument that is a path gives one error message, at once."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

import tawami
from tawami.base.files import append_line, atomic_file, readable_file, result_folder
from tawami.command.main import main
from tawami.picture.figure import new_figure, save
from tawami.results import write_grid, write_particles
from tawami.results.plot import plot
from tawami.study.figure import picture
from tawami.study.row import COSTS, Row
from tawami.study.table import Table

GRID = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1.0, cells=(2, 1))


def scene() -> tawami.Scene:
    made = tawami.Scene(
        GRID,
        tawami.box(GRID, (0, 0), (2, 1), per_axis=2),
        tawami.linear_elastic(E=1.0, nu=0.3),
        form="u",
    )
    made.fix("left", "x")
    made.fix("left", "y")
    return made


@pytest.fixture(scope="module")
def solution() -> tawami.Solution:
    return scene().solve()


def runs(n: int) -> dict[str, float]:
    """The function of a study."""
    return {"x": 1.0 / n}


def command(*words: Any) -> None:
    """A command of tawami; its error message is raised."""
    code = main([*map(str, words)])
    if code:
        raise tawami.InputError(f"exit code {code}")


def ramp(path: Any, _: Any) -> None:
    tawami.ramp(scene(), 1.0, results=tawami.Results(path, checkpoint_minutes=None))


def study(path: Any, _: Any) -> None:
    tawami.Study("toy", runs, {"n": (1,)}, {"x": 1.0}, folder=path).run(quiet=True)


def table() -> Table:
    costs = dict.fromkeys(COSTS, 1.0)
    return Table("toy", [Row("MPM", {"n": n}, {}, {"x": 1.0 / n}, costs) for n in (1, 2)])


def atomic(path: Any, _: Any) -> None:
    with atomic_file(path) as part:
        part.write_text("after")


Use = Callable[[Any, Any], Any]
#: Uses of a path, by name and ending: files that are read, ...
READ: dict[str, tuple[str, Use]] = {
    "readable_file": (".txt", lambda path, _: readable_file("text", path, "a text")),
    "table": (".csv", lambda path, _: tawami.table(path)),
    "earlier, file": (".vtu", lambda path, _: tawami.earlier(path)),
    "earlier, checkpoint": (".npz", lambda path, _: tawami.earlier(path)),
    "mesh": (".msh", lambda path, _: tawami.mesh(GRID, path, per_axis=2)),
    "Form.load": (".py", lambda path, _: tawami.Form.load(path)),
    "recommend": (".csv", lambda path, _: tawami.recommend(path, 0.1)),
    "Table.read": (".csv", lambda path, _: Table.read(path)),
    "tawami run": (".py", lambda path, _: command("run", path)),
}
#: ... folders that are read, ...
READ_FOLDER: dict[str, tuple[str, Use]] = {
    "earlier, folder": ("", lambda path, _: tawami.earlier(path)),
    "plot": ("", lambda path, _: plot(path)),
    "tawami resume": ("", lambda path, _: command("resume", path)),
    "tawami plot": ("", lambda path, _: command("plot", path)),
}
#: ... files that are written, ...
WRITE: dict[str, tuple[str, Use]] = {
    "atomic_file": (".txt", atomic),
    "append_line": (".txt", lambda path, _: append_line(path, "after")),
    "write_particles": (".vtu", write_particles),
    "write_grid": (".vtu", write_grid),
    "save": (".png", lambda path, _: save(new_figure(1, 1), path)),
    "picture": (".png", lambda path, _: picture(table(), path)),
    "tawami new": (".py", lambda path, _: command("new", path)),
}
#: ... and folders that are written.
WRITE_FOLDER: dict[str, tuple[str, Use]] = {
    "result_folder": ("", lambda path, _: result_folder(path)),
    "Results": ("", ramp),
    "Study": ("", study),
}


def too_long(path: Path) -> Path:
    return path.with_name("a" * 300 + path.suffix)


def far_too_long(path: Path) -> Path:
    return path.parent.joinpath(*["b" * 200] * 30, path.name)


def missing(path: Path) -> Path:
    return path.parent / "missing" / path.name


def below_a_file(path: Path) -> Path:
    (path.parent / "file").touch()
    return path.parent / "file" / path.name


def nul(path: Path) -> str:
    return f"{path.parent}/nul\0{path.suffix}"


def surrogate(path: Path) -> str:
    return f"{path.parent}/\ud800{path.suffix}"


def regular_file(path: Path) -> Path:
    path.write_text("a file")
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def unix_socket(path: Path) -> Path:
    with socket.socket(socket.AF_UNIX) as server:
        before = Path.cwd()
        os.chdir(path.parent)  # the path of a socket has at most 108 characters
        server.bind(path.name)
        os.chdir(before)
    return path


def dangling_link(path: Path) -> Path:
    path.symlink_to(path.parent / "nothing" / "here")
    return path


def loop(path: Path) -> Path:
    path.symlink_to(path)
    return path


def no_permission(path: Path) -> Path:
    path.touch()
    path.chmod(0)
    path.parent.chmod(0o555)
    return path


SPECIAL = (too_long, far_too_long, below_a_file, nul, surrogate, pipe, unix_socket, loop)
CASES = [
    *((use, bad) for use in READ for bad in (*SPECIAL, missing, folder, dangling_link, no_permission)),
    *((use, bad) for use in READ_FOLDER
      for bad in (*SPECIAL, missing, folder, regular_file, dangling_link, no_permission)),
    *((use, bad) for use in WRITE for bad in (*SPECIAL, missing, folder, no_permission)
      if bad is not loop or use in ("append_line", "tawami new")  # others replace the link
      if bad is not missing or use != "tawami new"),  # it creates the folder
    *((use, bad) for use in WRITE_FOLDER
      for bad in (*SPECIAL, regular_file, dangling_link, no_permission)),
]  # fmt: skip
USES = READ | READ_FOLDER | WRITE | WRITE_FOLDER


@contextlib.contextmanager
def nobody() -> Iterator[None]:
    """Without the permissions of root."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@contextlib.contextmanager
def at_once() -> Iterator[None]:
    """An error if the block waits, as `open` of a pipe does."""

    def late(*_: Any) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(20)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(
    ("use", "bad"), [pytest.param(u, b, id=f"{u}, {b.__name__}") for u, b in CASES]
)
def test_a_path_that_cannot_be_used(use, bad, solution, tmp_path, capsys):
    ending, function = USES[use]
    place = tmp_path / "place"
    place.mkdir()
    path = bad(place / f"name{ending}")
    user = nobody() if bad is no_permission else contextlib.nullcontext()
    try:
        with user, at_once(), pytest.raises(tawami.TawamiError) as error:
            function(path, solution)
    finally:
        place.chmod(0o755)
    message = capsys.readouterr().err.strip() if use.startswith("tawami ") else str(error.value)
    assert isinstance(
        error.value,
        tawami.InputError | tawami.OutputError | tawami.FormError | tawami.CheckpointError,
    )
    assert "\n" not in message
    assert ("Errno" in message) is False
    assert len(message) < 7000 if bad is far_too_long else len(message) < 700


@pytest.mark.parametrize(
    ("use", "path"),
    [
        (name, path)
        for name in USES
        for path in (3, None, b"name", ["name"])
        # arguments of the command are text, and a study without a folder is allowed
        if not name.startswith("tawami ") and (name, path) != ("Study", None)
    ],
)
def test_what_is_not_a_path_is_rejected(use, path, solution, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(tawami.TawamiError, match="expected"):
        USES[use][1](path, solution)


def test_a_link_is_followed_by_readers_and_replaced_by_writers(solution, tmp_path):
    (tmp_path / "real.csv").write_text("x,y,value\n0,0,1\n1,0,1\n0,1,1\n")
    (tmp_path / "link.csv").symlink_to("real.csv")
    assert len(tawami.table(tmp_path / "link.csv").x) == 3
    (tmp_path / "particles.vtu").symlink_to(tmp_path / "nothing" / "here")
    write_particles(tmp_path / "particles.vtu", solution)
    assert not (tmp_path / "particles.vtu").is_symlink()
    assert len(tawami.earlier(tmp_path / "particles.vtu").x) == 8


@pytest.mark.parametrize("name", ["log.txt", "run.json", "checkpoints", "ramp", "ramp/table.csv"])
@pytest.mark.parametrize("bad", [pipe, folder, regular_file])
def test_a_folder_of_results_that_holds_something_else(name, bad, tmp_path):
    """A message, or a run that replaces what is in its way."""
    path = tmp_path / "run" / name
    path.parent.mkdir(parents=True)
    bad(path)
    results = tawami.Results(tmp_path / "run", tawami.TableOutput(), existing="replace")
    with at_once(), contextlib.suppress(tawami.InputError, tawami.OutputError):
        tawami.ramp(scene(), 1.0, results=results)
