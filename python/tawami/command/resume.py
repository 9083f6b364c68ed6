"""Interrupted runs: the script of a run started again, as its `run.json` records it."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from tawami.base.errors import InputError
from tawami.base.files import readable_file, reason
from tawami.command.script import Script, start
from tawami.results.provenance import RUN, SCRIPT
from tawami.results.results import EXISTING

#: Types of the entries of run.json that are read here.
ENTRIES: dict[str, tuple[type, ...]] = {
    "script": (str, type(None)),
    "module": (str, type(None)),
    "arguments": (list,),
    "directory": (str,),
    "ranks": (int,),
    "script_sha256": (str, type(None)),
}


@dataclass(frozen=True)
class Run:
    """A run with results.

    Attributes:
        folder: Of its results.
        script: The script that was run.
        directory: Working directory in which it was run.
        number: Number of ranks.
        source: File of the script or module, and its sha256; None if they are not known.
    """

    folder: Path
    script: Script
    directory: Path
    number: int
    source: tuple[Path, str] | None

    @staticmethod
    def of(folder: Path) -> Run:
        """The run that run.json in a folder records.

        Raises:
            InputError: There is no such file, or it is damaged.
        """
        expected = "the folder of a run with tawami.Results"
        file = readable_file("record of the run", folder / RUN, expected)
        try:
            return _from_record(folder, json.loads(file.read_text(encoding="utf-8")))
        except (OSError, KeyError, TypeError, ValueError) as error:
            what = f"no {error}" if isinstance(error, KeyError) else reason(error)
            raise InputError(
                f"'{file}' does not name a script to run again ({what}): run the script itself, with "
                "tawami run SCRIPT --resume"
            ) from error

    @property
    def changed(self) -> bool:
        """Whether the script has changed since."""
        if self.source is None:
            return False
        path, sha256 = self.source
        try:
            return hashlib.sha256(path.read_bytes()).hexdigest() != sha256
        except OSError:
            return False

    def check(self) -> None:
        """Check that it can be run again.

        Raises:
            InputError: Its script or its directory does not exist any more.
        """
        if not os.path.isdir(self.directory):
            raise InputError(
                f"the run in '{self.folder}' was started in '{self.directory}', which does not exist: "
                "expected that folder; create it, or run the script itself elsewhere"
            )
        path, copy = self.script.path, (self.folder / SCRIPT).resolve()
        if path is not None and not os.path.isfile(path):
            instead = "expected it there"
            if os.path.isfile(copy):
                again = ["tawami", "run", str(copy), "--resume"]
                again += ["--", *self.script.arguments] if self.script.arguments else []
                instead = (
                    "the folder of the results has a copy: put it back, or run it with "
                    f"(cd {shlex.quote(str(self.directory))} && {shlex.join(again)})"
                )
            raise InputError(
                f"the script '{path}' of the run in '{self.folder}' does not exist: {instead}"
            )

    def __str__(self) -> str:
        command = shlex.join([*self.script.command, *self.script.arguments])
        number = f"{self.number} ranks" if self.number > 1 else "1 rank"
        return f"{command} in '{self.directory}' on {number}, from the results in '{self.folder}'"


def _from_record(folder: Path, record: Any) -> Run:
    """A run from the content of its run.json.

    Raises:
        KeyError, TypeError, ValueError: An entry is missing or wrong.
    """
    if not isinstance(record, dict):
        raise ValueError(f"it holds a {type(record).__name__}")
    path, module, sha256 = record["script"], record["module"], record.get("script_sha256")
    arguments, number = record["arguments"], record["ranks"]
    for name, types in ENTRIES.items():
        if not isinstance(record.get(name), types):
            raise ValueError(f"{name} is {record.get(name)!r}")
    if not all(isinstance(argument, str) for argument in arguments) or number < 1:
        raise ValueError(f"arguments are {arguments!r}, ranks {number!r}")
    if path is None and module is None:
        raise ValueError("it was an interactive session, not a script")
    script = Script(None if module else Path(path), module, tuple(arguments))
    source = (Path(path), sha256) if path and sha256 else None
    return Run(folder, script, Path(record["directory"]), number, source)


def resume(folder: Path, number: int | None, environment: dict[str, str]) -> int:
    """Run the script of an interrupted run again: it loads the finished phases and resumes the last.

    Args:
        folder: Of the results.
        number: Number of ranks; as before by default.
        environment: Further environment variables for the script.

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
                f"tawami resume: {run.script.name} has changed since; finished phases are kept, and a "
                "checkpoint of another scene is rejected",
                flush=True,
            )
    try:
        os.chdir(run.directory)
    except OSError as error:
        raise InputError(
            f"the directory '{run.directory}' of the run cannot be entered ({reason(error)})"
        ) from error
    return start(run.script, run.number, environment | {EXISTING: "resume"})
