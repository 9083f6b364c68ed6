"""Folder of a run: its files, and `run.json`, the record of the run."""

from __future__ import annotations

import json
import logging
import os
import shlex
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar
from weakref import WeakValueDictionary

from tawami.base import archive
from tawami.base.errors import InputError, OutputError
from tawami.base.files import atomic_file, reason, result_folder, unreadable
from tawami.base.lock import hold
from tawami.results import provenance
from tawami.results.output import PHASES
from tawami.results.progress import LOG
from tawami.results.provenance import FORM, RUN, SCRIPT

#: Copies that belong to a run.
COPIES = (SCRIPT, FORM)
log = logging.getLogger("tawami")


class RunFolder:
    """The folder of a run; its methods are for the first rank.

    Args:
        path: Of the folder.
        existing: Treatment of a run in it: 'stop', 'replace' or 'resume'.
    """

    #: The object that writes into a folder: the last one of this process that opened it.
    _writers: ClassVar[WeakValueDictionary[Path, RunFolder]] = WeakValueDictionary()

    def __init__(self, path: Path, existing: str) -> None:
        self.path, self.existing = path, existing
        self._what = f"Results('{path}')"

    @property
    def checkpoints(self) -> list[Path]:
        """Its checkpoints, oldest first."""
        return archive.files(self.path)

    def open(self) -> bool:
        """Lock the folder and prepare it for a run; whether an earlier run in it is resumed.

        The lock is held until the results are freed or the process ends.

        Raises:
            InputError: Another process writes into it. Or it holds a run and `existing` is 'stop', a
                finished run that cannot be resumed, or files that are not of a run.
            OutputError: It cannot be written.
        """
        self._lock = hold(self.path, self._what)
        try:
            resumes = self._prepare()
        except BaseException:
            self._lock.release()
            raise
        self._writers[self.path.resolve()] = self
        return resumes

    def check(self) -> None:
        """Check before a further phase that the folder is still this run's.

        Raises:
            InputError: Another Results of this process has opened it since.
        """
        if self._writers.get(self.path.resolve()) is not self:
            raise InputError(
                f"{self._what}: another tawami.Results of this script has opened the folder since: "
                "expected one for all phases of a run, or a folder for each"
            )

    @property
    def advice(self) -> str:
        """Advice on how to resume the run in the folder."""
        again = "run its script again, with existing='resume'"
        if self._record().get("script") and os.path.isfile(self.path / SCRIPT):
            again = f"resume it with: tawami resume {shlex.quote(str(self.path))}"
        return again if self.checkpoints else f"it has no checkpoint; {again}"

    def _prepare(self) -> bool:
        """See :meth:`open`."""
        known, recorded = self._record(), os.path.exists(self.path / RUN)
        phases = known.get("phases", [])
        # a run that ended with an error before its first step has no phases
        begun = recorded and not (known and not phases)
        resumes = False
        if self.checkpoints or begun:
            if self.existing == "stop":
                raise InputError(
                    f"{self._what}: the folder holds a run{self._reached()}. Expected another "
                    "folder, existing='resume' to resume it, or existing='replace' to replace it"
                )
            resumes = self.existing == "resume" and bool(self.checkpoints)
            finished = [one["name"] for one in phases if "finished" in one]
            if self.existing == "resume" and finished and not resumes:
                raise InputError(
                    f"{self._what}: the folder holds a run that finished {finished[-1]}, and "
                    "no checkpoint to resume it from: expected its checkpoints, or existing='replace' "
                    "to start a new run"
                )
            if not resumes:
                self._clear()
        elif not recorded:
            others = [name for name in COPIES if self._is_foreign(self.path / name)]
            if others:
                raise InputError(
                    f"{self._what}: the folder holds '{others[0]}', which does not belong "
                    "to a run: expected a separate folder for the results"
                )
        result_folder(self.path / archive.FOLDER)
        return resumes

    def note(self, phase: str, facts: Mapping[str, Any]) -> None:
        """Add facts about a phase to run.json.

        Raises:
            OutputError: It cannot be written.
        """
        run, known = self.path / RUN, self._record()
        if not known:
            log.warning("'%s' cannot be read; nothing about %s is added", run, phase)
            return
        phases = {one["name"]: one for one in known.get("phases", [])}
        phases[phase] = phases.get(phase, {"name": phase}) | facts
        known["phases"] = list(phases.values())
        with atomic_file(run) as part:
            part.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")

    @staticmethod
    def _is_foreign(path: Path) -> bool:
        """Whether a file exists, and is not the script that runs now."""
        script, _ = provenance.driver()
        return os.path.exists(path) and not (script is not None and path.resolve() == script)

    def _record(self) -> dict[str, Any]:
        """Content of run.json; empty if it cannot be read."""
        run = self.path / RUN
        if unreadable(run) is not None:
            return {}
        try:
            known = json.loads(run.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return known if isinstance(known, dict) else {}

    def _reached(self) -> str:
        """Progress of the run in the folder, for a message."""
        files = self.checkpoints
        return f", last checkpoint '{files[-1].name}'" if files else ""

    def _clear(self) -> None:
        """Remove the files of a run, and nothing else."""
        try:
            for path in (self.path / name for name in (RUN, LOG, *COPIES)):
                if self._is_foreign(path):
                    path.unlink()
            for path in self.path.iterdir():
                kind, _, number = path.name.partition("-")
                of_phase = kind in PHASES and (number.isdigit() or path.name == kind)
                if path.is_dir() and (of_phase or path.name == archive.FOLDER):
                    shutil.rmtree(path)
        except OSError as error:
            raise OutputError(
                f"'{error.filename}' cannot be removed ({reason(error)}): expected a folder with write "
                "permission; choose another one"
            ) from error
