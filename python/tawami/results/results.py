"""Results of a run: its folder, its outputs, its checkpoints.

Each `ramp`, `settle` or `Dynamics.run` with `results=` is a phase of the run. To resume a run, start its
script again with `existing='resume'`: it is executed from its top, finished phases are not solved again
but loaded, and the interrupted phase continues from its newest checkpoint.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import ClassVar, Literal, get_args

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.ranks import raise_together
from tawami.motion.observer import Subject
from tawami.results import provenance
from tawami.results.checkpoints import Checkpoints, Schedule
from tawami.results.folder import RunFolder
from tawami.results.output import Output
from tawami.results.phase import Phase

Existing = Literal["stop", "replace", "resume"]
#: Environment variable that takes precedence over `existing`: how `tawami resume` starts a script.
EXISTING = "TAWAMI_EXISTING"


class Results:
    """Folder, outputs and checkpoints of a run.

    Args:
        folder: Created if it does not exist.
        outputs: `ParticleOutput`, `BorderOutput`, `GridOutput` and `TableOutput` objects.
        checkpoint_steps: Accepted steps between checkpoints; None for none by number.
        checkpoint_minutes: Wall time between checkpoints [min]; None for none by time. One is always
            written at the end of a phase, on SIGTERM and Ctrl-C, and on an error that ends the run.
        keep: Checkpoints of a phase that are kept.
        existing: Treatment of a run in the folder: 'stop' with an error, 'replace' it, or 'resume'
            it. The environment variable TAWAMI_EXISTING takes precedence.
        progress: Show a live line on standard error, or a bar in a notebook; by default if there is
            a terminal or a notebook.

    Raises:
        InputError: A parameter out of its range.
    """

    #: Number of phases that have begun in this process.
    begun: ClassVar[int] = 0

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
        self.schedule = Schedule(checkpoint_steps, checkpoint_minutes, keep)
        variable = os.environ.get(EXISTING)
        chosen = checks.choice(
            "existing" if variable is None else EXISTING,
            existing if variable is None else variable,
            get_args(Existing),
        )
        self.progress = None if progress is None else checks.switch("progress", progress)
        self._run = RunFolder(self.folder, chosen)
        self._phases: list[str] = []
        self._resumes = False

    @property
    def checkpoints(self) -> list[Path]:
        """Checkpoints in the folder, oldest first."""
        return self._run.checkpoints

    def phase(self, kind: str, subject: Subject, end: float, unit: str) -> Phase:
        """Observer of the next phase; see `tawami.motion.observer.Recorder`.

        Raises:
            InputError: The folder holds a run, and `existing` is 'stop'; another process or another
                Results writes into it.
            OutputError: The folder cannot be written.
        """
        Results.begun += 1
        comm = subject.scene.grid.comm
        first = not self._phases
        with raise_together(comm):
            if comm.rank == 0:
                if first:
                    self._resumes = self._run.open()
                else:
                    self._run.check()
        if first:
            self._resumes = comm.bcast(self._resumes)
            if not self._resumes:
                provenance.write(self.folder, subject)
        before = sum(name.partition("-")[0] == kind for name in self._phases)
        name = f"{kind}-{before + 1}" if before else kind
        self._phases.append(name)
        checkpoints = Checkpoints(
            self.folder, len(self._phases), name, subject, self.schedule, resumes=self._resumes
        )
        outputs = [o for o in self.outputs if o.phases is None or kind in o.phases]
        return Phase(self._run, name, subject, end, unit, outputs, checkpoints, self.progress)
