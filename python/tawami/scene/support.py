"""One support: a displacement component that is prescribed along an edge or at a point."""

from __future__ import annotations

from typing import Any

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.grid.edges import Interval, Profile
from tawami.grid.grid import Edge
from tawami.scene.action import Action, Owner
from tawami.scene.factor import Factor, InTime
from tawami.scene.share import Moment

#: Difference of two factors of a displacement that is round-off.
ALIKE = 1e-9
Place = Edge | tuple[float, float]


class Support(Action):
    """One displacement component that is prescribed along an edge or at a point.

    :meth:`change` replaces its value, :meth:`release` takes it away.

    Attributes:
        place: Name of the edge, or the point (x, y) [m], which moves with the body.
        given: The same as the driver script gave it.
        component: Number of the component of the displacement, or name of another field.
        unit: Unit of its values.
        between: Part of the edge [m]; None for all of it.
        crossing: Distance by which it has moved the body across its edge [m], where particles move.
    """

    __slots__ = ("between", "component", "crossing", "given", "place", "unit")

    def __init__(
        self,
        owner: Owner[Any],
        place: Place,
        component: int | str,
        unit: str,
        value: Profile,
        factor: Factor,
        between: Interval | None = None,
    ) -> None:
        self.place = self.given = place
        self.component, self.unit = component, unit
        self.between, self.crossing = between, 0.0
        super().__init__(owner, value, factor)

    @property
    def axis(self) -> str:
        """Name of the component."""
        return self.component if isinstance(self.component, str) else "xyz"[self.component]

    def _checked(self, value: Any) -> tuple[Profile, ...]:
        check = checks.profile if isinstance(self.place, str) else checks.number
        return (check(f"{self}: value", value),)

    def change(
        self, value: Any = None, *, amplitude: InTime | None = None, velocity: InTime | None = None
    ) -> None:
        """Replace the value, the amplitude, or the velocity.

        In statics the body passes from the old to the new value as it does to a new one: at once in
        `solve`, in steps in `ramp`. In `Dynamics` a support moves by its velocity or amplitude only.

        Args:
            value: Displacement since the support was made [m] (at small strain since the start of the
                scene), as in `fix` or `hold`; the present one by default.
            amplitude: Factor, a number or a function of time [s]; the present one by default.
            velocity: A number [m/s], or a function of time [s], of a support that was given one.

        Raises:
            InputError: It was released, nothing is given, a support with a velocity gets a value or the
                reverse, or an argument is not valid; nothing has changed.
        """
        if velocity is None and not self.has_velocity:
            return super().change(value, amplitude=amplitude)
        self._check_usable("change(...)")
        if not self.has_velocity or value is not None or amplitude is not None or velocity is None:
            given = "a velocity" if self.has_velocity else "a value"
            raise InputError(
                f"{self}.change(...): it was made with {given}: expected {given}; release it and make "
                "another support for the rest"
            )
        changed = self._changed(None, None, velocity)
        self.terms.clear()  # a support that moved by a velocity does not move back
        self._begin(*changed)
        return None

    @property
    def has_velocity(self) -> bool:
        """Whether it prescribes a velocity."""
        return self.terms[-1].factor.has_velocity

    @property
    def moves(self) -> bool:
        """Whether it prescribes a motion in time."""
        return any(term.factor.moves for term in self.terms)

    @property
    def at_rest(self) -> bool:
        """Whether it prescribes a displacement of zero."""
        return not self.has_velocity and all(term.is_zero for term in self.terms)

    def is_ahead(self, now: Moment) -> bool:
        """Whether it prescribes a displacement that the body does not have at this moment.

        An old amplitude and a new one that continues it cancel.
        """
        missing = dict[tuple[Profile, ...], float]()
        for term in self.terms:
            if not (term.factor.has_velocity or term.is_zero):
                change = term.at(now) - term.share.applied
                missing[term.values] = missing.get(term.values, 0.0) + change
        return any(abs(change) > ALIKE for change in missing.values())

    def __str__(self) -> str:
        where = f"edge='{self.place}'" if isinstance(self.place, str) else f"point={self.place}"
        return f"{'fix' if isinstance(self.place, str) else 'hold'}({where})"

    @property
    def line(self) -> str:
        """The support in words: place, component, and what it prescribes if that is not zero."""
        (value,), factor = self.terms[-1].values, self.terms[-1].factor
        amount = (
            " by a function" if callable(value) else f" = {value:g} {self.unit}" if value else ""
        )
        return f"{self} {self.axis}{'' if factor.has_velocity else amount}{factor}"
