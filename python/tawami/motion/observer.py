"""Observers of a run, as `ramp`, `settle` and `Dynamics.run` see them.

The argument `results=` is a :class:`Recorder`. It makes an :class:`Observer` for each phase of the run,
which is called after every step. `tawami.results` implements both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.motion.energy import Energies
from tawami.motion.pace import Pace, Step
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution


class Subject(Protocol):
    """Subject of an observer: a `Scene` in `ramp` and `settle`, a `Dynamics` in its `run`."""

    @property
    def scene(self) -> Scene:
        """The scene; of a scene, itself."""

    @property
    def motion(self) -> Motion | None:
        """The motion of the scene; None without inertia."""

    def header(self) -> str:
        """Lines for the start of a run: what is modelled."""

    def identity(self) -> dict[str, Any]:
        """Facts that decide the result, as JSON can hold them; a call for all ranks."""

    def state(self) -> dict[str, Any]:
        """State that passes from one step to the next; a call for all ranks."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`; a call for all ranks."""


class Motion(Subject, Protocol):
    """A subject with inertia; the attributes are those of `Dynamics`."""

    @property
    def energies(self) -> Energies:
        """Energy balance since the start."""

    @property
    def mass(self) -> Array:
        """Masses of the particles [kg per metre depth]."""

    @property
    def velocity(self) -> Array:
        """Velocities of the particles [m/s]."""

    @property
    def velocity_gradient(self) -> Array:
        """Velocity gradients of the particles [1/s]."""

    @property
    def on_grid(self) -> tuple[Array, Array] | None:
        """Velocity and acceleration of a grid that is not reset, functions x dim."""

    @property
    def linear_momentum(self) -> Array:
        """[kg m/s per metre depth]"""

    def angular_momentum(self) -> float:
        """About the origin [kg m2/s per metre depth]."""


@dataclass(frozen=True)
class Snapshot:
    """A run at the start of a phase (step 0) or after an accepted step.

    Attributes:
        subject: The scene, or its motion.
        solution: Of the step; None at step 0.
        time: [s]; the share of the load in `ramp`, the number of the reset in `settle`.
        step: Number of the step in the phase.
        last: Whether it is the last step of the phase.
    """

    subject: Subject
    solution: Solution | None
    time: float
    step: int
    last: bool

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.subject.scene


class Observer(Protocol):
    """Observer of one phase; a context manager around its steps."""

    #: Unit of times or shares, for messages.
    unit: str
    #: Whether the phase was completed by an earlier run; set by :meth:`begin`.
    finished: bool

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None: ...

    def begin(self, pace: Pace, steps: list[Step]) -> None:
        """Before the first step. Observer and phase share `pace` and `steps`; when a run is resumed the
        observer fills them, and restores the subject.
        """

    def accepted(self, solution: Solution, *, last: bool) -> None:
        """After an accepted step, before the `each` of the driver script."""

    def checkpoint(self) -> None:
        """After `each`: the time to write a checkpoint, or to end the run."""

    def failed(self, error: Exception) -> None:
        """After a step that failed and whose size was halved."""


class NullObserver:
    """Observer of a phase without results: does nothing.

    Args:
        unit: Of times or shares, for messages.
    """

    finished = False

    def __init__(self, unit: str) -> None:
        self.unit = unit

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        pass

    def begin(self, pace: Pace, steps: list[Step]) -> None:
        """See :class:`Observer`."""

    def accepted(self, solution: Solution, *, last: bool) -> None:
        """See :class:`Observer`."""

    def checkpoint(self) -> None:
        """See :class:`Observer`."""

    def failed(self, error: Exception) -> None:
        """See :class:`Observer`."""


@runtime_checkable
class Recorder(Protocol):
    """Object that is passed as `results=`, such as `tawami.Results`."""

    def phase(self, kind: str, subject: Subject, end: float, unit: str) -> Observer:
        """Observer of the next phase; a call for all ranks.

        Args:
            kind: 'ramp', 'settle' or 'motion'.
            subject: The scene, or its motion.
            end: Time [s] or share at which the phase ends.
            unit: Unit of `end`.
        """


def observed(
    results: Recorder | None, kind: str, subject: Subject, end: float, unit: str
) -> Observer:
    """Observer of the next phase of a run, with results or without: see :meth:`Recorder.phase`.

    Raises:
        InputError: `results` is neither a Recorder nor None.
    """
    if results is None:
        return NullObserver(unit)
    if isinstance(results, type) or not isinstance(results, Recorder):
        raise InputError(
            f"results = {checks.shown(results)}: expected tawami.Results(folder, ...), or None"
        )
    return results.phase(kind, subject, end, unit)
