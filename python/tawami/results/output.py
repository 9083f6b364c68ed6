"""Outputs of a run: times at which they write, and their state when a run is resumed.

    tawami.ParticleOutput("stress", "velocity", every=0.01)
    tawami.GridOutput("displacement", "mean stress", every=0.05)
    tawami.TableOutput("energies", "reaction left")

Names and units of quantities: `tawami.quantities.quantities`, `tawami.results.grid_quantities`,
`tawami.results.columns`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tawami.base import archive, checks
from tawami.base.errors import CheckpointError, InputError
from tawami.base.ranks import raise_together
from tawami.motion.observer import Snapshot, Subject
from tawami.quantities.quantities import Given, Quantity

#: Kinds of phases of a run.
PHASES = ("ramp", "settle", "motion")


class Output:
    """Writes quantities when they are due: at the start and at the end of a phase, and in between at
    every step, at every n-th step, or at the first step at or after each multiple of a time.

    Args:
        names: Quantities; a usual set if none is named.
        every: Time [s], or share of the load in `ramp`.
        every_steps: Number of steps, instead of a time.
        name: Of the files.
        phases: Kinds of phases that are observed: 'ramp', 'settle', 'motion'; all by default.

    Attributes:
        takes_quantities: Whether a name can be a :class:`tawami.Quantity`.

    Raises:
        InputError: Not names, both a time and a number of steps, or one of them out of its range.
    """

    takes_quantities = True

    def __init__(
        self,
        names: Sequence[Given],
        every: float | None,
        every_steps: int | None,
        name: str,
        phases: Sequence[str] | None = None,
    ) -> None:
        kinds = "names of quantities" + (
            " or tawami.Quantity(...)" if self.takes_quantities else ""
        )
        for given in names:
            if not (
                isinstance(given, str) or (self.takes_quantities and isinstance(given, Quantity))
            ):
                raise InputError(
                    f"{type(self).__name__}(..., {checks.shown(given)}, ...): expected {kinds}"
                )
        if every is not None and every_steps is not None:
            raise InputError("every and every_steps are both given: expected one of them")
        if not isinstance(name, str) or checks.path("name", name).name != name or not name:
            raise InputError(
                f"name = {checks.shown(name)}: expected the name of a file without its ending"
            )
        self.names, self.name = tuple(names), name
        self.phases = None if phases is None else checks.names("phases", phases, PHASES)
        self._every = None if every is None else checks.number("every", every, low=checks.LEAST)
        self._steps = checks.whole_number(
            "every_steps", 1 if every_steps is None else every_steps, low=1
        )
        #: Numbers of the last step observed and of the last step written, and the time of the former.
        self._seen, self._written, self._time = -1, -1, math.nan
        #: Multiples of `every` that have passed.
        self._multiple = -math.inf

    def begin(self, folder: Path, subject: Subject, state: dict[str, Any] | None) -> None:
        """Begin a phase; a call for all ranks.

        Args:
            folder: Of the phase.
            subject: Scene or motion that is observed.
            state: Result of :meth:`state` for the checkpoint from which the run is resumed; later
                files are removed. None for a new phase.

        Raises:
            NotModelledError, InputError: A quantity that the scene does not have, or an unknown one.
            OutputError: The folder cannot be written.
            CheckpointError: The state is not that of an output.
        """
        state = state or {}
        _check_state(self.name, state)
        self._seen, self._written = state.get("seen", -1), state.get("written", -1)
        self._multiple = state.get("multiple", -math.inf)
        if self._every is not None and state.get("every") not in (None, self._every):
            self._multiple = self._multiples(state["time"])
        self._time = state.get("time", math.nan)
        self._resolve(subject)
        comm = subject.scene.grid.comm
        with raise_together(comm):
            if comm.rank == 0:
                self._open(folder, self._seen if state else None, subject)

    def observe(self, snapshot: Snapshot) -> None:
        """Write the output if it is due; a call for all ranks, for every snapshot of a phase.

        Raises:
            OutputError: A file cannot be written; files written before still open.
        """
        again = snapshot.step <= self._seen  # in a resumed run
        due = not again and self._due(snapshot)
        if due or (snapshot.last and self._written != snapshot.step):
            self._write(snapshot, 0.0 if snapshot.step == 0 else snapshot.time - self._time)
            self._written = snapshot.step
        if not again:
            self._seen, self._time = snapshot.step, snapshot.time

    def state(self) -> dict[str, Any]:
        """Plain numbers for a checkpoint."""
        if self._seen < 0:
            return {}
        known: dict[str, Any] = {"seen": self._seen, "written": self._written, "time": self._time}
        if math.isfinite(self._multiple):
            known |= {"multiple": self._multiple, "every": self._every}
        return known

    def _due(self, snapshot: Snapshot) -> bool:
        if self._every is None:
            return snapshot.step % self._steps == 0
        multiple = self._multiples(snapshot.time)
        due = multiple > self._multiple
        self._multiple = max(multiple, self._multiple)
        return due

    def _multiples(self, time: float) -> int:
        """Multiples of `every` up to a time. The tolerance is for sums of steps, as 3 * 0.1 =
        0.30000000000000004.
        """
        assert self._every is not None
        return math.floor(time / self._every * (1 + 1e-12) + 1e-9)

    def _resolve(self, subject: Subject) -> None:
        """Find the quantities of the names in a scene or motion."""
        raise NotImplementedError

    def _open(self, folder: Path, last: int | None, subject: Subject) -> None:
        """Begin the files, or keep what was written up to a step; on the first rank."""
        raise NotImplementedError

    def _write(self, snapshot: Snapshot, size: float) -> None:
        """Write a snapshot, `size` after the one before; a call for all ranks."""
        raise NotImplementedError


def _check_state(name: str, state: dict[str, Any]) -> None:
    """Check the state of an output in a checkpoint: all its numbers, or nothing."""
    known = {"seen": 0, "written": 0, "time": 0.0}
    known |= {"multiple": 0, "every": 0.0} if "every" in state else {}
    try:
        archive.check_like(state, known if state else {}, f"output '{name}'")
    except ValueError as error:
        raise CheckpointError(
            f"the checkpoint cannot be used ({error}): its content is not that of a checkpoint. Remove "
            "it to resume from the one before it, or start a new run with existing='replace'"
        ) from None
