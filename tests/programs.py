"""Python programs that tests start, alone or on several ranks, and limits under which tests write."""

from __future__ import annotations

import contextlib
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tawami.base.program import mpirun

ROOT = Path(__file__).parents[1]
PYTHONPATH = os.pathsep.join(
    [str(ROOT), str(ROOT / "tests"), *filter(None, [os.environ.get("PYTHONPATH")])]
)


#: Ranks that wait for others let them compute: there may be more ranks than processors.
YIELD = {"OMPI_MCA_mpi_yield_when_idle": "1"}


def python(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run Python with these arguments; options are those of subprocess.run, `variables` are added to
    the environment. A program that hangs fails the test.
    """
    environment = os.environ | {"PYTHONPATH": PYTHONPATH} | options.pop("variables", {})
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        env=environment, capture_output=True, text=True, timeout=200,
        **{"check": False, "cwd": ROOT} | options,
    )  # fmt: skip


def on_ranks(number: int, *arguments: object, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run Python with these arguments on several ranks. A hang fails the test."""
    command, environment = mpirun(number, [sys.executable, *map(str, arguments)])
    environment |= {"PYTHONPATH": PYTHONPATH, "OMP_NUM_THREADS": "1"} | YIELD | variables
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=200
    )


@contextlib.contextmanager
def small_files(most: int) -> Iterator[None]:
    """Limit the size of the files that this process writes [bytes], to act as a full disk.

    The error number is that of a file too large.
    """
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
