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
from tawami.base.files import readable_file, reason, unreadable
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
        file: File of the script or module; None if it is not known.
        sha256: Of this file when the run began; None if it is not known.
    """

    folder: Path
    script: Script
    directory: Path
    number: int
    file: Path | None
    sha256: str | None

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
    def copy(self) -> Path:
        """The copy of the script in the folder, which is run."""
        return self.folder.resolve() / SCRIPT

    def check(self, *, trust: bool) -> None:
        """Check that it can be run again.

        Args:
            trust: Whether the copy of the script may differ from the one that was run.

        Raises:
            InputError: The folder has no copy of the script, or another one; the directory does not
                exist any more.
        """
        if not os.path.isdir(self.directory):
            raise InputError(
                f"the run in '{self.folder}' was started in '{self.directory}', which does not exist: "
                "expected that folder; create it, or run the script itself elsewhere"
            )
        expected = (
            "the script, as the run has stored it; run the script itself with: "
            "tawami run SCRIPT --resume"
        )
        readable_file("copy of the script", self.copy, expected)
        if _hash(self.copy) != self.sha256 and not trust:
            raise InputError(
                f"'{self.copy}' differs from the script that started the run (its checksum differs "
                f"from that in {RUN}): expected the same file. Read it, and run it with: "
                f"tawami resume --trust {shlex.quote(str(self.folder))}"
            )

    @property
    def remark(self) -> str | None:
        """The difference from the script that was run, and how to run that one; None if they agree."""
        if self.file is None or _hash(self.file) == _hash(self.copy):
            return None
        if not os.path.isfile(self.file):
            return f"'{self.file}' does not exist; the copy in the folder is run"
        again = ["tawami", "run", *self.script.command, "--resume"]
        again += ["--", *self.script.arguments] if self.script.arguments else []
        return (
            f"'{self.file}' has changed since; the copy in the folder is run. To resume with the "
            f"changed script: (cd {shlex.quote(str(self.directory))} && {shlex.join(again)})"
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
    copy = folder.resolve() / SCRIPT
    script = Script(None if module else Path(path), module, tuple(arguments), copy)
    return Run(folder, script, Path(record["directory"]), number, path and Path(path), sha256)


def _hash(path: Path) -> str | None:
    """Checksum of a file; None if it cannot be read."""
    if unreadable(path) is not None:
        return None
    return hashlib.sha256(path.read_bytes()).hexdigest()


def resume(
    folder: Path, number: int | None, environment: dict[str, str], *, trust: bool = False
) -> int:
    """Run the script of an interrupted run again: it loads the finished phases and resumes the last.

    The copy of the script in the folder is run.

    Args:
        folder: Of the results.
        number: Number of ranks; as before by default.
        environment: Further environment variables for the script.
        trust: Whether the copy of the script may differ from the script that was run.

    Returns:
        The exit code.

    Raises:
        InputError: It cannot be run again; the message says why and what to do.
    """
    run = Run.of(folder)
    present = MPI.COMM_WORLD.size
    run = replace(run, number=number or (present if present > 1 else run.number))
    run.check(trust=trust)
    if MPI.COMM_WORLD.rank == 0 and run.number == present:  # other ranks are started by mpirun
        print(f"tawami resume: runs {run}", flush=True)
        if run.remark is not None:
            print(f"tawami resume: {run.remark}", flush=True)
    try:
        os.chdir(run.directory)
    except OSError as error:
        raise InputError(
            f"the directory '{run.directory}' of the run cannot be entered ({reason(error)})"
        ) from error
    return start(run.script, run.number, environment | {EXISTING: "resume"})
