"""Borders of straight sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.base.checks import array, shown, switch
from tawami.base.errors import InputError
from tawami.border.pieces import Border
from tawami.grid.grid import LARGEST

#: An area this small, relative to the square of the size, is round-off.
ROUND_OFF = 1e-14
#: Names of the sides of a shape: one for all, one for each, or some by the number of the side.
SideNames = str | Sequence[str] | Mapping[int, str] | None


def polyline(corners: npt.ArrayLike, *, names: SideNames = None, closed: bool = True) -> Border:
    """A border of straight sides, for a body of loose particles: `Body(x, volume, border=...)`.

    Args:
        corners: Corners [m] in order, n x 2. The body is on the left of the way; the corners of a
            closed border are reversed if they are clockwise.
        names: Names of the sides: one for all of them, one for each, or some by their number. Side k
            goes from corner k to the next one; by default its name is its number.
        closed: Whether the last corner is joined with the first one.

    Raises:
        InputError: There are too few corners, all are on a line, or names and sides do not match.
    """
    x = array("corners", corners, 2)
    least = 3 if switch("closed", closed) else 2
    if len(x) < least or x.shape[1] != 2 or not (np.abs(x) < LARGEST).all():
        raise InputError(
            f"polyline: corners of shape {x.shape}: expected {least} or more finite points (x, y)"
        )
    if not closed:
        named = side_names("polyline", names, len(x) - 1)
        return _checked(straight(x[:-1], x[1:], named))
    x = unclosed(x)
    if abs(_area(x)) <= ROUND_OFF * np.ptp(x, axis=0).max() ** 2:
        raise InputError("polyline: its corners are on a line: expected an area, or closed=False")
    named = side_names("polyline", names, len(x))
    return _checked(straight(*oriented(x, named), named))


def oriented(
    x: Array, names: Sequence[str], hole: bool = False
) -> tuple[Array, Array, Sequence[str]]:
    """Starts, ends and names of the sides of a polygon, or of a hole, with the body on the left.

    Args:
        x: Corners [m] in either orientation, n x 2.
        names: Names of the sides, the first one from the first corner to the second.
        hole: Whether the body is outside.
    """
    after = np.roll(x, -1, axis=0)
    if (_area(x) < 0) != hole:
        order = np.arange(len(x))[::-1]
        return after[order], x[order], [names[k] for k in order]
    return x, after, names


def straight(
    start: Array, end: Array, names: Sequence[str], order: Sequence[str] | None = None
) -> Border:
    """Straight pieces, n x 2, with the name of each; those without a length are left out.

    Args:
        start: Where each piece starts [m].
        end: Where it ends [m].
        names: Name of each.
        order: The names in the order of the border; by default that of the pieces.
    """
    some = np.flatnonzero((start != end).any(axis=1))
    of = [names[k] for k in some]
    known = tuple(dict.fromkeys(name for name in order or names if name in {*of}))
    number = {name: k for k, name in enumerate(known)}
    tag = np.array([number[name] for name in of], dtype=np.int64)
    return Border(start[some], end[some], np.zeros(len(some)), tag, known)


def _area(x: Array) -> float:
    """Area inside corners [m], n x 2, positive if these are counter-clockwise."""
    a, b = (x - x.mean(axis=0)).T
    return float(a @ np.roll(b, -1) - b @ np.roll(a, -1)) / 2


def unclosed(x: Array) -> Array:
    """Corners without the last one if it repeats the first one."""
    return x[:-1] if len(x) > 1 and np.array_equal(x[0], x[-1]) else x


def side_names(what: str, names: Any, count: int, first: int = 0) -> list[str]:
    """The name of each side; by default it is its number.

    Args:
        what: The function, for error messages.
        names: The names as given.
        count: Number of sides.
        first: Number of the first one.

    Raises:
        InputError: They are no names, or no names for this number of sides.
    """
    numbers = [str(first + k) for k in range(count)]
    if names is None:
        return numbers
    if isinstance(names, str):
        names = [names] * count
    if isinstance(names, Mapping):
        given = dict(zip(range(first, first + count), numbers, strict=True))
        unknown = [key for key in names if key not in given]
        if unknown:
            raise InputError(
                f"{what}: names for side {shown(unknown[0])}: expected numbers of sides, from {first} "
                f"to {first + count - 1}"
            )
        names = list({**given, **names}.values())
    if not isinstance(names, list | tuple) or len(names) != count:
        size = f"{len(names)} names" if isinstance(names, list | tuple) else shown(names)
        raise InputError(
            f"{what}: names = {size}: expected one for each of the {count} sides, or a mapping from "
            "the number of a side to its name"
        )
    for name in names:
        if not isinstance(name, str) or not name:
            raise InputError(f"{what}: names has {shown(name)}: expected names, as 'base'")
    return list(names)


def _checked(border: Border) -> Border:
    if not len(border.start):
        raise InputError("polyline: its corners coincide: expected sides with a length")
    return border
