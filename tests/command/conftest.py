"""A script, and the command `tawami` run in the process of the test or in one of its own."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Callable

import pytest
from programs import python

from tawami.command import main

#: Prints how it was started, then does what its first argument says.
SCRIPT = """
import os, sys
def fails():
    raise ZeroDivisionError("of the script")
print(__name__, __file__, sys.argv, os.getcwd(), sys.path[0])
print(os.environ.get("TAWAMI_EXISTING"), os.environ.get("TAWAMI_LOG_LEVEL"))
what = sys.argv[1] if len(sys.argv) > 1 else ""
if what == "fails":
    fails()
if what == "exit":
    sys.exit(3)
if what == "mistake":
    import tawami
    try:
        tawami.linear_elastic(E=-1.0, nu=0.3)
    except tawami.TawamiError as error:
        error.add_note("at 2 s")
        raise
if what == "ranks":
    from mpi4py import MPI
    print("ranks", MPI.COMM_WORLD.size)
if what == "wait":
    import time
    print("waits", flush=True)
    time.sleep(600)
"""

Finished = subprocess.CompletedProcess[str]


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "work" / "case.py"
    path.parent.mkdir()
    path.write_text(SCRIPT)
    return path


@pytest.fixture
def process() -> Callable[..., Finished]:
    """Run the command in a separate process, which costs a second."""
    return lambda *arguments, **options: python("-m", "tawami", *arguments, **options)


@pytest.fixture
def here(monkeypatch, capsys) -> Callable[..., Finished]:
    """Run the command in this process, and restore the state of the process."""

    def run(*arguments: object, cwd: object = None) -> Finished:
        words, environment, code = [*map(str, arguments)], dict(os.environ), 0
        capsys.readouterr()
        logging.disable(logging.NOTSET)
        try:
            with monkeypatch.context() as patch:
                patch.chdir(cwd or os.getcwd())
                patch.setattr(sys, "argv", ["tawami", *words])
                patch.setattr(sys, "path", list(sys.path))
                code = main.main(words)
        except SystemExit as end:  # as the interpreter ends
            code = end.code or 0
            if isinstance(code, str):
                print(code, file=sys.stderr)
                code = 1
        finally:
            logging.disable(logging.INFO)
            os.environ.clear()
            os.environ.update(environment)
        said = capsys.readouterr()
        return Finished(words, code, said.out, said.err)

    return run


@pytest.fixture
def rejected(capsys) -> Callable[..., str]:
    """Run a command that cannot be carried out as given; its one line."""

    def run(*arguments: object) -> str:
        capsys.readouterr()
        assert main.main([*map(str, arguments)]) == 2
        said = capsys.readouterr()
        assert said.err.count("\n") == 1
        return said.err

    return run
