"""A phase of a run with results: one `ramp`, `settle` or `Dynamics.run`."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import asdict
from typing import Any, Self

import numpy as np

from tawami.base import archive
from tawami.base.errors import ConvergenceError, SingularError
from tawami.base.files import result_folder
from tawami.base.ranks import any_of, anywhere, raise_together
from tawami.base.signals import Interruption
from tawami.motion.observer import Snapshot, Subject
from tawami.motion.pace import Pace, Step, pack, unpack
from tawami.results import progress
from tawami.results.checkpoints import Checkpoints
from tawami.results.folder import RunFolder
from tawami.results.output import Output
from tawami.results.progress import Progress
from tawami.results.provenance import now
from tawami.scene.solution import Solution

log = logging.getLogger("tawami")


class Phase:
    """Observer of a phase (`tawami.motion.observer.Observer`); made by `Results.phase`.

    Args:
        folder: Of the run.
        name: Of the phase.
        subject: Scene or motion that is observed.
        end: Time [s] or share at which it ends.
        unit: Of that.
        outputs: Its outputs.
        checkpoints: Its checkpoints.
        shown: Whether the live line appears; None: only if standard error is a terminal.
    """

    def __init__(
        self,
        folder: RunFolder,
        name: str,
        subject: Subject,
        end: float,
        unit: str,
        outputs: Sequence[Output],
        checkpoints: Checkpoints,
        shown: bool | None,
    ) -> None:
        self.name, self.subject, self.end, self.unit = name, subject, end, unit
        self.finished = False
        self._folder, self._outputs, self._checkpoints = folder, outputs, checkpoints
        self._comm = subject.scene.grid.comm
        self._writes = self._comm.rank == 0
        self._progress = Progress(name, end, unit, shown if self._writes else False)
        self._interruption, self._open = Interruption(), ExitStack()
        self._pace, self._steps, self._largest = Pace(0.0, 0.0), list[Step](), 0.0
        #: Steps that all outputs have observed, and whether the last one of the phase is among them.
        self._seen, self._last = 0, False
        #: Whether a signal has ended the phase.
        self._stopped = False

    def __enter__(self) -> Self:
        with raise_together(self._comm):
            path = self._folder.path / progress.LOG if self._writes else None
            self._open.enter_context(progress.logged(path))
        self._open.enter_context(self._interruption)
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        try:
            # an error of one rank alone must not make it wait for the others
            alone = self._comm.size == 1 and isinstance(error, Exception)
            if alone or isinstance(error, ConvergenceError | SingularError):
                assert error is not None
                self._progress.line.end()
                log.error("%s ended by %s: %s", self.name, type(error).__name__, error)
                if len(self._steps) == self._seen > self._checkpoints.stored:
                    self._checkpoints.try_to_write(self._seen, self._state(), ends=True)
                self._note_checkpoint(error)
        finally:
            self._progress.line.end()
            self._open.close()
        if error is None and not self._stopped and self._asked_to_stop():
            self._stop()

    def _note_checkpoint(self, error: BaseException) -> None:
        """Add the place of the newest state to an error."""
        last = self._checkpoints.last()
        if last is None or not self._steps:
            return
        steps = archive.steps_of(last)
        after = f"step {steps} of {len(self._steps)}"
        if steps == len(self._steps):
            after = f"the last accepted step, at {self._at},"
        error.add_note(f"the state after {after} is in '{last}'")

    @property
    def _at(self) -> str:
        return f"{self._pace.at:g} {self.unit}"

    # -- begin ---------------------------------------------------------------

    def begin(self, pace: Pace, steps: list[Step]) -> None:
        """Resume the phase from its newest checkpoint, or begin it."""
        self._pace, self._steps, self._largest = pace, steps, pace.size
        self.subject.scene.configuration.domain.newton.record()
        # a factorisation may be there or not, and is checked where it is used
        like = (
            {"scene": self.subject.state() | {"newton": None}} if self._checkpoints.resumes else {}
        )
        state = self._checkpoints.newest(like | self._progress_state())
        if state is not None:
            with self._checkpoints.using():
                self._restore(state)
        self._seen = len(steps)
        self._checkpoints.restart(self._seen)
        if self.finished and not pace.at < self.end * (1 - 1e-12):
            log.info("%s was finished at %s", self.name, self._at)
            return
        self.finished = False
        folder = self._folder.path / self.name
        with raise_together(self._comm):
            if self._writes:
                result_folder(folder)
        written = {} if state is None else state["outputs"]
        with self._checkpoints.using() if written else nullcontext():
            for output in self._outputs:
                output.begin(folder, self.subject, written.get(output.name))
        log.info(
            "%s %s at %s, to %g: tawami on %d ranks",
            self.name, "begins" if state is None else "resumes", self._at, self.end, self._comm.size,
        )  # fmt: skip
        if state is None:
            header = self.subject.header().splitlines()
            with raise_together(self._comm):
                if self._writes:
                    self._folder.note(self.name, {"began": now(), "input": header})
            self._observe(None, last=False)
        self._progress.begin(pace.at)
        self._checkpoints.restart(self._seen)

    def _state(self) -> dict[str, Any]:
        """State for a checkpoint; a call for all ranks."""
        return {
            "scene": self.subject.state(),
            **self._progress_state(),
            "outputs": {output.name: output.state() for output in self._outputs},
        }

    def _progress_state(self) -> dict[str, Any]:
        """State of the phase without that of scene and outputs."""
        return {
            "pace": asdict(self._pace),
            "steps": pack(self._steps),
            "largest": self._largest,
            "finished": self._last,
        }

    def _restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`_state`."""
        self.subject.restore(state["scene"])
        for name, value in state["pace"].items():
            setattr(self._pace, name, value)
        self._steps[:] = unpack(state["steps"])
        self.finished = state["finished"]
        before = state["largest"]
        if before != self._largest:
            self._pace.size = min(self._pace.size, self._largest)
            log.info("%s: steps of at most %g instead of %g", self.name, self._largest, before)

    # -- steps ---------------------------------------------------------------

    def accepted(self, solution: Solution, *, last: bool) -> None:
        """Report the step; the outputs observe it."""
        steps, self._last = self._steps, last
        particles = solution.num_particles
        self._progress.step(len(steps), self._pace.at, steps[-1], particles, last=last)
        self._observe(solution, last=last)
        self._seen = len(steps)

    def _observe(self, solution: Solution | None, *, last: bool) -> None:
        snapshot = Snapshot(self.subject, solution, self._pace.at, len(self._steps), last)
        for output in self._outputs:
            output.observe(snapshot)

    def checkpoint(self) -> None:
        """Write a checkpoint if one is due; end the run if a signal asks for it."""
        count = len(self._steps)
        by_number, by_time = self._checkpoints.due(count)
        asked = np.array([self._interruption.signal is not None, by_time])
        stop, by_time = any_of(self._comm, asked)
        if self._last:
            self._checkpoints.write(count, self._state())
            self._finish()
        elif stop:
            self._checkpoints.write(count, self._state())
        elif by_number or by_time:
            if by_number:  # resumed or not, the next steps use the same factorisations
                self.subject.scene.configuration.domain.newton.record()
            self._checkpoints.try_to_write(count, self._state())
        if stop:
            self._stop()

    def failed(self, error: Exception) -> None:
        """Report the failed step; end the run if a signal asks for it."""
        log.warning(
            "%s: a step from %s failed, now %g: %s", self.name, self._at, self._pace.size, error
        )
        if self._asked_to_stop():
            if len(self._steps) > self._checkpoints.stored:
                self._checkpoints.write(len(self._steps), self._state())
            self._stop()

    # -- end -----------------------------------------------------------------

    def _finish(self) -> None:
        log.info("%s finished at %s after %d steps", self.name, self._at, len(self._steps))
        facts = {
            "reached": self._pace.at,
            "steps": len(self._steps),
            "seconds": self._progress.seconds,
            "finished": now(),
        }
        with raise_together(self._comm):
            if self._writes:
                self._folder.note(self.name, facts)

    def _asked_to_stop(self) -> bool:
        """Whether a signal has arrived on any rank."""
        return anywhere(self._comm, self._interruption.signal is not None)

    def _stop(self) -> None:
        """End the run on all ranks, as the signal would have."""
        self._stopped = True
        self._progress.line.end()
        known = self._comm.allgather(self._interruption.signal)
        self._interruption.signal = next(one for one in known if one is not None)
        text = f"{self.name}: stopped by {self._interruption.signal.name} at {self._at}"
        log.warning(text)
        if self._writes:
            with suppress(OSError, ValueError):  # the terminal was closed
                print(f"{text}; {self._folder.advice}", file=self._progress.line.stream, flush=True)
        self._interruption.end()
