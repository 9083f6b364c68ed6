"""Sources of an initial field of the particles: numbers, a function of position, a table of scattered
points, or the particles of an earlier run.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks, ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.domain.domain import Domain
from tawami.domain.scattered import Scattered

Numbers = npt.NDArray[Any]
Source = npt.ArrayLike | Callable[[Array, Array], Any] | Scattered


def values(
    domain: Domain, name: str, source: Any, components: str, unit: str, label: str | None = None
) -> Array:
    """A field of this rank's particles; a collective call.

    Args:
        domain: The particles.
        name: Name of the field in the file of an earlier run, and in messages without a label.
        source: Source of the values.
        components: Of the field, as 'x y'.
        unit: Unit in messages.
        label: What the field is called in messages.

    Returns:
        Particles x components.

    Raises:
        InputError: Another shape, numbers that are not finite, or an error of the source.
    """
    x, number = np.asarray(domain.particles.x), np.asarray(domain.particles.number)
    width, said, model = len(components.split()), label or name, domain.model
    at_positions = isinstance(source, Scattered) or callable(source)
    found = np.empty((0, width))
    with ranks.raise_together(model.grid.comm):
        if not at_positions:
            found = _of_numbers(source, model.along_body, width, said)
            of = np.arange(len(found)) if model.part is None else model.part.number
            _check_finite(found, of, said, unit)
        elif len(x):  # else a rank without particles
            if isinstance(source, Scattered):
                columns = components.split() if width > 1 else [""]
                found = source.at(name, columns, unit or "-", x, number, model.grid.h)
            else:
                found = _of_function(source, x, said, components)
            _check_finite(found, number, said, unit)
    return found if at_positions else model.of_script(found, number)


def _of_numbers(source: Any, n: int, width: int, name: str) -> Array:
    """One row for each of the n particles of the body."""
    few = {1: "a number", 2: "two numbers"}.get(width, f"{width} numbers")
    shape = (n, width) if width > 1 else (n,)
    try:
        array = checks.real_values(source)
        if array.shape not in (shape, shape[1:]):
            raise ValueError
        given = np.broadcast_to(array, shape)
    except (TypeError, ValueError, OverflowError):
        size = f"{n} x {width} (one row" if width > 1 else f"{n} (one"
        raise InputError(
            f"{name} has {_shape(source)}: expected {few}, an array of {size} for each particle), a "
            "function f(x, y) on arrays, tawami.table(...) or tawami.earlier(...)"
        ) from None
    return np.reshape(given, (n, width))


def _shape(source: Any) -> str:
    try:
        if np.iscomplexobj(source):
            return "complex numbers"
        return f"shape {checks.real_values(source).shape}"
    except (TypeError, ValueError, OverflowError):
        if isinstance(source, tuple | list):
            with suppress(ValueError):
                return f"parts of shape {', '.join(str(np.shape(part)) for part in source)}"
        return f"the value {checks.shown(source)}"


def _of_function(f: Callable[[Array, Array], Any], x: Array, name: str, components: str) -> Array:
    width, n = len(components.split()), len(x)
    try:
        result = f(x[:, 0].copy(), x[:, 1].copy())
    except Exception as error:
        raise InputError(
            f"{name}: the function failed on arrays of {n} positions ({checks.shown(error)}): expected "
            "f(x, y) on arrays"
        ) from error
    try:
        if isinstance(result, tuple | list) and width > 1:
            if len(result) != width:
                raise ValueError
            columns = [np.broadcast_to(checks.real_values(part), n) for part in result]
            return np.column_stack(columns)
        array = checks.real_values(result)
        if width == 1:
            return np.broadcast_to(array, n)[:, None]
        if array.shape not in ((n, width), (width,)):
            raise ValueError
        return np.broadcast_to(array, (n, width))
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{name}: the function returned {_shape(result)} for {n} positions: expected "
            + ("an array of that length" if width == 1 else f"{width} such arrays ({components})")
        ) from None


def _check_finite(found: Array, number: Numbers, name: str, unit: str) -> None:
    bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if len(bad):
        row = ", ".join(f"{value:g}" for value in found[bad[0]])
        row = f"({row})" if found.shape[1] > 1 else row
        raise InputError(
            f"{name} of particle {number[bad[0]]} is {row} {unit}: expected finite numbers"
        )
