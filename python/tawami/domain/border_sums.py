"""The points of the sums of a form over the border, `sum_b`, and the numbers that they read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.domain.border import SceneBorder
from tawami.domain.domain import Domain
from tawami.domain.model import Model
from tawami.domain.moving_points import MovingPoints
from tawami.grid.edges import evaluate


class BorderSums(Mapping[str, Array]):
    """The numbers that points of the border have besides those of the nearest particle, by name.

    These are the displacement since the start of the scene, 'old u[0]', and data and parameters that
    are functions of the position.

    Args:
        model: Grid, form and laws of the scene.
        border: Its border.
        total: Gives the coefficients of all fields since the start, where particles do not move.
    """

    def __init__(self, model: Model, border: SceneBorder, total: Callable[[], Array]) -> None:
        self._model, self._total = model, total
        self._points: MovingPoints | None = border.points if model.compiled.border else None
        self._domain: Domain | None = None
        self._given: dict[str, Array] = {}
        name = next(iter(model.form.fields))
        self._axis = {f"old {name}[{axis}]": axis for axis in range(model.space.dim)}

    def attach(self, domain: Domain) -> None:
        """Give the form of a domain its points; a collective call.

        Raises:
            InputError: The form has such sums, and the body has no border, or not the part of a sum.
        """
        self._domain = domain
        points = None if self._points is None else self._points.now
        domain.assembly.set_border(points, domain.responses.values, self)

    def keep(self, kept: Mapping[MovingPoints, Indices]) -> None:
        """Keep the numbers of the points that remain, or of their parts; see `SceneBorder`."""
        if self._points is not None:
            of = kept[self._points]
            self._given = {name: values[of] for name, values in self._given.items()}

    def set(self, name: str, source: Any, what: str) -> None:
        """Take data or a parameter of the position at the points; others are those of the particles.

        Args:
            name: Its name.
            source: A function f(x, y) on arrays; anything else is read at the nearest particle.
            what: Its name in messages.
        """
        self._given.pop(name, None)
        if self._points is not None and callable(source):
            self._given[name] = evaluate(source, self._points.x, f"{what} at the border")

    def __getitem__(self, name: str) -> Array:
        if name not in self._axis:
            return self._given[name]
        domain = self._domain
        if domain is None or self._points is None:
            raise KeyError(name)
        if self._model.moves:
            return np.asarray((self._points.x - self._points.made.x)[:, self._axis[name]])
        layout, axis = domain.layout, self._axis[name]
        u = self._model.space.vectors(self._total()[: layout.num_displacement])
        return self._points.cells(domain).at(layout.basis, u[:, axis, None])[:, 0]

    def __iter__(self) -> Iterator[str]:
        return iter([*self._axis, *self._given])

    def __len__(self) -> int:
        return len(self._axis) + len(self._given)

    def state(self) -> dict[str, Array]:
        """The numbers, for a checkpoint."""
        return dict(self._given)

    def restore(self, state: Mapping[str, Array]) -> None:
        """The reverse of :meth:`state`."""
        self._given = dict(state)
