"""Where the field of the particles comes from that a scene begins with: numbers, a function of
position, a table of scattered points, or the particles of an earlier run.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from tawami.base import archive, checks
from tawami.base.errors import InputError
from tawami.base.files import reason, unreadable
from tawami.body.body import Body
from tawami.scene.domain import Domain

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[Any]
Outside = Literal["stop", "nearest"]
#: Particles of an earlier run that are this near [cells] to those of the scene are the same.
SAME_PLACE = 1e-6


@dataclass(frozen=True)
class Table:
    """Values at scattered points; `table` reads one."""

    name: str
    x: Array
    values: Array
    outside: Outside

    def at(self, x: Array, number: Numbers, what: str) -> Array:
        """Linear between the points, positions x columns."""
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
        from scipy.spatial import QhullError

        try:
            found = np.asarray(LinearNDInterpolator(self.x, self.values, rescale=True)(x))
        except QhullError:
            raise InputError(
                f"{what}: the {len(self.x)} points of {self.name} are less than a triangle: expected "
                "points in the plane, not on a line; for a profile pass a function with np.interp"
            ) from None
        beyond = np.flatnonzero(np.isnan(found).any(axis=1))
        if len(beyond) and self.outside == "stop":
            p = beyond[0]
            raise InputError(
                f"{what}: particle {number[p]} at ({x[p, 0]:g}, {x[p, 1]:g}) m and {len(beyond) - 1} "
                f"others are outside the points of {self.name}: expected points around the body, or "
                "outside='nearest'"
            )
        found[beyond] = NearestNDInterpolator(self.x, self.values, rescale=True)(x[beyond])
        return found


@dataclass(frozen=True)
class Earlier:
    """The particles of an earlier run; `earlier` reads them."""

    name: str
    x: Array
    number: npt.NDArray[np.int64]
    fields: dict[str, Array]
    outside: Outside

    @property
    def body(self) -> Body:
        """Positions and volumes of these particles, for a scene that starts from them."""
        return Body(self.x, self.field("volume", 1, f"{self.name}: body")[:, 0])

    def field(self, name: str, width: int, what: str) -> Array:
        """An array of the file, particles x width; components and unit may follow its name."""
        wanted = name.replace("_", " ")
        for known, values in self.fields.items():
            plain = known.split("[")[0].replace("_", " ").strip()
            # 'stress xx yy zz xy', but 'mean stress' is another
            if plain == wanted or plain.startswith(wanted + " "):
                array = np.asarray(values, dtype=float).reshape(len(self.x), -1)
                if array.shape[1] >= width:
                    return np.ascontiguousarray(array[:, :width])
        raise InputError(
            f"{what}: {self.name} has no array '{name}' of {width} components: it has "
            f"{', '.join(map(repr, self.fields)) or 'none'}"
        )

    def at(self, name: str, x: Array, number: Numbers, width: int, h: float, what: str) -> Array:
        """The field of the same particles, or linear between them where they are others."""
        values = self.field(name, width, what)
        order = np.argsort(self.number)
        place = np.searchsorted(self.number[order], number)
        if (place < len(order)).all():
            same = order[place]
            near = np.abs(self.x[same] - x) <= SAME_PLACE * h
            if (self.number[same] == number).all() and near.all():
                return np.asarray(values[same])
        return Table(self.name, self.x, values, self.outside).at(x, number, what)


Source = npt.ArrayLike | Callable[[Array, Array], Any] | Table | Earlier


def table(path: str | Path, *columns: str, outside: Outside = "stop") -> Table:
    """A field from a CSV file, linear between its points.

    Its first row names the columns: x and y [m], then the components, separated by commas.

    Args:
        path: The file.
        columns: Names of the components, in their order; all columns but x and y by default.
        outside: What particles outside the points get: 'stop' is an error, 'nearest' the value of the
            nearest point.

    Raises:
        InputError: A file that is not there, columns that are not, fewer than three points, what is no
            number, or two values for one point.
    """
    _check_outside(outside)
    path = checks.path("table: path", path)
    name, problem = f"'{path}'", unreadable(path)
    if not all(isinstance(column, str) for column in columns):
        raise InputError(f"table: columns = {checks.shown(columns)}: expected their names")
    if problem is not None:
        raise InputError(f"table({name}) cannot be read ({problem}): expected a CSV file")
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"table({name}) cannot be read ({reason(error)}): expected a CSV file"
        ) from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    wanted = ["x", "y", *(columns or [c for c in header if c not in ("x", "y")])]
    missing = [column for column in wanted if column not in header]
    if missing or len(wanted) < 3:
        raise InputError(
            f"table({name}): its first row is {', '.join(header) or 'empty'}: expected names of "
            f"columns, x, y and {', '.join(columns) or 'at least one more'}"
        )
    places = [header.index(column) for column in wanted]
    values = np.array([_numbers(name, k, row, places) for k, row in enumerate(rows[1:], 2)])
    if len(values) < 3:
        raise InputError(f"table({name}) has {len(values)} points: expected three or more")
    points, count = np.unique(values[:, :2], axis=0, return_counts=True)
    if (count > 1).any():
        x, y = points[count > 1][0]
        raise InputError(
            f"table({name}): the point ({x:g}, {y:g}) m is there {count.max()} times: expected once"
        )
    return Table(name, values[:, :2], values[:, 2:], outside)


def _numbers(name: str, line: int, row: list[str], places: list[int]) -> list[float]:
    try:
        numbers = [float(row[place]) for place in places]
    except (ValueError, IndexError):
        numbers = [np.nan]
    if not np.isfinite(numbers).all():
        raise InputError(f"table({name}), row {line}: {','.join(row)}: expected finite numbers")
    return numbers


def earlier(path: str | Path, *, outside: Outside = "stop") -> Earlier:
    """The particles of an earlier run: as `write_particles` or a series of particles has
    them, or, with all that they carry, of a checkpoint.

    Particles with the same number at the same place get exactly what is in the file; others what is
    linear between its particles. A scene on the very particles: `Scene(grid, state.body, ...)`.

    Args:
        path: The file, ending in .vtu or .npz; or a folder of results, for its newest checkpoint.
        outside: As of `table`.

    Raises:
        InputError: A file that is not there or cannot be read.
        CheckpointError: A checkpoint that is damaged.
    """
    _check_outside(outside)
    file = checks.path("earlier: path", path)
    name = f"'{file}'"
    if os.path.isdir(file):
        file = (archive.files(file) or [file])[-1]
    problem = unreadable(file)
    if problem is not None or file.suffix not in (".vtu", ".npz"):
        raise InputError(
            f"earlier({name}) cannot be read ({problem or 'another ending'}): expected particles of an "
            "earlier run, ending in .vtu, a checkpoint, ending in .npz, or a folder of results with "
            "checkpoints"
        )
    if file.suffix == ".npz":
        _, state = archive.read(file)
        arrays = state["scene"]["particles"]
        number = arrays["number"][:, 0].astype(np.int64)
        return Earlier(name, arrays["x"], number, arrays, outside)
    import meshio

    try:
        read = meshio.read(path)
    except (Exception, SystemExit) as error:
        raise InputError(
            f"earlier({name}) cannot be read: {error or type(error).__name__}"
        ) from error
    x = np.asarray(read.points, dtype=float)[:, :2]
    known = read.point_data.get("number", np.arange(len(x)))
    number = np.asarray(known).astype(np.int64).ravel()
    return Earlier(name, x, number, dict(read.point_data), outside)


def _check_outside(outside: Any) -> None:
    checks.choice("outside", outside, get_args(Outside))


def values(domain: Domain, name: str, source: Any, components: str, unit: str) -> Array:
    """A field of this rank's particles.

    Args:
        domain: The particles.
        name: What messages call the field, and its name in the file of an earlier run.
        source: Where the values come from.
        components: Of the field, as 'x y'.
        unit: What messages say after the numbers.

    Returns:
        Particles x components.

    Raises:
        InputError: Another shape, numbers that are not finite, or an error of the source.
    """
    x, number = np.asarray(domain.particles.x), np.asarray(domain.particles.number)
    width = len(components.split())
    at_positions = isinstance(source, Earlier | Table) or callable(source)
    if at_positions and not len(x):  # a rank without particles
        return np.empty((0, width))
    if isinstance(source, Earlier):
        found = source.at(name, x, number, width, domain.model.grid.h, name)
    elif isinstance(source, Table):
        if source.values.shape[1] != width:
            raise InputError(
                f"{name}: {source.name} has {source.values.shape[1]} columns besides x and y: expected "
                f"{width} ({components}); choose them with table(path, 'column', ...)"
            )
        found = source.at(x, number, name)
    elif callable(source):
        found = _of_function(source, x, name, components)
    else:
        of_body = _of_numbers(source, domain.model.num_particles, width, name)
        _check_finite(of_body, np.arange(len(of_body)), name, unit)
        found = of_body[number]
    _check_finite(found, number, name, unit)
    return found


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
        more = f"{n} x {width}" if width > 1 else f"{n} of them"
        raise InputError(
            f"{name} has {_shape(source)}: expected {few}, {more}, a function f(x, y) on arrays, "
            "tawami.table(...) or tawami.earlier(...)"
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
