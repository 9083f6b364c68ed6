"""Run the cases, unless nothing has changed, and name what the code of pages depends on.

A record holds the fingerprint of all files that a run read; it is written last. A run that fails is an
error of `make docs`.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import perf_counter

from sources import ROOT

RESULTS = ROOT / "results" / "docs"
#: Files that every run reads.
SHARED = ("python/tawami/**/*.py", "forms/*.py", "rust/**/*.rs", "Cargo.lock")
MINUTES = 60
#: Cases that only print.
WITHOUT_FILES = ("self_weight", "projection", "writing")
#: Options of cases that would take more than two minutes of one core.
SHORTER = {
    "elastica": ("--steps", "20", "--cells", "4"),
    "footing": ("--cells", "8"),
    "bearing_capacity": ("--cells", "2"),
    "circular_footing": ("--cells", "8"),
    "ordering": ("--cells", "4,8,16,32,64"),
    "solvers": ("--cells", "16,32,64", "--particles", "800,12800"),
}


class RunError(Exception):
    """A run that failed."""


@dataclass(frozen=True)
class Output:
    """Printed text, folder, pictures and duration [s] of a run."""

    text: str
    folder: Path
    seconds: float

    @property
    def pictures(self) -> list[Path]:
        """The figures that the run drew."""
        return sorted(self.folder.glob("*.png"))


def fingerprint(patterns: Iterable[str], *more: str) -> str:
    """Fingerprint of the files that match patterns, from the top of the repository, and of texts.

    Comments, docstrings and the layout of Python files do not count.
    """
    total = hashlib.sha256("\0".join(more).encode())
    for path in sorted({path for pattern in patterns for path in ROOT.glob(pattern)}):
        if path.is_file():
            total.update(
                f"\0{path.relative_to(ROOT)}\0".encode() + _meaning(path.read_bytes(), path.suffix)
            )
    return total.hexdigest()


@cache
def _meaning(content: bytes, suffix: str) -> bytes:
    """Content of a file as bytes; of a Python file its syntax tree without docstrings."""
    if suffix != ".py":
        return content
    tree = ast.parse(content)
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            and ast.get_docstring(node, clean=False) is not None
        ):
            node.body[0] = ast.Pass()
    return ast.dump(tree).encode()


def cached(folder: Path, mark: str, work: Callable[[], str]) -> Output:
    """Output of `work`, which draws into a folder; of the last run if that had the same fingerprint."""
    record = folder / "record.json"
    with contextlib.suppress(OSError, ValueError):
        old = json.loads(record.read_text())
        if old["fingerprint"] == mark:
            return Output(old["text"], folder, old["seconds"])
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    start = perf_counter()
    text = work()
    seconds = perf_counter() - start
    record.write_text(json.dumps({"fingerprint": mark, "text": text, "seconds": seconds}))
    return Output(text, folder, seconds)


def command(
    words: Sequence[str], folder: Path, what: str, environment: Mapping[str, str] = os.environ
) -> str:
    """Standard output of a command.

    Raises:
        RunError: Its exit code is not 0, or it does not end.
    """
    own = {**environment, "MPLBACKEND": "Agg", "PYTHONPATH": search_path()}
    print(f"docs: {what}", file=sys.stderr, flush=True)
    try:
        run = subprocess.run(
            words, cwd=folder, env=own, stdin=subprocess.DEVNULL, capture_output=True,
            text=True, check=False, timeout=60 * MINUTES,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise RunError(f"{what} did not end within {MINUTES} minutes") from None
    if run.returncode:
        raise RunError(f"{what} ended with {run.returncode}:\n{run.stderr[-3000:]}")
    return run.stdout


def search_path() -> str:
    """Value of PYTHONPATH with which code finds `cases`."""
    return os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))


def case(room: str, name: str) -> Output:
    """Run a case as `python -m cases.ROOM.NAME` does."""
    folder, module = RESULTS / "executed" / name, f"cases.{room}.{name}"
    own = (f"cases/{room}/{name}.py", f"cases/{room}/{name}/*.py", "cases/common/*.py")
    options = [] if name in WITHOUT_FILES else ["--results", str(folder)]
    words = [sys.executable, "-m", module, *SHORTER.get(name, ()), *options]
    mark = fingerprint((*SHARED, *own), *SHORTER.get(name, ()))
    output = cached(folder, mark, lambda: command(words, ROOT, f"python -m {module}"))
    return Output(output.text.replace(f"{ROOT}/", ""), folder, output.seconds)


def all_cases(rooms: Mapping[str, str]) -> None:
    """Run the cases that have no valid record, as many at a time as there are free cores.

    Args:
        rooms: Folder of `cases/` of each case. Those of `costs` measure times and run one by one.
    """
    costs = [name for name, room in rooms.items() if room == "costs"]
    others = sorted(
        set(rooms) - set(costs), key=lambda name: (name not in SHORTER, name)
    )  # long first
    with ThreadPoolExecutor(workers()) as pool:
        list(pool.map(lambda name: case(rooms[name], name), others))
    for name in costs:
        case(rooms[name], name)


def workers() -> int:
    """Number of processes that the cores of this machine can run at a time."""
    threads = int(os.environ.get("OMP_NUM_THREADS") or 1)
    return max(1, len(os.sched_getaffinity(0)) // threads)
