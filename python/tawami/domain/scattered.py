"""Fields at scattered points of a file: their columns by name and unit, and values between the points.

A column is a component: 'sxx', 'stress xx', 'sigma_xx' and 'S11' are the same. Its unit follows its
name, as in 'sxx [kPa]'.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base import units
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.space import PLANE
from tawami.base.text import position

Numbers = npt.NDArray[Any]
Outside = Literal["stop", "nearest"]
#: Other names of fields in files.
ALIASES = {"stress": ("sigma", "sig", "s"), "displacement": ("u",), "velocity": ("v",)}
#: Axes of fields in files, and their numbers.
AXES = {"x": "1", "y": "2", "z": "3"}
#: Share of the largest value that is round-off.
ROUND_OFF = 1e-6


@dataclass(frozen=True)
class Column:
    """Numbers of one component, which are read when they are used.

    Attributes:
        label: Its name in the file, as 'sxx [kPa]', 'sxx (kPa)' or 'sxx_kPa'.
        read: Function that returns the numbers in the unit of the file, or raises a ValueError.
    """

    label: str
    read: Callable[[], Array]

    @property
    def name(self) -> str:
        """Its name without the unit."""
        return split(self.label)[0]

    def values(self, unit: str, what: str) -> Array:
        """The numbers in a unit of tawami.

        Raises:
            InputError: They have a unit that cannot be converted, or are not numbers.
        """
        try:
            factor = units.factor(split(self.label)[1], unit)
        except ValueError as error:
            raise InputError(f"{what}, column '{self.label}': {error}") from None
        try:
            return self.read() * factor
        except ValueError as error:
            raise InputError(f"{what}, {error}") from None


def split(label: str) -> tuple[str, str]:
    """Name and unit of a label."""
    found = re.fullmatch(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))", label.strip())
    if found is not None:
        return found[1], (found[2] or found[3] or "").strip()
    for found in re.finditer(r"[\s_/,]+", label):
        name, unit = label[: found.start()], label[found.end() :]
        if name and units.known(unit):
            return name, unit
    return label.strip(), ""


def named(columns: Sequence[Column], field: str, component: str) -> list[Column]:
    """Columns of a component of a field; of a scalar, whose component is empty."""
    numbered = "".join(AXES.get(axis, axis) for axis in component)
    known = {
        _plain(name + form)
        for name in (field, *(ALIASES.get(field, ()) if component else ()))
        for form in (component, numbered)
    }
    if len(component) == 2:
        known.add(component)
    return [column for column in columns if _plain(column.name) in known]


def _plain(name: str) -> str:
    return re.sub(r"[\s_.\-]", "", name.replace("\u03c3", "sigma")).lower()


@dataclass(frozen=True)
class Scattered:
    """Points of a file with columns.

    Attributes:
        name: Of the file, for messages.
        x: Positions [m], points x dimensions.
        columns: Other columns.
        outside: Values of particles outside the points.
    """

    name: str
    x: Array
    columns: tuple[Column, ...]
    outside: Outside

    def at(
        self, field: str, components: Sequence[str], unit: str, x: Array, number: Numbers, h: float
    ) -> Array:
        """A field at particles, linear between the points.

        Args:
            field: Name of the field.
            components: Names of its components; one empty name for a scalar.
            unit: Of its values.
            x: Positions of the particles [m].
            number: Their numbers.
            h: Side of a cell [m].

        Returns:
            Particles x components.

        Raises:
            InputError: No such columns, or particles outside the points.
        """
        return self._between(self.field(field, components, unit), x, number, field)

    def field(self, field: str, components: Sequence[str], unit: str) -> Array:
        """Components of a field at the points, points x components.

        Raises:
            InputError: A component has no column or several, an unknown unit, or one that the plane
                does not have is not 0.
        """
        found = {c: named(self.columns, field, c) for c in components}
        missing = [f"{field} {c}".strip() for c in components if not found[c]]
        if missing:
            raise InputError(
                f"{field}: {self.name} has no column for {', '.join(missing)}: it has "
                f"{', '.join(repr(column.label) for column in self.columns) or 'none'}. "
                f"{self._advice(field, components)}"
            )
        self._check_units(field, [column for some in found.values() for column in some])
        where = f"{field}: {self.name}"
        values = {c: self._one(field, found[c]).values(unit, where) for c in components}
        self._check_others(field, values, unit)
        return np.column_stack([values[c] for c in components])

    def _advice(self, field: str, components: Sequence[str]) -> str:
        return f"Expected a column '{f'{field} {components[0]}'.strip()}'"

    def _one(self, field: str, found: Sequence[Column]) -> Column:
        if len(found) > 1:
            raise InputError(
                f"{field}: {self.name} has {len(found)} columns for one component, "
                f"{', '.join(repr(column.label) for column in found)}: expected one"
            )
        return found[0]

    def _check_units(self, field: str, columns: Sequence[Column]) -> None:
        """Either all columns of a field have units or none."""
        without = [column.label for column in columns if not split(column.label)[1]]
        if 0 < len(without) < len(columns):
            raise InputError(
                f"{field}: {', '.join(map(repr, without))} of {self.name} have no unit, and other "
                "columns of the field do: expected units in brackets for all or none, as 'sxx [kPa]'"
            )

    def _check_others(self, field: str, values: dict[str, Array], unit: str) -> None:
        """Components of a three-dimensional field that the plane does not have are 0, and tensors are
        symmetric.
        """
        rank = len(next(iter(values)))
        size = max(np.abs(v).max(initial=0.0) for v in values.values())
        for component in map("".join, product(AXES, repeat=rank)) if rank else ():
            other = component[::-1]
            for column in () if component in values else named(self.columns, field, component):
                expected = values.get(other, np.zeros(len(self.x)))
                off = np.abs(column.values(unit, f"{field}: {self.name}") - expected)
                if (off > ROUND_OFF * size).any():
                    should = f"equal to {other}" if other in values else "0 in plane strain"
                    raise InputError(
                        f"{field}: the column '{column.label}' of {self.name} is not {should} in row "
                        f"{int(off.argmax())}: expected a symmetric field of the plane"
                    )

    def _between(self, values: Array, x: Array, number: Numbers, what: str) -> Array:
        """Values between the points, particles x columns."""
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
        from scipy.spatial import QhullError

        try:
            found = np.asarray(LinearNDInterpolator(self.x, values, rescale=True)(x))
        except QhullError:
            raise InputError(
                f"{what}: the {len(self.x)} points of {self.name} do not form a triangle: expected "
                "points in the plane, not on a line; for a profile pass a function with np.interp"
            ) from None
        beyond = np.flatnonzero(np.isnan(found).any(axis=1))
        if len(beyond) and self.outside == "stop":
            p = beyond[0]
            raise InputError(
                f"{what}: particle {number[p]} at {position(x[p])} m and "
                f"{len(beyond) - 1} others are outside the points of {self.name}: expected points "
                "around the body, or outside='nearest'"
            )
        found[beyond] = NearestNDInterpolator(self.x, values, rescale=True)(x[beyond])
        return found


def check_plane(x: Array, what: str) -> Array:
    """Positions in the plane, points x 2, of positions with more coordinates.

    Raises:
        InputError: The points do not lie in one plane z.
    """
    if (x[:, PLANE.dim :] != x[:1, PLANE.dim :]).any():
        raise InputError(f"{what}: its points have different z: expected points in one plane")
    return np.ascontiguousarray(x[:, : PLANE.dim])
