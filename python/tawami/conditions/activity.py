"""The time and the activity of a scene: a step must not begin within another one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tawami.base.errors import InputError


class Activity:
    """The time of a scene, and whether it is in a step or in a callback of a run.

    Attributes:
        time: Time at the end of the last phase of statics, or of the last dynamic step [s].
        statics: Number of states that static steps or a checkpoint have given to the scene.
    """

    def __init__(self) -> None:
        self.time, self.statics = 0.0, 0
        self._in_step = self._in_callback = False

    @contextmanager
    def step(self, what: str) -> Iterator[None]:
        """A block that solves a step, or sets the state that a step starts from.

        Args:
            what: The call, for messages.

        Raises:
            InputError: The scene is in a step or a callback already.
        """
        self.check_idle(what)
        self._in_step = True
        try:
            yield
        finally:
            self._in_step = False

    @contextmanager
    def callback(self) -> Iterator[None]:
        """A block that calls functions of the driver script between two steps of a run."""
        self._in_callback = True
        try:
            yield
        finally:
            self._in_callback = False

    def check_idle(self, what: str) -> None:
        """Check that a step or a run may begin.

        Raises:
            InputError: The scene is in a step or a callback.
        """
        self.check_between_steps(what)
        if self._in_callback:
            raise InputError(
                f"{what} was called within a run of this scene, by each=... or an output: expected "
                "each=... to read the solution or to change loads and supports. Call it after the run"
            )

    def check_between_steps(self, what: str) -> None:
        """Check that loads, supports and the state of the particles may be changed.

        Raises:
            InputError: The scene is in a step.
        """
        if self._in_step:
            raise InputError(
                f"{what} was called while a step of this scene was being solved, by a law, an "
                "amplitude, a velocity or another function that the step evaluates: expected a function "
                "that returns its values and does not change the scene"
            )
