"""Driver scripts as commands: checked, then run as `python` would, on one rank or several."""

from __future__ import annotations

import importlib.util
import linecache
import os
import runpy
import shlex
import shutil
import sys
import traceback
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType, TracebackType

from mpi4py import MPI

from tawami.base import program
from tawami.base.errors import InputError
from tawami.base.files import nearest, readable_file, reason
from tawami.base.text import suggestion
from tawami.command.folders import is_run
from tawami.command.launch import launch
from tawami.results.provenance import SOURCE
from tawami.results.results import EXISTING, Results

#: Exit code of a program that Ctrl-C ended, as in a shell.
INTERRUPTED = 130


@dataclass(frozen=True)
class Script:
    """A driver script.

    Attributes:
        path: The file; None for a module.
        module: The module, as after `python -m`; None for a file.
        arguments: Its arguments.
        copy: The copy in a folder of results, which is run in its place.
    """

    path: Path | None
    module: str | None
    arguments: tuple[str, ...] = ()
    copy: Path | None = None

    @property
    def name(self) -> str:
        """Name for messages."""
        return str(self.module) if self.path is None else self.path.name

    @property
    def command(self) -> list[str]:
        """Words after `tawami run` or `python`."""
        return ["-m", str(self.module)] if self.path is None else [str(self.path)]

    def check(self) -> None:
        """Check that it can be run, before anything is run.

        Raises:
            InputError: No such file or module, or a file that is not Python.
        """
        if self.copy is not None:
            _check_file(self.copy)
        elif self.path is not None:
            _check_file(self.path)
        else:
            _check_module(str(self.module))


def _check_file(path: Path) -> None:
    if is_run(path):
        raise InputError(
            f"'{path}' is the folder of a run: expected a Python file; to resume the run: "
            f"{shlex.join(['tawami', 'resume', str(path)])}"
        )
    readable_file("script", path, "a Python file, as tawami new writes one")
    try:
        compile(path.read_bytes(), str(path), "exec", dont_inherit=True)
    except SyntaxError as error:
        where = f", line {error.lineno}" if error.lineno else ""
        raise InputError(f"script '{path}'{where} is not Python: {error.msg}") from error
    except (OSError, ValueError) as error:
        raise InputError(f"script '{path}' is not Python: {reason(error)}") from error


def _check_module(name: str) -> None:
    sys.path.insert(0, os.getcwd())
    try:
        found = _found_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise  # a module that the package itself imports
        found = None
    except (ImportError, ValueError):  # a relative or an empty name
        found = None
    finally:
        sys.path.pop(0)
    if found is None:
        file = Path(f"{name.strip('.').replace('.', '/')}.py")
        near = nearest(file, lambda path: path.suffix == ".py")
        hint = suggestion(near and ".".join(near.with_suffix("").parts))
        raise InputError(
            f"no module '{name}' can be run from '{Path.cwd()}': expected its name as after python -m, "
            f"or the path of a script without -m{hint}"
        )


def _found_module(name: str) -> ModuleSpec | None:
    """The module that `python -m name` runs."""
    found = importlib.util.find_spec(name)
    if found is not None and found.submodule_search_locations is not None:
        found = importlib.util.find_spec(f"{name}.__main__")
    return found


def start(script: Script, number: int | None, environment: dict[str, str]) -> int:
    """Run a script in this process, or on several ranks.

    Args:
        script: The script.
        number: Number of ranks; by default those that run now.
        environment: Further environment variables for the script.

    Returns:
        The exit code.

    Raises:
        InputError: The script cannot be run, or not on that number of ranks.
    """
    present = MPI.COMM_WORLD.size
    if number is not None and present > 1 and number != present:
        raise InputError(
            f"--ranks {number}, but mpirun has started {present} already: expected one of the two"
        )
    script.check()
    os.environ.update(environment)
    if number is None or number == present:
        return _run_here(script)
    return _run_on_ranks(script, number)


def _run_on_ranks(script: Script, number: int) -> int:
    if shutil.which("mpirun") is None:
        raise InputError(
            f"--ranks {number} needs mpirun, which was not found: on Debian: apt install openmpi-bin"
        )
    words = ["run", *script.command, "--", *script.arguments]
    if script.copy is not None:  # it was checked
        words = ["resume", "--trust", str(script.copy.parent)]
    return launch(number, [sys.executable, "-m", "tawami", *words])


def _run_here(script: Script) -> int:
    """Run a script under the rules of `tawami.run`."""
    before = Results.begun
    try:
        program.run(lambda: _run_as_main(script), script.name)
    except SystemExit as end:
        if end.code:
            raise
    except Exception as error:
        program.stop("".join(traceback.format_exception(_from_script(error))))
    existing = os.environ.get(EXISTING)
    if existing is not None and Results.begun == before and MPI.COMM_WORLD.rank == 0:
        print(
            f"{script.name}: --{existing} had no effect: the script ran from its beginning, and wrote "
            "no results with tawami.Results(...) and results=...",
            file=sys.stderr,
        )
    return 0


def _run_as_main(script: Script) -> None:
    """Run it as `python script` or `python -m module` would."""
    if script.copy is not None:
        _run_copy(script, script.copy)
    elif script.path is None:
        sys.path.insert(0, os.getcwd())
        sys.argv = [str(script.module), *script.arguments]
        runpy.run_module(str(script.module), run_name="__main__", alter_sys=True)
    else:
        path = script.path.resolve()
        sys.path.insert(0, str(path.parent))
        sys.argv = [str(script.path), *script.arguments]
        runpy.run_path(str(path), run_name="__main__")


def _run_copy(script: Script, copy: Path) -> None:
    """Run a copy of a script as if it were in the place of the script.

    Its `__file__` and its modules are those of the script. Sources in tracebacks, and those that
    tawami stores again, are of the copy.
    """
    source, main = copy.read_bytes(), ModuleType("__main__")
    if script.path is None:
        sys.path.insert(0, os.getcwd())
        spec = _found_module(str(script.module))
        file = str(copy) if spec is None else str(spec.origin)
        main.__spec__, main.__package__ = spec, None if spec is None else spec.parent
    else:
        file = str(script.path.resolve())
        sys.path.insert(0, str(Path(file).parent))
    main.__file__, sys.argv = file, [str(script.path or file), *script.arguments]
    vars(main)[SOURCE] = source
    lines = source.decode(errors="replace").splitlines(keepends=True)
    linecache.cache[file] = (len(source), None, lines, file)
    before = sys.modules["__main__"]
    sys.modules["__main__"] = main
    try:
        exec(compile(source, file, "exec", dont_inherit=True), vars(main))
    finally:
        sys.modules["__main__"] = before


def _from_script(error: Exception) -> Exception:
    """The error with a traceback that begins in the script, without the frames of the command."""
    ours = {__name__, program.__name__, "runpy", "tawami.command.main"}
    trace: TracebackType | None = error.__traceback__
    while trace is not None and trace.tb_frame.f_globals.get("__name__") in ours:
        trace = trace.tb_next
    return error if trace is None else error.with_traceback(trace)
