"""A run with a folder: what it writes there, its checkpoints, and how it goes on after it was stopped.

Each `ramp`, `settle` or `Dynamics.run` that is given the results is a phase of the run. A script that
is started again with `existing='resume'` is executed from its top; phases that had come to their end are
not solved again, their end is loaded, and the one that was stopped goes on from its newest checkpoint.
"""

from __future__ import annotations

import json
import logging
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args

from tawami.base import archive, checks
from tawami.base.errors import InputError, OutputError
from tawami.base.files import result_folder, whole_file
from tawami.base.ranks import raise_together
from tawami.motion.observer import Subject
from tawami.results import provenance
from tawami.results.output import PHASES, Output
from tawami.results.phase import LOG, Phase
from tawami.results.provenance import FORM, RUN, SCRIPT

Existing = Literal["stop", "replace", "resume"]
#: Takes precedence over `existing`: how `tawami resume` starts a script.
EXISTING = "TAWAMI_EXISTING"
COPIES = (SCRIPT, FORM)
log = logging.getLogger("tawami")


class Results:
    """The folder of a run, and what observes it.

    Args:
        folder: Made if it is not there.
        outputs: What is written: `ParticleOutput`, `GridOutput`, `TableOutput`.
        checkpoint_steps: Accepted steps between checkpoints; None for none by number.
        checkpoint_minutes: Wall time between checkpoints [min]; None for none by time. The end of a
            phase, SIGTERM, Ctrl-C and an error that ends the run write one in any case.
        keep: Checkpoints of a phase that are kept.
        existing: Where the folder holds a run: 'stop' with an error, 'replace' it, or 'resume' it. The
            environment variable TAWAMI_EXISTING takes precedence.
        progress: One live line on standard error; None for where that is a terminal.

    Raises:
        InputError: A parameter out of its range.
    """

    def __init__(
        self,
        folder: str | Path,
        *outputs: Output,
        checkpoint_steps: int | None = None,
        checkpoint_minutes: float | None = 10.0,
        keep: int = 2,
        existing: Existing = "stop",
        progress: bool | None = None,
    ) -> None:
        for output in outputs:
            if not isinstance(output, Output):
                raise InputError(
                    f"Results(..., {checks.shown(output)}): expected ParticleOutput(...), "
                    "GridOutput(...) or TableOutput(...)"
                )
        names = [output.name for output in outputs]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(
                f"Results: {names.count(twice[0])} outputs are called '{twice[0]}', and their files "
                "would be the same: expected another name for one, as ParticleOutput(..., name='fine')"
            )
        self.folder, self.outputs = checks.path("folder", folder), outputs
        self.checkpoint_steps = (
            None
            if checkpoint_steps is None
            else checks.whole_number("checkpoint_steps", checkpoint_steps, low=1)
        )
        self.checkpoint_minutes = (
            None
            if checkpoint_minutes is None
            else checks.number("checkpoint_minutes", checkpoint_minutes, low=0.0)
        )
        self.keep = checks.whole_number("keep", keep, low=1)
        variable = os.environ.get(EXISTING)
        self.existing = existing if variable is None else variable
        name = "existing" if variable is None else EXISTING
        checks.choice(name, self.existing, get_args(Existing))
        self.progress = None if progress is None else checks.switch("progress", progress)
        self._phases: list[str] = []
        #: Whether the run goes on from where an earlier one was.
        self.resumes = False

    @property
    def checkpoints(self) -> list[Path]:
        """The checkpoints that there are, oldest first."""
        return archive.files(self.folder)

    def phase(self, kind: str, subject: Subject, end: float, unit: str) -> Phase:
        """The next phase of the run, for a with statement; a call for all ranks.

        Args:
            kind: 'ramp', 'settle' or 'motion'.
            subject: The scene, or its motion.
            end: Where it ends.
            unit: Of that.

        Raises:
            InputError: The folder holds a run, and `existing` is 'stop'.
            OutputError: It cannot be written.
        """
        if not self._phases:
            comm = subject.scene.grid.comm
            with raise_together(comm):
                if comm.rank == 0:
                    self._open()
            self.resumes = comm.bcast(self.resumes)
            if not self.resumes:
                provenance.write(self.folder, subject)
        before = sum(name.partition("-")[0] == kind for name in self._phases)
        self._phases.append(f"{kind}-{before + 1}" if before else kind)
        return Phase(self, len(self._phases), self._phases[-1], subject, end, unit)

    def _open(self) -> None:
        result_folder(self.folder)
        run, known = self.folder / RUN, self._known()
        # an attempt that was refused before its first step is no run
        nothing = known and not known.get("phases")
        if self.checkpoints or (run.exists() and not nothing):
            if self.existing == "stop":
                raise InputError(
                    f"Results('{self.folder}'): the folder holds a run{self._reached()}. Expected "
                    "another folder, existing='resume' to go on with it, or existing='replace' to "
                    "write over it"
                )
            wanted = self.existing == "resume"
            self.resumes = wanted and bool(self.checkpoints)
            finished = [one["name"] for one in known.get("phases", []) if "finished" in one]
            if wanted and not self.resumes and finished:
                raise InputError(
                    f"Results('{self.folder}'): the folder holds a run that finished {finished[-1]}, "
                    "and no checkpoint to go on from: expected its checkpoints, or existing='replace' "
                    "to start anew"
                )
            if not self.resumes:
                self._clear()
        elif not run.exists():
            others = [name for name in COPIES if self._is_other(self.folder / name)]
            if others:
                raise InputError(
                    f"Results('{self.folder}'): the folder holds '{others[0]}', which is of no run: "
                    "expected a folder of its own for the results"
                )
        result_folder(self.folder / archive.FOLDER)

    @staticmethod
    def _is_other(path: Path) -> bool:
        """Whether a file is there, and not the script that runs."""
        script, _ = provenance.driver()
        return path.exists() and not (script is not None and path.resolve() == script)

    def _known(self) -> dict[str, Any]:
        """What run.json holds; nothing where it cannot be read."""
        try:
            known = json.loads((self.folder / RUN).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return known if isinstance(known, dict) else {}

    def _reached(self) -> str:
        """How far the run in the folder has come, for a message."""
        files = self.checkpoints
        return f", last checkpoint '{files[-1].name}'" if files else ""

    def _clear(self) -> None:
        """Remove what a run wrote here, and nothing else."""
        try:
            for path in (self.folder / name for name in (RUN, LOG, *COPIES)):
                if self._is_other(path):
                    path.unlink()
            for place in self.folder.iterdir():
                kind, _, number = place.name.partition("-")
                own = kind in PHASES and (number.isdigit() or place.name == kind)
                if place.is_dir() and (own or place.name == archive.FOLDER):
                    shutil.rmtree(place)
        except OSError as error:
            raise OutputError(
                f"'{error.filename}' cannot be removed: {error.strerror}: expected a folder that can be "
                "written"
            ) from error

    def note(self, phase: str, facts: Mapping[str, Any]) -> None:
        """Add to what run.json knows of a phase; a call for the first rank."""
        run, known = self.folder / RUN, self._known()
        if not known:
            log.warning("'%s' cannot be read, and does not tell of %s", run, phase)
            return
        phases = {one["name"]: one for one in known.get("phases", [])}
        phases[phase] = phases.get(phase, {"name": phase}) | facts
        known["phases"] = list(phases.values())
        with whole_file(run) as part:
            part.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
