"""Fields of a CSV file, linear between its points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from tawami.base import checks, csv_file
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.files import reason
from tawami.base.space import PLANE
from tawami.base.text import meant, position
from tawami.domain.scattered import AXES, Column, Outside, Scattered, check_plane, named, split


@dataclass(frozen=True)
class Table(Scattered):
    """Values at scattered points; `table` reads one.

    Attributes:
        chosen: Columns that the script names, in its order; by default they are found by their names.
    """

    chosen: tuple[Column, ...]

    def field(self, field: str, components: Sequence[str], unit: str) -> Array:
        """As `Scattered.field`, of the chosen columns in their order."""
        if not self.chosen:
            return super().field(field, components, unit)
        listed = ", ".join(repr(column.label) for column in self.chosen)
        order = " ".join(components) or "one"
        if len(self.chosen) != len(components):
            raise InputError(
                f"{field}: table({self.name}, {listed}): expected {len(components)} columns ({order})"
            )
        for other in components:
            for column in named(self.chosen, field, other):
                if self.chosen.index(column) != components.index(other):
                    raise InputError(
                        f"{field}: table({self.name}, {listed}): '{column.label}' is component {other}: "
                        f"expected the columns in the order {order}"
                    )
        self._check_units(field, self.chosen)
        where = f"{field}: table({self.name})"
        return np.column_stack([column.values(unit, where) for column in self.chosen])

    def _advice(self, field: str, components: Sequence[str]) -> str:
        each = ", ".join(repr(f"{field} {c}".strip()) for c in components)
        present = ", ".join(repr(chr(ord("A") + k)) for k in range(len(components)))
        if len(components) == 1:
            return f"Expected a column {each}, or its present name, as table(path, {present})"
        return f"Expected the columns {each}, or their present names in order, as table(path, {present})"


def table(path: str | Path, *columns: str, outside: Outside = "stop") -> Table:
    """A field from a CSV file, linear between its points.

    The first row names the columns, which are separated by commas: x and y, then components. Their
    names decide, not their order, which may be any. Units follow the names in brackets and are converted
    ('x [mm]', 'sxx [kPa]'); a column without a unit is in m, Pa, m/s or a pure number. Tension is
    positive. Numbers have a decimal point and no thousands separator.

    ================  =====================================================================
    field             columns
    ================  =====================================================================
    stress            'stress xx', 'sigma_xx', 'sxx', 'S11' or 'xx'; likewise yy, zz, xy
    displacement      'displacement x', 'ux', 'U1'; likewise y
    velocity          'velocity x', 'vx', 'V1'; likewise y
    eps_v and others  the name of the field
    ================  =====================================================================

    Args:
        path: The file.
        columns: Names of the components in the order xx yy zz xy, or x y, if the file calls them
            otherwise.
        outside: Treatment of particles outside the points: 'stop' raises an error, 'nearest' gives them
            the value of the nearest point.

    Raises:
        InputError: The file cannot be read, a row is longer or shorter than the header, a column is
            missing or there twice, or there are fewer than three points or two rows for one point.
            Numbers and units of a component are checked when the table is used.
    """
    checks.choice("outside", outside, get_args(Outside))
    path = checks.path("table: path", path)
    name = f"'{path}'"
    if not all(isinstance(column, str) for column in columns):
        raise InputError(f"table: columns = {checks.shown(columns)}: expected their names")
    try:
        content = csv_file.read(path)
    except OSError as error:
        raise InputError(
            f"table({name}) cannot be read ({reason(error)}): expected a CSV file"
        ) from None
    except ValueError as error:
        raise InputError(f"table({name}): {error}") from None
    axes, wanted = ([_place(name, content.header, c) for c in some] for some in (AXES, columns))
    if None in axes[: PLANE.dim]:
        raise InputError(
            f"table({name}): its header is {', '.join(content.header)}: expected names of columns, "
            "with the positions x and y"
        )
    if None in wanted:
        raise InputError(
            f"table({name}) has no column '{columns[wanted.index(None)]}': expected one of "
            f"{', '.join(map(repr, content.header))}"
            f"{meant(columns[wanted.index(None)], content.header)}"
        )
    every = [
        Column(label, partial(content.column, place)) for place, label in enumerate(content.header)
    ]
    x = _points(name, [every[place] for place in axes if place is not None])
    chosen = tuple(every[place] for place in wanted if place is not None)
    others = tuple(column for k, column in enumerate(every) if k not in axes)
    return Table(name, x, others, outside, chosen)


def _place(name: str, header: Sequence[str], wanted: str) -> int | None:
    """Number of the column with this label, or this name; None without one."""
    for same in (
        lambda label: label == wanted,
        lambda label: split(label)[0] == wanted,
        lambda label: split(label)[0].lower() == wanted,
    ):
        found = [k for k, label in enumerate(header) if same(label)]
        if len(found) > 1:
            raise InputError(
                f"table({name}) has {len(found)} columns '{wanted}', numbers "
                f"{', '.join(str(k + 1) for k in found)}: expected names that differ"
            )
        if found:
            return found[0]
    return None


def _points(name: str, columns: Sequence[Column]) -> Array:
    """The points, which differ and lie in a plane, points x dimensions [m]."""
    x = np.column_stack([column.values("m", f"table({name})") for column in columns])
    x = check_plane(x, f"table({name})")
    if len(x) < 3:
        raise InputError(f"table({name}) has {len(x)} points: expected three or more")
    points, count = np.unique(x, axis=0, return_counts=True)
    if (count > 1).any():
        raise InputError(
            f"table({name}) has {count.max()} rows for the point "
            f"{position(points[count > 1][0])} m: expected one"
        )
    return x
