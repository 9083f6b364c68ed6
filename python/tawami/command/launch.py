"""A driver script run from the command line: as `python` would, on one rank or several, or once more
in place of a run that was stopped.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
import traceback
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any

from mpi4py import MPI

from tawami.base import program
from tawami.base.errors import InputError
from tawami.results.provenance import RUN, SCRIPT
from tawami.results.results import EXISTING

#: Exit code of what Ctrl-C ended, as of a shell.
INTERRUPTED = 130


@dataclass(frozen=True)
class Script:
    """What is run.

    Attributes:
        path: The file; None for a module.
        module: The module, as after `python -m`; None for a file.
        arguments: What it gets.
    """

    path: Path | None
    module: str | None
    arguments: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """What messages call it."""
        return str(self.module) if self.path is None else self.path.name

    @property
    def command(self) -> list[str]:
        """What stands for it after `tawami run`, as after `python`."""
        return ["-m", str(self.module)] if self.path is None else [str(self.path)]

    def check(self) -> None:
        """Whether it can be run, before anything is.

        Raises:
            InputError: No such file or module, or a file that is not Python.
        """
        if self.path is not None:
            _check_file(self.path)
        else:
            _check_module(str(self.module))


def _check_file(path: Path) -> None:
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise InputError(
            f"script '{path}' {what}: expected a Python file, as tawami new writes one"
        )
    try:
        text = path.read_bytes()
        compile(text, str(path), "exec", dont_inherit=True)
    except OSError as error:
        raise InputError(f"script '{path}' cannot be read: {error.strerror}") from error
    except SyntaxError as error:
        where = f", line {error.lineno}" if error.lineno else ""
        raise InputError(f"script '{path}'{where} is not Python: {error.msg}") from error
    except ValueError as error:
        raise InputError(f"script '{path}' is not Python: {error}") from error


def _check_module(name: str) -> None:
    sys.path.insert(0, os.getcwd())
    try:
        found = importlib.util.find_spec(name)
        if found is not None and found.submodule_search_locations is not None:
            found = importlib.util.find_spec(f"{name}.__main__")
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise  # something that the package itself imports
        found = None
    except (ImportError, ValueError):  # a relative name, an empty one
        found = None
    finally:
        sys.path.pop(0)
    if found is None:
        raise InputError(
            f"no module '{name}' can be run from '{Path.cwd()}': expected its name as after python -m, "
            "or the path of a script without -m"
        )


def start(script: Script, number: int | None, environment: dict[str, str]) -> int:
    """Run a script in this process, or on several ranks.

    Args:
        script: What to run.
        number: Ranks; those that there are by default.
        environment: Variables that the script finds besides.

    Returns:
        The exit code.

    Raises:
        InputError: It cannot be run, or not on so many ranks.
    """
    present = MPI.COMM_WORLD.size
    if number is not None and present > 1 and number != present:
        raise InputError(
            f"--ranks {number}, but mpirun has started {present} already: expected one of the two"
        )
    script.check()
    os.environ.update(environment)
    if number is None or number == present:
        return _here(script)
    return _on_ranks(script, number)


def _on_ranks(script: Script, number: int) -> int:
    if shutil.which("mpirun") is None:
        raise InputError(
            f"--ranks {number} needs mpirun, which was not found: on Debian: apt install openmpi-bin"
        )
    own = [sys.executable, "-m", "tawami", "run", *script.command, "--", *script.arguments]
    command, variables = program.mpirun(number, own)
    process, interrupted = subprocess.Popen(command, env=variables), False
    while process.poll() is None:
        try:
            process.wait()
        except KeyboardInterrupt:  # mpirun got it too, and ends its ranks
            interrupted = True
    code = int(process.returncode)
    if interrupted or code == -signal.SIGINT:
        return INTERRUPTED
    return 128 - code if code < 0 else code


def _here(script: Script) -> int:
    """Run it under the rules of `tawami.run`."""
    try:
        program.run(lambda: _as_main(script), script.name)
    except Exception as error:
        program.stop("".join(traceback.format_exception(_from_script(error))))
    return 0


def _as_main(script: Script) -> None:
    """As `python script` or `python -m module` would."""
    if script.path is None:
        sys.path.insert(0, os.getcwd())
        sys.argv = [str(script.module), *script.arguments]
        runpy.run_module(str(script.module), run_name="__main__", alter_sys=True)
    else:
        path = script.path.resolve()
        sys.path.insert(0, str(path.parent))
        sys.argv = [str(script.path), *script.arguments]
        runpy.run_path(str(path), run_name="__main__")


def _from_script(error: Exception) -> Exception:
    """An error whose traceback begins in the script: how it was started is not its matter."""
    ours = {__name__, program.__name__, "runpy", "tawami.command.main"}
    trace: TracebackType | None = error.__traceback__
    while trace is not None and trace.tb_frame.f_globals.get("__name__") in ours:
        trace = trace.tb_next
    return error if trace is None else error.with_traceback(trace)


@dataclass(frozen=True)
class Run:
    """A run that left its results, as its `run.json` tells.

    Attributes:
        folder: Of its results.
        script: What was run.
        directory: Where.
        number: Ranks.
        source: File of the script or module, and its sha256; None where they are not known.
    """

    folder: Path
    script: Script
    directory: Path
    number: int
    source: tuple[Path, str] | None

    @staticmethod
    def of(folder: Path) -> Run:
        """What run.json in a folder says.

        Raises:
            InputError: There is none, or it does not say what is needed.
        """
        file = folder / RUN
        advice = "run the script itself, with tawami run SCRIPT --resume"
        try:
            told = json.loads(file.read_text(encoding="utf-8"))
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(
                f"there is no '{file}': expected the folder of a run with tawami.Results"
            ) from None
        except OSError as error:
            raise InputError(f"'{file}' cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise InputError(f"'{file}' is damaged ({error}): {advice}") from error
        try:
            return _as_told(folder, told)
        except (KeyError, TypeError, ValueError) as error:
            what = f"no {error}" if isinstance(error, KeyError) else str(error)
            raise InputError(f"'{file}' is damaged ({what}): {advice}") from error

    @property
    def changed(self) -> bool:
        """Whether the script is another one now."""
        if self.source is None or not self.source[0].is_file():
            return False
        path, sha256 = self.source
        return hashlib.sha256(path.read_bytes()).hexdigest() != sha256

    def check(self) -> None:
        """Whether it can be run again.

        Raises:
            InputError: Its script or its directory is gone.
        """
        if not self.directory.is_dir():
            raise InputError(
                f"the run in '{self.folder}' stood in '{self.directory}', which is gone: expected that "
                "folder; make it, or run the script itself elsewhere"
            )
        path, copy = self.script.path, (self.folder / SCRIPT).resolve()
        if path is not None and not path.is_file():
            instead = "expected it there"
            if copy.is_file():
                again = ["tawami", "run", str(copy), "--resume"]
                again += ["--", *self.script.arguments] if self.script.arguments else []
                instead = (
                    f"a copy stands beside the results: put it back, or run it with "
                    f"(cd {shlex.quote(str(self.directory))} && {shlex.join(again)})"
                )
            raise InputError(
                f"the script '{path}' of the run in '{self.folder}' is gone: {instead}"
            )

    def __str__(self) -> str:
        said = shlex.join([*self.script.command, *self.script.arguments])
        number = f"{self.number} ranks" if self.number > 1 else "1 rank"
        return f"{said} in '{self.directory}' on {number}, from where '{self.folder}' is"


def _as_told(folder: Path, told: Any) -> Run:
    """A run from what JSON holds; KeyError, TypeError or ValueError where it does not."""
    if not isinstance(told, dict):
        raise ValueError(f"it holds a {type(told).__name__}")
    path, module, sha256 = told["script"], told["module"], told.get("script_sha256")
    arguments, number = told["arguments"], told["ranks"]
    for name, kinds in (
        ("script", (str, type(None))), ("module", (str, type(None))), ("arguments", (list,)),
        ("directory", (str,)), ("ranks", (int,)), ("script_sha256", (str, type(None))),
    ):  # fmt: skip
        if not isinstance(told.get(name), kinds):
            raise ValueError(f"{name} is {told.get(name)!r}")
    if not all(isinstance(argument, str) for argument in arguments) or number < 1:
        raise ValueError(f"arguments are {arguments!r}, ranks {number!r}")
    if path is None and module is None:
        raise ValueError("it was a session, not a script")
    script = Script(None if module else Path(path), module, tuple(arguments))
    source = (Path(path), sha256) if path and sha256 else None
    return Run(folder, script, Path(told["directory"]), number, source)


def resume(folder: Path, number: int | None, environment: dict[str, str]) -> int:
    """Run again what left its results in a folder; finished phases are loaded, the last goes on.

    Args:
        folder: Of the results.
        number: Ranks; as before by default.
        environment: Variables that the script finds besides.

    Returns:
        The exit code.

    Raises:
        InputError: It cannot be run again; the message says why and what to do.
    """
    run = Run.of(folder)
    present = MPI.COMM_WORLD.size
    run = replace(run, number=number or (present if present > 1 else run.number))
    run.check()
    if MPI.COMM_WORLD.rank == 0:
        print(f"tawami resume: runs {run}", flush=True)
        if run.changed:
            print(
                f"tawami resume: {run.script.name} has changed since; what was finished is kept, and "
                "a checkpoint that no longer fits is refused",
                flush=True,
            )
    os.chdir(run.directory)
    return start(run.script, run.number, environment | {EXISTING: "resume"})
