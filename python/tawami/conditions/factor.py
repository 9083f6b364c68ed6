"""The factor in time of a load or a prescribed displacement."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.identity import text

#: A number, or a function of time [s].
InTime = float | Callable[[float], float]
#: Values of a function that are kept, so that a step calls it once for each time.
KEPT = 32


class Factor:
    """A factor that follows an amplitude, or the integral of a velocity.

    Args:
        where: The load or support, for messages.
        amplitude: Factor, constant or a function of time [s].
        velocity: Rate of the factor [1/s], in place of an amplitude.
        name: What the factor is called in messages; empty if `where` says it.
        time: Time at which it is checked [s].

    Raises:
        InputError: Both, neither a number nor a function, or a function that is not finite at `time`.
    """

    def __init__(
        self,
        where: str,
        amplitude: InTime | None = None,
        velocity: InTime | None = None,
        *,
        name: str | None = None,
        time: float = 0.0,
    ) -> None:
        if amplitude is not None and velocity is not None:
            raise InputError(f"{where}: expected an amplitude or a velocity, not both")
        self._name = "amplitude" if velocity is None else "velocity"
        said = self._name if name is None else name
        self._what = f"{where}: {said}" if said else where
        self.has_velocity = velocity is not None
        self._given: InTime = (
            (1.0 if amplitude is None else amplitude) if velocity is None else velocity
        )
        self._value = functools.lru_cache(KEPT)(self._evaluated)
        self._value(time)

    def _evaluated(self, time: float) -> float:
        given, what = self._given, self._what
        try:
            value = given(time) if callable(given) else given
        except Exception as error:
            raise InputError(
                f"{what}({time:g}) gave {error!r}: expected a function of time [s]"
            ) from error
        return checks.number(f"{what} at {time:g} s", value)

    @property
    def is_function(self) -> bool:
        """Whether it is given by a function of time."""
        return callable(self._given)

    @property
    def moves(self) -> bool:
        """Whether the factor may change in time."""
        return self.has_velocity or callable(self._given)

    def at(self, time: float) -> float:
        """The amplitude at a time; 0 with a velocity.

        Raises:
            InputError: The function fails, or its value is not a finite number.
        """
        return 0.0 if self.has_velocity else self._value(time)

    def rates(self, start: float, end: float) -> tuple[float, float]:
        """Rates of the factor at the ends of a step [1/s].

        Their mean times the length of the step is the change of the factor. For an amplitude they are
        those of the parabola through its values at the ends and in the middle.
        """
        if not self.moves:
            return 0.0, 0.0
        first, last = self._value(start), self._value(end)
        if self.has_velocity:
            return first, last
        middle, dt = self._value(0.5 * (start + end)), end - start
        return (4 * middle - 3 * first - last) / dt, (first - 4 * middle + 3 * last) / dt

    def changed(self, start: float, end: float) -> float:
        """Change of the factor in a step."""
        if self.has_velocity:
            return 0.5 * (end - start) * sum(self.rates(start, end))
        return self.at(end) - self.at(start)

    @property
    def constant(self) -> list[float]:
        """A constant amplitude, for checkpoints; nothing for a function or a velocity."""
        return [] if self.moves else [self._value(0.0)]

    def identity(self) -> list[Any]:
        """Facts that decide the results of a run, in the types of JSON."""
        return [self._name, text(self._given)]

    def __str__(self) -> str:
        if self.has_velocity:
            return " with a velocity"
        if callable(self._given):
            return " with an amplitude"
        return "" if self._given == 1.0 else f" times {self._given:g}"
