"""One support: a displacement component that is prescribed on the border or at a point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami.base import checks, stored
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError
from tawami.base.known import Known
from tawami.border.tied import NORMAL, TANGENT, directions
from tawami.conditions.action import Action, Owner
from tawami.conditions.factor import Factor, InTime
from tawami.conditions.share import Moment
from tawami.domain.moving_points import MovingPoints
from tawami.grid.edges import Profile
from tawami.grid.grid import Edge, Grid

#: Difference of two factors of a displacement that is round-off.
ALIKE = 1e-9
#: A part of the border, which moves with the body; a point; or an edge of the grid, for the axis of
#: symmetry and for bodies without a border.
Place = MovingPoints | tuple[float, float] | Edge
#: Components of the displacement along the border, by their names.
LOCAL = (NORMAL, TANGENT)


class Support(Action):
    """One displacement component, or field, that is prescribed on the border or at a point.

    :meth:`change` replaces its value, :meth:`release` takes it away.

    Attributes:
        place: Where it acts.
        given: The place as the driver script gave it, in words, or as a point.
        component: Number of the component of the displacement, 'normal', 'tangent', or name of a field.
        unit: Unit of its values.
        held: Tractions that held each other point in the last step [Pa], as multipliers.
        told: Whether a warning was issued that it does not hold what it should.
    """

    __slots__ = (
        "_at_place",
        "_of_points",
        "_whole",
        "component",
        "given",
        "held",
        "place",
        "told",
        "unit",
    )

    def __init__(
        self,
        owner: Owner[Any],
        place: Place,
        given: str | tuple[float, float],
        component: int | str,
        unit: str,
        value: Profile,
        factor: Factor,
        whole: Mapping[Edge, Mask] | None = None,
    ) -> None:
        self.place, self.given = place, given
        self.component, self.unit, self.told = component, unit, False
        self._whole: Mapping[Edge, Mask] = {} if whole is None else whole
        #: Values that depend on the positions of its points, and on their numbers alone.
        self._at_place, self._of_points = Known(), Known()
        count = len(place) if isinstance(place, MovingPoints) else 0
        self.held = np.zeros(count)
        super().__init__(owner, value, factor)

    @property
    def axis(self) -> str:
        """Name of the component."""
        return self.component if isinstance(self.component, str) else "xyz"[self.component]

    @property
    def places(self) -> list[tuple[float, float]]:
        """The point that it holds, where it is and as the driver script gave it."""
        return [place for place in (self.place, self.given) if isinstance(place, tuple)]

    @property
    def whole(self) -> dict[Edge, Mask]:
        """Edges of the grid that its part of the border covered as far as the body touched them, each
        with the mask of its points there. On these it prescribes coefficients of the grid.
        """
        place = self.place
        if not isinstance(place, MovingPoints):
            return {}

        def whole() -> dict[Edge, Mask]:
            left = {edge: mask[place.number] for edge, mask in self._whole.items()}
            return {edge: mask for edge, mask in left.items() if mask.any()}

        return self._of_points.of([place.number], "whole", whole)

    @property
    def is_field(self) -> bool:
        """Whether it prescribes a field other than the displacement."""
        return isinstance(self.component, str) and self.component not in LOCAL

    def along_edge(self, edge: Edge, grid: Grid) -> tuple[int, float]:
        """Number and sign of its component of the displacement on an edge of the grid."""
        axis, end = grid.edge(edge)
        outward = 1.0 if end else -1.0
        if self.component == NORMAL:
            return axis, outward
        if self.component == TANGENT:  # counter-clockwise around the body
            return 1 - axis, outward if axis == 0 else -outward
        assert isinstance(self.component, int)
        return self.component, 1.0

    @property
    def of_field(self) -> str:
        """Name of the field that it prescribes; empty for the displacement."""
        return str(self.component) if self.is_field else ""

    def directions(self, normals: Array) -> Array:
        """Unit vectors of its component of the displacement, points x dim; 1 for a field.

        Args:
            normals: Outward normals of a border, points x dim.
        """
        if self.is_field:
            return np.ones((len(normals), 1))
        assert isinstance(self.place, MovingPoints)
        return np.asarray(directions(self.place.space, [self.axis], normals)[0])

    @property
    def edges(self) -> list[Edge]:
        """Edges of the grid on which it prescribes coefficients: those that its points still lie on."""
        if isinstance(self.place, str):
            return [self.place]
        if not isinstance(self.place, MovingPoints):
            return []
        place = self.place

        def edges() -> list[Edge]:
            return [edge for edge, mask in self.whole.items() if place.edge(edge)[mask].all()]

        return self._at_place.of([place.x, place.number], "edges", edges)

    @property
    def names(self) -> dict[str, set[Edge]]:
        """Parts of the border that it covers, each with the edges of the grid that it is held on."""
        place, held = self.place, self.edges
        if not isinstance(place, MovingPoints):
            return {}

        def names() -> dict[str, set[Edge]]:
            made, on = place.made, [(edge, self.whole[edge]) for edge in held]
            tags = {made.names[tag]: made.tag == tag for tag in np.unique(made.tag)}
            return {name: {e for e, mask in on if (mask & of).any()} for name, of in tags.items()}

        return self._of_points.of([place.number], ("names", *held), names)

    @property
    def weak(self) -> Mask:
        """Mask of its points on the border that it holds by tractions on patches."""
        place, held = self.place, self.edges
        if not isinstance(place, MovingPoints):
            return np.zeros(0, dtype=bool)

        def weak() -> Mask:
            mask = np.ones(len(place), dtype=bool)
            for edge in held:
                mask &= ~self.whole[edge]
            return mask

        return self._of_points.of([place.number], ("weak", *held), weak)

    def keep(self, kept: Indices) -> None:
        """Keep some of its points of the border; those of removed particles are lost, others divided."""
        self.held = self.held[kept]

    def _checked(self, value: Any) -> tuple[Profile, ...]:
        check = checks.number if isinstance(self.place, tuple) else checks.profile
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
    def is_uniform(self) -> bool:
        """Whether it prescribes the same value everywhere."""
        return not any(callable(value) for term in self.terms for value in term.values)

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

    def state(self) -> dict[str, Any]:
        """Position of a point, multipliers, and the share of its values that the body carries."""
        place = self.place if isinstance(self.place, tuple) else ()
        return super().state() | {"place": place, "held": np.array(self.held)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: As for other actions, or arrays of another length.
        """
        super().restore(state)
        if isinstance(self.place, tuple):
            x, y = stored.values(f"{self}: place", state["place"], (len(self.place),))
            self.place = (float(x), float(y))
        shape = (len(self.place) if isinstance(self.place, MovingPoints) else 0,)
        self.held = stored.values(f"{self}: held", state["held"], shape)

    def __str__(self) -> str:
        if isinstance(self.place, tuple):
            return f"hold(point={self.place})"
        return f"fix({self.given})"

    @property
    def line(self) -> str:
        """The support in words: place, component, and what it prescribes if that is not zero."""
        (value,), factor = self.terms[-1].values, self.terms[-1].factor
        amount = (
            " by a function" if callable(value) else f" = {value:g} {self.unit}" if value else ""
        )
        return f"{self} {self.axis}{'' if factor.has_velocity else amount}{factor}"
