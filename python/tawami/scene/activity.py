"""The time of a scene, and what it is doing: a step must not begin within another one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tawami.base.errors import InputError

#: What a scene may be doing when a function of the driver script is called, and what to do instead.
STEP = (
    "while a step of this scene was being solved, by a law, an amplitude, a velocity or another "
    "function that the step evaluates: expected a function that returns its values and leaves the "
    "scene as it is"
)
CALLBACK = (
    "within a run of this scene, by each=... or an output: expected each=... to read the solution or to "
    "change loads and supports. Call it after the run"
)


class Activity:
    """The time of a scene, and the steps and callbacks that it is in.

    Attributes:
        time: Time at the end of the last phase of statics, or of the last dynamic step [s].
    """

    def __init__(self) -> None:
        self.time = 0.0
        self._within: list[str] = []

    @contextmanager
    def step(self, what: str) -> Iterator[None]:
        """A block that solves a step, or sets the state that a step starts from.

        Args:
            what: The call, for messages.

        Raises:
            InputError: The scene is in a step or a callback already.
        """
        self.check_idle(what)
        with self._in(STEP):
            yield

    @contextmanager
    def callback(self) -> Iterator[None]:
        """A block that calls functions of the driver script between two steps of a run."""
        with self._in(CALLBACK):
            yield

    @contextmanager
    def _in(self, what: str) -> Iterator[None]:
        self._within.append(what)
        try:
            yield
        finally:
            self._within.pop()

    def check_idle(self, what: str) -> None:
        """Check that a step or a run may begin.

        Raises:
            InputError: The scene is in a step or a callback.
        """
        if self._within:
            raise InputError(f"{what} was called {self._within[-1]}")

    def check_between_steps(self, what: str) -> None:
        """Check that loads, supports and the state of the particles may be changed.

        Raises:
            InputError: The scene is in a step.
        """
        if STEP in self._within:
            raise InputError(f"{what} was called {STEP}")
