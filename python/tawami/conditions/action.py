"""Actions on a body: the common part of loads and supports, and their handles in a driver script.

An action is a sum of terms, each a value times a factor. A change replaces the last term: the old one
fades while the new one grows, so that the body passes from one to the other as it does to a new load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np

from tawami.base.errors import CheckpointError, InputError
from tawami.base.identity import text
from tawami.conditions.activity import Activity
from tawami.conditions.factor import Factor, InTime
from tawami.conditions.share import Moment, Share
from tawami.particles.following import OfParticles

#: A component of a value: a number, a function of position, or a number for each particle.
Value = Any
Acts = TypeVar("Acts", bound="Action")


@dataclass
class Term:
    """A value and its factor.

    Attributes:
        number: Number in its action, in the order in which the driver script gave them.
        values: Components of the value.
        factor: Its factor in time.
        since: Number of the term that the factor came with.
        share: Share of it that the body carries.
    """

    number: int
    values: tuple[Value, ...]
    factor: Factor
    since: int
    share: Share = field(default_factory=Share)

    def at(self, now: Moment) -> float:
        """Its factor."""
        return self.share.at(now, self.factor)

    def apply(self, now: Moment) -> None:
        """The body is in equilibrium with it."""
        self.share.applied = self.at(now)

    def accept(self, now: Moment) -> None:
        """Later parts grow from this moment."""
        self.share.carried = self.at(now)

    def changed(self, now: Moment) -> float:
        """Change of the factor in a dynamic step."""
        return self.share.target * self.factor.changed(now.start, now.time)

    def rates(self, now: Moment) -> tuple[float, float]:
        """Rates of the factor at the ends of a dynamic step [1/s]."""
        first, last = self.factor.rates(now.start, now.time)
        return self.share.target * first, self.share.target * last

    @property
    def is_zero(self) -> bool:
        """Whether its value is zero."""
        return not any(callable(value) or np.any(value) for value in self.values)


class Owner(Generic[Acts]):
    """The loads or the supports of a scene.

    Args:
        activity: Time of the scene, and what it is doing.

    Attributes:
        all: Those of the driver script.
        version: A number that changes with every change by the driver script.
    """

    def __init__(self, activity: Activity) -> None:
        self.activity = activity
        self.all: list[Acts] = []
        self.version, self._made = 0, 0

    def next_number(self) -> int:
        """Number of the next of them, in the order in which the driver script makes them."""
        self._made += 1
        return self._made

    def changed(self) -> None:
        """Note that one was added, changed or released: results computed for them are out of date."""
        self.version += 1

    def remove(self, action: Any) -> None:
        """Remove one that was released."""
        self.all = [one for one in self.all if one is not action]
        self.changed()

    def accept(self, now: Moment) -> None:
        """Later parts grow from this moment."""
        for action in self.all:
            action.accept(now)


class Action:
    """A load or a support of a scene, as the methods of `Scene` return it.

    Args:
        owner: The loads or the supports that it belongs to.
        value: As the driver script gave it.
        factor: Its factor in time.
    """

    __slots__ = ("_made", "_owner", "number", "released", "terms")

    def __init__(self, owner: Owner[Any], value: Any, factor: Factor) -> None:
        self._owner, self._made, self.released = owner, 0, False
        values = self._checked(value)
        self.number = owner.next_number()
        self.terms: list[Term] = []
        self._begin(values, factor)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self}{', released' if self.released else ''})"

    def _checked(self, value: Any) -> tuple[Value, ...]:
        """The components of a value.

        Raises:
            InputError: It is not one of this action.
        """
        raise NotImplementedError

    def _begin(self, values: tuple[Value, ...], factor: Factor) -> None:
        """Replace the last term by another one."""
        kept = [term.since for term in self.terms if term.factor is factor]
        for term in self.terms:
            term.share.target = 0.0
        self.terms = [term for term in self.terms if not term.share.is_gone]
        self.terms.append(Term(self._made, values, factor, kept[-1] if kept else self._made))
        self._made += 1
        self._owner.changed()

    def _check_usable(self, what: str) -> None:
        if self.released:
            raise InputError(f"{self}.{what} was called after its release: expected a new one")
        self._owner.activity.check_between_steps(f"{self}.{what}")

    def change(self, value: Any = None, *, amplitude: InTime | None = None) -> None:
        """Replace the value, the amplitude, or both.

        In statics the body passes from the old to the new value as it does to a new load: at once in
        `solve`, in steps in `ramp`. In dynamics a load changes with the next step.

        Args:
            value: As in the call that made it; the present one by default.
            amplitude: Factor, a number or a function of time [s]; the present one by default.

        Raises:
            InputError: It was released, neither is given, or one is not valid; nothing has changed.
        """
        self._check_usable("change(...)")
        if value is None and amplitude is None:
            raise InputError(f"{self}.change(): expected a value, an amplitude, or both")
        self._begin(*self._changed(value, amplitude, None))

    def _changed(
        self, value: Any, amplitude: InTime | None, velocity: InTime | None
    ) -> tuple[tuple[Value, ...], Factor]:
        """Values and factor after a change."""
        last = self.terms[-1]
        values = last.values if value is None else self._checked(value)
        if amplitude is None and velocity is None:
            return values, last.factor
        return values, Factor(str(self), amplitude, velocity, time=self._owner.activity.time)

    def release(self) -> None:
        """Remove it. In statics a load fades as a new one grows; a support is removed at once.

        Raises:
            InputError: It was released before.
        """
        self._check_usable("release()")
        self.released = True
        for term in self.terms:
            term.share.target = 0.0
        self._owner.remove(self)

    # -- steps ---------------------------------------------------------------

    def apply(self, now: Moment) -> None:
        """The body is in equilibrium with it."""
        for term in self.terms:
            term.apply(now)

    def accept(self, now: Moment) -> None:
        """Let later parts grow from this moment; drop terms that have faded."""
        for term in self.terms:
            term.accept(now)
        self.terms = [t for t in self.terms if not t.share.is_gone or t is self.terms[-1]]

    # -- identity, checkpoints -----------------------------------------------

    def identity(self) -> list[Any]:
        """Facts that decide the results of a run, in the types of JSON."""
        return [
            [
                *map(_fact, term.values),
                *term.factor.identity(),
                term.share.target,
            ]
            for term in self.terms
        ]

    def state(self) -> dict[str, Any]:
        """The share that the body carries."""
        terms = [
            {
                "number": term.number,
                "since": term.since,
                "share": term.share.state(),
                "values": [_stored(value) for value in term.values],
                "factor": term.factor.constant,
            }
            for term in self.terms
        ]
        return {
            "number": self.number, "made": self._made, "released": self.released, "terms": terms
        }  # fmt: skip

    def _restored(self, stored: Any) -> Value:
        """A value of a checkpoint."""
        return stored[0]

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: It was changed to a function during the run.
        """
        known = {term.number: term for term in self.terms}
        factors = {term.since: term.factor for term in self.terms}
        name, self.terms = f"{self}", []
        for stored in state["terms"]:
            number, since, values = stored["number"], stored["since"], stored["values"]
            factor = factors.get(since)
            if factor is None and stored["factor"]:
                factor = Factor(name, *stored["factor"])
            term = known.get(number)
            if factor is None or (term is None and not all(values)):
                raise CheckpointError(
                    f"{name} was changed to a function or another velocity during the run (each=): "
                    "expected such changes between two phases, or an amplitude"
                )
            given = (self._restored(value) for value in values)
            term = term or Term(number, tuple(given), factor, since)
            term.share.restore(stored["share"])
            self.terms.append(term)
        if not self.terms:
            raise CheckpointError(f"{name} has no value in the checkpoint: expected one")
        self._made, self.released = state["made"], state["released"]


def _stored(value: Value) -> Any:
    """A value for a checkpoint; nothing of a function."""
    if isinstance(value, OfParticles):
        return value.state()
    return [] if callable(value) else [float(value)]


def _fact(value: Value) -> Any:
    """A value as JSON holds it, to compare it."""
    if isinstance(value, OfParticles):
        return value.identity()
    return text(value) if callable(value) else float(value)


def restored(what: str, actions: Sequence[Acts], stored: Sequence[Mapping[str, Any]]) -> list[Acts]:
    """Restore loads or supports; those that the script has released and that have faded are left out.

    Raises:
        CheckpointError: The script has made others.
    """
    states = {state["number"]: state for state in stored}
    left = [action for action in actions if action.number in states or not action.released]
    if [action.number for action in left] != list(states):
        raise CheckpointError(
            f"the run had {len(stored)} {what}s when it was stored, and the script made {len(left)}, or "
            f"others. They were added or released during the run (each=): expected {what}s to be added "
            "and released between two phases"
        )
    for action in left:
        action.restore(states[action.number])
    return left
