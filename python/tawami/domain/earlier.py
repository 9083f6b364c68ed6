"""Particles of an earlier run as the source of a scene."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from tawami.base import archive, checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.files import reason, unreadable
from tawami.base.space import AXISYMMETRIC, PLANE, SPACES
from tawami.body.body import Body
from tawami.domain.scattered import AXES, Column, Numbers, Outside, Scattered, check_plane, split

#: Particles of an earlier run that are this near [cells] to those of the scene are the same.
SAME_PLACE = 1e-6


@dataclass(frozen=True)
class Earlier(Scattered):
    """The particles of an earlier run; `earlier` reads them.

    Attributes:
        number: Numbers of the particles.
        unnamed: Arrays whose components have no names.
    """

    number: npt.NDArray[np.int64]
    unnamed: tuple[str, ...]

    @property
    def body(self) -> Body:
        """Positions and volumes of these particles, for a scene that starts from them.

        Those of an axisymmetric run are of rings, volume [m3]: a body has their areas.
        """
        labels = {column.label for column in self.columns}
        space = AXISYMMETRIC if f"volume [{AXISYMMETRIC.volume}]" in labels else PLANE
        volume = self.field("volume", [""], space.unit(space.volume))[:, 0]
        return Body(self.x, volume / space.thickness(self.x))

    def at(
        self, field: str, components: Sequence[str], unit: str, x: Array, number: Numbers, h: float
    ) -> Array:
        """The field of the same particles, or linear between them where they are others."""
        values = self.field(field, components, unit)
        order = np.argsort(self.number)
        place = np.searchsorted(self.number[order], number)
        if (place < len(order)).all():
            same = order[place]
            near = np.abs(self.x[same] - x) <= SAME_PLACE * h
            if (self.number[same] == number).all() and near.all():
                return np.asarray(values[same])
        return self._between(values, x, number, field)

    def _advice(self, field: str, components: Sequence[str]) -> str:
        if not self.unnamed:
            return super()._advice(field, components)
        name, count = self.unnamed[0], " ".join(components)
        return (
            f"The components of {', '.join(map(repr, self.unnamed))} have no names: expected all 9 of a "
            f"tensor, or their names in that of the array, as '{name} {count or 'xx yy zz xy'} [Pa]'"
        )


def earlier(path: str | Path, *, outside: Outside = "stop") -> Earlier:
    """The particles of an earlier run, from a file of `write_particles`, a series of particles, or a
    checkpoint, which has their complete state.

    Particles with the same number at the same place get exactly the values of the file; others get
    values that are linear between its particles. `Scene(grid, state.body, ...)` is a scene on the same
    particles.

    Files of other programs: a vector has 2 or 3 components. A tensor has 9, row by row, or its array is
    called after them, as 'stress xx yy zz xy [Pa]'; 4 or 6 components without names are rejected. Units
    in brackets are converted as in `table`.

    Args:
        path: The file, ending in .vtu or .npz; or a folder of results, for its newest checkpoint.
        outside: As of `table`.

    Raises:
        InputError: A file that does not exist or cannot be read, or points that are not in a plane.
            Fields are checked when they are used.
        CheckpointError: A checkpoint that is damaged.
    """
    checks.choice("outside", outside, get_args(Outside))
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
    x, arrays = _checkpoint(file) if file.suffix == ".npz" else _vtu(file, name)
    columns = [column for label, values in arrays.items() for column in _columns(label, values)]
    known = [column.read() for column in columns if column.name == "number"]
    number = known[0] if known else np.arange(len(x))
    unnamed = tuple(label for label, values in arrays.items() if not list(_columns(label, values)))
    x = check_plane(np.asarray(x, dtype=float), f"earlier({name})")
    return Earlier(name, x, tuple(columns), outside, number.astype(np.int64), unnamed)


def _checkpoint(file: Path) -> tuple[Any, dict[str, Any]]:
    """Positions and arrays of a checkpoint, the tensors with the names of their components."""
    identity, arrays = archive.particles(file)
    space = SPACES.get(identity.get("geometry", ""), PLANE)
    labels = {
        "stress": f"stress {' '.join(space.tensor)}",
        "volume": f"volume [{space.unit(space.volume)}]",
    }
    return arrays["x"], {labels.get(k, k): values for k, values in arrays.items() if k != "x"}


def _vtu(file: Path, name: str) -> tuple[Any, dict[str, Any]]:
    """Positions and arrays of a file of particles."""
    import meshio

    try:
        read = meshio.vtu.read(file)  # meshio.read prints, and ends the process on an error
    except (Exception, SystemExit) as error:
        raise InputError(f"earlier({name}) cannot be read: {reason(error)}") from error
    return read.points, dict(read.point_data)


def _columns(label: str, values: Any) -> Iterator[Column]:
    """Columns of an array, one per component; none if the components have no names."""
    array = np.asarray(values, dtype=float).reshape(len(values), -1)
    count, (name, unit) = array.shape[1], split(label)
    words = name.split()
    ends = ["", *words][-count:] if count else []
    if count > 1 and len(words) > count and all(re.fullmatch("[xyz]{1,2}", w) for w in ends):
        name = " ".join(words[:-count])
    elif count == len(AXES) ** 2:
        ends = list(map("".join, product(AXES, repeat=2)))
    elif count in (2, len(AXES)):
        ends = list(AXES)[:count]
    elif count > 1:
        return
    else:
        ends = [""] * count
    for k, end in enumerate(ends):
        yield Column(
            f"{name} {end}".strip() + (f" [{unit}]" if unit else ""), partial(array.take, k, 1)
        )
