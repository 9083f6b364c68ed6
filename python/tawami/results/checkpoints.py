"""Checkpoints of a phase of a run: when they are written, how many are kept, which one is read."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

from tawami.base import archive, checks
from tawami.base.errors import CheckpointError, CheckpointWarning, OutputError, TawamiError
from tawami.base.files import writing
from tawami.base.identity import differences, not_compared
from tawami.base.ranks import raise_together, same
from tawami.motion.observer import Subject
from tawami.motion.pace import check as check_pace

log = logging.getLogger("tawami")


@dataclass(frozen=True)
class Schedule:
    """When checkpoints are written, and how many are kept.

    Attributes:
        steps: Accepted steps between two; None for none by number.
        minutes: Wall time between two [min]; None for none by time.
        keep: Checkpoints of a phase that are kept.

    Raises:
        InputError: A number out of its range.
    """

    steps: int | None
    minutes: float | None
    keep: int

    def __post_init__(self) -> None:
        if self.steps is not None:
            checks.whole_number("checkpoint_steps", self.steps, low=1)
        if self.minutes is not None:
            checks.number("checkpoint_minutes", self.minutes, low=0.0)
        checks.whole_number("keep", self.keep, low=1)


class Checkpoints:
    """Checkpoints of one phase; most methods are calls for all ranks.

    Args:
        folder: Of the run.
        number: Of the phase in the run.
        phase: Its name.
        subject: Scene or motion that is observed.
        schedule: When they are written.
        resumes: Whether the run is resumed: the phase begins from its newest checkpoint.

    Attributes:
        stored: Number of steps of the newest one.
    """

    def __init__(
        self,
        folder: Path,
        number: int,
        phase: str,
        subject: Subject,
        schedule: Schedule,
        *,
        resumes: bool,
    ) -> None:
        self.folder, self.number, self.phase, self.schedule = folder, number, phase, schedule
        self.resumes, self.stored = resumes, 0
        self._comm = subject.scene.grid.comm
        facts = {"phase": phase} | subject.identity()
        self._identity: dict[str, Any] = json.loads(json.dumps(facts))  # as it is read back
        self._since = monotonic()
        self._source: Path | None = None

    def newest(self, like: Mapping[str, Any]) -> dict[str, Any] | None:
        """The newest state that can be used; None if the phase starts from its beginning.

        Args:
            like: A state of this program, to which entries of that name are compared in kind.

        Raises:
            CheckpointError: There are checkpoints, and none of them can be used.

        Warns:
            CheckpointWarning: One cannot be used; the one before it is tried. Or values that functions
                of the script read cannot be compared.
        """
        if not self.resumes:
            return None
        state: dict[str, Any] | None = None
        problems, unknown = list[str](), list[str]()
        files = same(self._comm, self._files()[0] if self._comm.rank == 0 else [])
        for path in reversed(files):
            try:
                state, unknown = self._read(path, like)
                break
            except CheckpointError as error:
                problems.append(str(error))
        for problem in problems[: len(files) - 1]:
            self._warn(f"{problem}. The checkpoint before it is tried")
        if state is None and problems:
            raise CheckpointError(
                f"{problems[0]}. No other checkpoint of '{self.phase}' can be used"
            )
        self._source = files[-1 - len(problems)] if files else None
        if unknown:
            self._warn(
                f"'{self.phase}' is resumed, and these values cannot be compared with those of the "
                f"interrupted run: {'; '.join(unknown)}. Make sure that they are the same"
            )
        return state

    @contextmanager
    def using(self) -> Iterator[None]:
        """The block uses the state of :meth:`newest`: an error in it is one of the checkpoint."""
        try:
            yield
        except TawamiError:
            raise
        except Exception as error:
            raise archive.unusable(self._source, error) from error

    def _read(self, path: Path, like: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
        """The state of a checkpoint of this run, and the names of values that could not be compared."""
        written, state = archive.read(path, self._comm)
        for name, other, own in differences(written, self._identity):
            raise CheckpointError(
                f"checkpoint '{path}' belongs to another run: {name} is {_short(other)} there and "
                f"{_short(own)} here. Expected the same scene; start a new run with existing='replace'"
            )
        with raise_together(self._comm):
            try:
                archive.check_particles(state["scene"]["particles"])
                archive.check_like({name: state[name] for name in like}, like, "")
                check_pace(state["pace"], state["steps"])
                outputs: dict[str, Any] = {name: {} for name in state["outputs"]}
                archive.check_like(state["outputs"], outputs, "outputs")
            except (AttributeError, LookupError, TypeError, ValueError) as error:
                raise archive.unusable(path, error) from error
        return state, list(dict.fromkeys(not_compared(written, self._identity)))

    def restart(self, steps: int) -> None:
        """Count steps and minutes from now on."""
        self.stored, self._since = steps, monotonic()

    def due(self, steps: int) -> tuple[bool, bool]:
        """Whether one is due by the number of steps, and by time; the latter on the first rank only."""
        every, minutes = self.schedule.steps, self.schedule.minutes
        by_number = every is not None and steps % every == 0
        passed = monotonic() - self._since
        by_time = minutes is not None and passed >= 60 * minutes
        return by_number, by_time and self._comm.rank == 0

    def write(self, steps: int, state: Mapping[str, Any]) -> None:
        """Write a checkpoint; remove old ones, and those of later phases.

        Raises:
            OutputError: It cannot be written.
        """
        path = self.folder / archive.FOLDER / archive.name_of(self.number, self.phase, steps)
        archive.write(path, self._identity, state, self._comm)
        with raise_together(self._comm):
            if self._comm.rank == 0:
                own, later = self._files()
                with writing(path.parent):
                    for old in [*own[: -self.schedule.keep], *later]:
                        old.unlink()
        self.restart(steps)
        log.info("%s: checkpoint '%s'", self.phase, path.name)

    def try_to_write(self, steps: int, state: Mapping[str, Any], *, ends: bool = False) -> None:
        """As :meth:`write`, with a warning instead of an error.

        Args:
            steps: Number of steps.
            state: The state after them.
            ends: Whether the run ends.

        Warns:
            CheckpointWarning: It cannot be written.
        """
        try:
            self.write(steps, state)
        except OutputError as error:
            self._since = monotonic()
            last = self.last()
            kept = "there is none yet" if last is None else f"the last one is '{last}'"
            continues = "" if ends else ". The run continues"
            self._warn(f"no checkpoint: {error}; {kept}{continues}")

    def last(self) -> Path | None:
        """The newest checkpoint of this phase in the folder; a call for all ranks."""
        path = None
        if self._comm.rank == 0:
            path = next(reversed(self._files()[0]), None)
        found: Path | None = self._comm.bcast(path)
        return found

    def _files(self) -> tuple[list[Path], list[Path]]:
        """Checkpoints of this phase and of later ones, oldest first."""
        of, found = archive.phase_of, archive.files(self.folder)
        own = [path for path in found if of(path) == self.number]
        return own, [path for path in found if of(path) > self.number]

    def _warn(self, text: str) -> None:
        """Warn on the first rank; where warnings are errors, raise on all ranks."""
        with raise_together(self._comm):
            if self._comm.rank == 0:
                warnings.warn(text, CheckpointWarning, stacklevel=3)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
