"""The share of a load or of a prescribed displacement that the body carries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tawami.conditions.factor import Factor


@dataclass(frozen=True)
class Moment:
    """Position in a phase.

    Attributes:
        part: Share of the new loads that has been applied, from 0 to 1; 1 in dynamics.
        start: Time at the start of the phase, or of the dynamic step [s].
        time: Present time [s].
    """

    part: float
    start: float
    time: float


@dataclass
class Share:
    """The factor of a value, from the part that the body carries to the whole value.

    Attributes:
        target: 1; 0 once it was replaced or released.
        carried: Factor from which later parts grow: the body was in equilibrium with it.
        applied: Factor for which the last equilibrium was found.
    """

    target: float = 1.0
    carried: float = 0.0
    applied: float = 0.0

    def at(self, now: Moment, factor: Factor) -> float:
        """The factor, and the difference from it at the start, which fades."""
        wanted = self._wanted(factor, now.time)
        if now.part == 1.0:
            return wanted
        return wanted - (1 - now.part) * (self._wanted(factor, now.start) - self.carried)

    def _wanted(self, factor: Factor, time: float) -> float:
        return self.target * factor.at(time) if self.target else 0.0

    @property
    def is_gone(self) -> bool:
        """Whether none of it is prescribed or carried."""
        return not (self.target or self.carried or self.applied)

    def state(self) -> dict[str, float]:
        """The values for a checkpoint."""
        return dict(vars(self))

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`."""
        vars(self).update(state)
