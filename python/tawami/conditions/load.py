"""One load: the weight, a traction, pressure or flux on the border, forces on particles."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks, ranks
from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.conditions.action import Action, Owner, Term, Value
from tawami.conditions.factor import Factor
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints
from tawami.grid.edges import evaluate
from tawami.grid.grid import Grid
from tawami.particles.following import OfParticles

Numbers = npt.NDArray[np.integer[Any]]


class Load(Action):
    """A load of a scene: :meth:`change` replaces its value, :meth:`release` takes it away."""

    __slots__ = ()

    @property
    def line(self) -> str:
        """The load in words, for the header of a run."""
        return f"{self}{self.terms[-1].factor}{' until it fades' if self.released else ''}"

    def place(self) -> list[Any]:
        """Place where it acts, in the types of JSON."""
        return []


class Weight(Load):
    """The weight of the body; its values are the components of an acceleration [m/s2]."""

    __slots__ = ("_hoop",)

    def __init__(self, owner: Owner[Any], grid: Grid, value: Any, factor: Factor) -> None:
        self._hoop = grid.space.hoop
        super().__init__(owner, value, factor)

    def _checked(self, value: Any) -> tuple[Value, ...]:
        given = checks.point("gravity", value)
        if self._hoop and given[0] != 0:
            raise InputError(
                f"gravity = {checks.shown(value)}: expected (0, g) in axisymmetry, along the axis; a "
                "weight across it is not axisymmetric"
            )
        return given

    @property
    def acceleration(self) -> Array:
        """The acceleration in the driver script [m/s2]."""
        return np.array(self.terms[-1].values if not self.released else np.zeros(2), dtype=float)

    def __str__(self) -> str:
        b = ", ".join(f"{component:g}" for component in self.terms[-1].values)
        return f"gravity ({b}) m/s2"


class OnBorder(Load):
    """A load on a part of the border of the body.

    Attributes:
        points: Points of this part, which move with the body.
        where: The part in words.
    """

    __slots__ = ("points", "where")
    #: The method of a scene that makes it.
    call: str

    def __init__(
        self, owner: Owner[Any], points: MovingPoints, where: str, value: Any, factor: Factor
    ) -> None:
        self.points, self.where = points, where
        super().__init__(owner, value, factor)

    def place(self) -> list[Any]:
        """The part of the border: its name, number of points and length."""
        made = self.points.made
        return [self.where, len(made), float(made.length.sum())]

    def at_points(self, term: Term) -> Array:
        """Components of its value at the points where they are, points x components."""
        columns = [evaluate(v, self.points.x, f"{self}") for v in term.values]
        return np.column_stack(columns)

    def __str__(self) -> str:
        return f"{self.call}({self.where})"


class Traction(OnBorder):
    """A dead traction; its values are components [Pa], per area when the load was made."""

    __slots__ = ()
    call = "traction"

    def _checked(self, value: Any) -> tuple[Value, ...]:
        names = self.points.space.axes
        given = checks.pair(f"{self}", value, "components (t_x, t_y)")
        return tuple(checks.profile(f"{self}: t_{n}", t) for n, t in zip(names, given, strict=True))

    def tractions(self, term: Term) -> Array:
        """The whole traction per present area [Pa], points x dim."""
        return np.asarray(
            self.at_points(term) * (self.points.reference / self.points.weight)[:, None]
        )

    def on(self, domain: Domain, term: Term) -> Array:
        """Forces of the whole traction, functions x dim [N per metre depth]."""
        forces = self.points.reference[:, None] * self.at_points(term)
        of = domain.layout.functions, domain.layout.basis
        return self.points.cells(domain).sums(*of, forces)


class Pressure(OnBorder):
    """A pressure [Pa], positive against the outward normal, which follows the border."""

    __slots__ = ()
    call = "pressure"

    def _checked(self, value: Any) -> tuple[Value, ...]:
        return (checks.profile(f"{self}", value),)

    def tractions(self, term: Term) -> Array:
        """The whole pressure as tractions [Pa], points x dim."""
        return -self.at_points(term) * self.points.normal

    def on(self, domain: Domain, term: Term) -> Array:
        """Forces of the whole pressure where the border is, functions x dim [N per metre depth]."""
        thickness = self.points.space.thickness(self.points.x)
        forces = -self.at_points(term) * thickness[:, None] * self.points.area
        of = domain.layout.functions, domain.layout.basis
        return self.points.cells(domain).sums(*of, forces)


class Flux(OnBorder):
    """A flux of a field into the body.

    Attributes:
        field: Name of the field.
    """

    __slots__ = ("field",)
    call = "flux"

    def __init__(
        self,
        owner: Owner[Any],
        points: MovingPoints,
        where: str,
        field: str,
        value: Any,
        factor: Factor,
    ) -> None:
        self.field = field
        super().__init__(owner, points, where, value, factor)

    def _checked(self, value: Any) -> tuple[Value, ...]:
        return (checks.profile(f"{self}", value),)

    def place(self) -> list[Any]:
        """Field and part of the border."""
        return [self.field, *super().place()]

    def on(self, domain: Domain, term: Term) -> tuple[slice, Array]:
        """Coefficients of the field, and the integrals of the whole flux times their functions."""
        place = domain.layout.fields[self.field]
        flux = self.points.weight[:, None] * self.at_points(term)
        sums = self.points.cells(domain).sums(domain.layout.functions, place.basis, flux)
        return place.slice, sums[:, 0]

    def __str__(self) -> str:
        return f"{super().__str__()} of {self.field}"


class Forces(Load):
    """Forces on particles of the body [N per metre depth]; its values are the components of one force
    that they share by volume, or the components of the force on each of them.

    Args:
        owner, value, factor: As of `Action`.
        domain: The particles where they are.
        chosen: Numbers of the particles on which it acts, in the order of the rows of a value.
        everywhere: Whether every rank has all of these numbers.

    Attributes:
        count: Number of particles on which it acts.
        shares: Share of each particle in one force.
    """

    __slots__ = ("_chosen", "_comm", "_dim", "_everywhere", "count", "shares")

    def __init__(
        self,
        owner: Owner[Any],
        domain: Domain,
        chosen: Indices,
        everywhere: bool,
        value: Any,
        factor: Factor,
    ) -> None:
        self._dim, self._comm = domain.model.space.dim, domain.model.grid.comm
        self._chosen, self._everywhere = chosen, everywhere
        number = np.asarray(domain.particles.number)
        mask = self._following(chosen, np.ones(len(chosen))).at(number) > 0
        volume = np.asarray(domain.particles.volume)[mask]
        total, count = ranks.sum_of(self._comm, np.array([volume.sum(), mask.sum()]))
        self.count, mine = int(count), number[mask].astype(np.int64)
        self.shares = OfParticles(self._comm, mine, volume / total, everywhere=False)
        super().__init__(owner, value, factor)

    def _following(self, number: Indices, values: Array) -> OfParticles:
        return OfParticles(self._comm, number, values, everywhere=self._everywhere)

    def _checked(self, value: Any) -> tuple[Value, ...]:
        given = checks.any_array("load(...): force", value)
        if given.ndim != 2:
            return checks.point("load(...): force", value)
        forces = checks.array("load(...): force", given, 2)
        n, dim = len(self._chosen), self._dim
        if forces.shape != (n, dim):
            raise InputError(
                f"load(...): force has shape {forces.shape}: expected ({n}, {dim}), one row for each of "
                f"the {n} particles in their order, or {dim} components of a force that they share"
            )
        if not np.isfinite(forces).all():
            k = int(np.flatnonzero(~np.isfinite(forces).all(axis=1))[0])
            raise InputError(f"load(...): force[{k}] = {forces[k]}: expected finite numbers")
        if len(np.unique(self._chosen)) < n:
            raise InputError(
                "load(...): a particle is given twice, with a force for each: expected each once"
            )
        return (forces,)

    def _begin(self, values: tuple[Value, ...], factor: Factor) -> None:
        """As of `Action`; forces on each particle follow them."""
        if isinstance(values[0], np.ndarray):
            values = tuple(self._following(self._chosen, of_axis) for of_axis in values[0].T)
        super()._begin(values, factor)

    def _restored(self, stored: Any) -> Value:
        """As of `Action`."""
        one = isinstance(stored, list)
        return stored[0] if one else OfParticles.of_state(self._comm, stored)

    def on(self, term: Term, number: Numbers) -> Array:
        """Forces of a term on the particles of these numbers, particles x dim; a call for all ranks."""
        return np.column_stack(
            [
                v.at(number) if isinstance(v, OfParticles) else v * self.shares.at(number)
                for v in term.values
            ]
        )

    def place(self) -> list[Any]:
        """The shares; a call for all ranks."""
        return [self.shares.identity()]

    def __str__(self) -> str:
        return f"force on {self.count} particles"
