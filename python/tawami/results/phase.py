"""A phase of a run: one `ramp`, `settle` or `Dynamics.run`, with what observes it."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict
from time import monotonic
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tawami.base import archive
from tawami.base.errors import (
    CheckpointError,
    CheckpointWarning,
    ConvergenceError,
    OutputError,
    SingularError,
)
from tawami.base.files import result_folder
from tawami.base.ranks import any_of, raise_together
from tawami.base.signals import Interruption
from tawami.motion import pace
from tawami.motion.observer import Snapshot, Subject
from tawami.motion.pace import Pace, Step
from tawami.results import progress
from tawami.results.identity import identity
from tawami.results.provenance import now
from tawami.scene.solution import Solution

if TYPE_CHECKING:
    from pathlib import Path

    from tawami.results.results import Results

#: In the folder of results.
LOG = "log.txt"
log = logging.getLogger("tawami")


class Phase:
    """A phase of a run with results; made by `Results.phase`."""

    def __init__(
        self,
        results: Results,
        number: int,
        name: str,
        subject: Subject,
        end: float,
        unit: str,
    ) -> None:
        self.unit, self.finished = unit, False
        self.results, self.number, self.name = results, number, name
        kind = name.partition("-")[0]
        self._outputs = [o for o in results.outputs if o.phases is None or kind in o.phases]
        self.subject, self.end = subject, end
        self._comm = subject.scene.grid.comm
        self._writes = self._comm.rank == 0
        self._interruption = Interruption()
        self._line = progress.Line(results.progress if self._writes else False)
        self._open = ExitStack()
        self._pace, self._steps = Pace(0.0, 0.0), list[Step]()
        self._identity: dict[str, Any] = {}
        self._stored, self._since, self._began = 0, monotonic(), monotonic()
        #: Steps that all outputs have seen, whether the last one of the phase is among them, and whether
        #: a signal was acted on.
        self._seen, self._last, self._stopped = 0, False, False

    def __enter__(self) -> Self:
        with raise_together(self._comm):
            path = self.results.folder / LOG if self._writes else None
            self._open.enter_context(progress.logged(path))
        self._open.enter_context(self._interruption)
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        try:
            # what fails on one rank alone must not wait for the others
            alone = self._comm.size == 1 and isinstance(error, Exception)
            if alone or isinstance(error, ConvergenceError | SingularError):
                assert error is not None
                self._line.end()
                log.error("%s ended by %s: %s", self.name, type(error).__name__, error)
                if len(self._steps) == self._seen > self._stored:
                    self._write_or_warn()
                    error.add_note(
                        f"the state after the last accepted step, at {self._at}, is in "
                        f"'{self.results.folder / archive.FOLDER}'"
                    )
        finally:
            self._line.end()
            self._open.close()
        if error is None and not self._stopped and self._asked_to_stop():
            self._stop()

    @property
    def _at(self) -> str:
        return f"{self._pace.at:g} {self.unit}"

    # -- begin ---------------------------------------------------------------

    def begin(self, pace: Pace, steps: list[Step]) -> None:
        """Go on from the newest checkpoint of the phase, or begin it."""
        self._pace, self._steps, self._asked = pace, steps, pace.size
        self._identity = identity(self.subject, self.name)
        self.subject.scene.configuration.domain.newton.keep()
        folder, state = self.results.folder / self.name, self._found()
        if state is not None:
            self._restore(state)
            before, asked = state["asked"], self._asked
            if before != asked:
                pace.size = min(pace.size, asked)
                log.info("%s: steps of at most %g, no longer %g", self.name, asked, before)
        self._stored = self._seen = len(steps)
        if self.finished and not self._pace.at < self.end * (1 - 1e-12):
            log.info("%s had come to its end at %s", self.name, self._at)
            return
        self.finished = False
        with raise_together(self._comm):
            if self._writes:
                result_folder(folder)
        told = {} if state is None else state["outputs"]
        for output in self._outputs:
            output.begin(folder, self.subject, told.get(output.name))
        verb = "begins" if state is None else "goes on"
        log.info(
            "%s %s at %s, to %g: tawami on %d ranks",
            self.name, verb, self._at, self.end, self._comm.size,
        )  # fmt: skip
        if state is None:
            header = self.subject.header().splitlines()
            with raise_together(self._comm):
                if self._writes:
                    self.results.note(self.name, {"began": now(), "input": header})
            self._look(None, last=False)
        self._remaining = progress.Remaining(pace.at, self.end)
        self._since = self._began = monotonic()

    def _found(self) -> dict[str, Any] | None:
        """The newest state of this phase that can be used; None if the phase is new."""
        if not self.results.resumes:
            return None
        state: dict[str, Any] | None = None
        wrong = list[str]()
        if self._writes:
            for path in reversed(self._files()[0]):
                try:
                    state = archive.read(path, self._identity)
                    break
                except CheckpointError as problem:
                    wrong.append(str(problem))
        state, wrong = self._comm.bcast((state, wrong))
        for sentence in wrong:
            self._warn(f"{sentence}. The one before it is tried")
        if state is None and wrong:
            raise CheckpointError(f"{wrong[0]}. No other checkpoint of '{self.name}' can be used")
        return state

    def _warn(self, sentence: str) -> None:
        """Once; where warnings are errors, an error on all ranks."""
        with raise_together(self._comm):
            if self._writes:
                warnings.warn(sentence, CheckpointWarning, stacklevel=3)

    def _files(self) -> tuple[list[Path], list[Path]]:
        """Checkpoints of this phase and of later ones, oldest first."""
        of, there = archive.phase_of, self.results.checkpoints
        own = [path for path in there if of(path) == self.number]
        return own, [path for path in there if of(path) > self.number]

    def _restore(self, state: Mapping[str, Any]) -> None:
        self.subject.restore(state["scene"])
        for name, value in state["pace"].items():
            setattr(self._pace, name, value)
        self._steps[:] = pace.unpacked(state["steps"])
        self.finished = state["finished"]

    # -- steps ---------------------------------------------------------------

    def accepted(self, solution: Solution, *, last: bool) -> None:
        """Say so, and let the outputs look."""
        pace, steps, self._last = self._pace, self._steps, last
        step = steps[-1]
        momentum, volume = step.history[-1]
        measures = f"{momentum:.1e}" if volume is None else f"{momentum:.1e}, {volume:.1e}"
        count = len(solution.number)
        log.info(
            "%s: step %d to %s, size %g, %d Newton iterations to %s, %d particles",
            self.name, len(steps), self._at, step.size, step.iterations, measures, count,
        )  # fmt: skip
        parts = (
            f"{self.name} {pace.at:.6g} of {self.end:g} {self.unit}",
            f"step {len(steps)} ({step.size:.3g})",
            f"Newton {step.iterations}: {measures}",
            f"{count} particles",
            self._remaining.text(pace.at),
        )
        self._line.show(" | ".join(part for part in parts if part), now=last)
        self._look(solution, last=last)
        self._seen = len(steps)

    def checkpoint(self) -> None:
        """Write a checkpoint where one is due; end if a signal asks for it."""
        by_number, by_time = self._due()
        asked = np.array([self._interruption.signal is not None, by_time])
        stop, by_time = any_of(self._comm, asked)
        if self._last:
            self._write()
            self._finish()
        elif stop:
            self._write()
        elif by_number or by_time:
            if by_number:  # the same factorisations then, whoever goes on from here
                self.subject.scene.configuration.domain.newton.keep()
            self._write_or_warn()
        if stop:
            self._stop()

    def _asked_to_stop(self) -> bool:
        return bool(any_of(self._comm, np.array([self._interruption.signal is not None]))[0])

    def failed(self, error: Exception) -> None:
        """Say that a step failed; end if a signal asks for it."""
        log.warning(
            "%s: a step from %s failed, now %g: %s", self.name, self._at, self._pace.size, error
        )
        if self._asked_to_stop():
            if len(self._steps) > self._stored:
                self._write()
            self._stop()

    def _look(self, solution: Solution | None, *, last: bool) -> None:
        moment = Snapshot(self.subject, solution, self._pace.at, len(self._steps), last)
        for output in self._outputs:
            output.look(moment)

    def _due(self) -> tuple[bool, bool]:
        """Whether a checkpoint is due by the number of steps, and, on the first rank, by time."""
        every, minutes = self.results.checkpoint_steps, self.results.checkpoint_minutes
        by_number = every is not None and len(self._steps) % every == 0
        passed = monotonic() - self._since
        return by_number, self._writes and minutes is not None and passed >= 60 * minutes

    # -- checkpoints ---------------------------------------------------------

    def _write(self) -> None:
        """Write a checkpoint; a call for all ranks.

        Raises:
            OutputError: It cannot be written.
        """
        state = {
            "scene": self.subject.state(),
            "pace": asdict(self._pace),
            "steps": pace.packed(self._steps),
            "asked": self._asked,
            "outputs": {output.name: output.state() for output in self._outputs},
            "finished": self._last,
        }
        name = f"{self.number:02d}-{self.name}-{len(self._steps):08d}.npz"
        path = self.results.folder / archive.FOLDER / name
        with raise_together(self._comm):
            if self._writes:
                archive.write(path, self._identity, state)
                own, later = self._files()
                for old in [*own[: -self.results.keep], *later]:
                    old.unlink()
        self._stored, self._since = len(self._steps), monotonic()
        log.info("%s: checkpoint '%s'", self.name, path.name)

    def _write_or_warn(self) -> None:
        """As :meth:`_write`; a run need not end because it cannot be kept."""
        try:
            self._write()
        except OutputError as error:
            self._since = monotonic()
            self._warn(f"no checkpoint: {error}. The run goes on; the one before it is still there")

    def _finish(self) -> None:
        log.info("%s came to its end at %s in %d steps", self.name, self._at, len(self._steps))
        facts = {
            "reached": self._pace.at,
            "steps": len(self._steps),
            "seconds": monotonic() - self._began,
            "finished": now(),
        }
        with raise_together(self._comm):
            if self._writes:
                self.results.note(self.name, facts)

    def _stop(self) -> None:
        """End as the signal asks for, on all ranks."""
        self._stopped = True
        self._line.end()
        known = self._comm.allgather(self._interruption.signal)
        self._interruption.signal = next(one for one in known if one is not None)
        text = f"{self.name}: stopped by {self._interruption.signal.name} at {self._at}"
        log.warning(text)
        if self._writes:
            advice = f"go on with: tawami resume {self.results.folder}"
            with suppress(OSError, ValueError):  # a terminal that is gone
                print(f"{text}; {advice}", file=self._line.stream, flush=True)
        self._interruption.end()
