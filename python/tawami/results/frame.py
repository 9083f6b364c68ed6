"""Frames: the content of one file of a series, made of quantities of the particles or of the grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.motion.observer import Snapshot
from tawami.results.grid_quantities import GridQuantity
from tawami.results.projection import vertices
from tawami.scene.quantities import Arrays, Quantity

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Frame:
    """Content of one file.

    Attributes:
        points: Positions, points x 3 [m].
        kind: Of the cells: 'vertex' or 'quad'.
        cells: Numbers of their points, cells x 1 or 4.
        on_points: Fields by label, points or points x components.
        on_cells: Fields of the cells, likewise.
    """

    points: Array
    kind: Literal["vertex", "quad"]
    cells: Array
    on_points: dict[str, Array] = field(default_factory=dict)
    on_cells: dict[str, Array] = field(default_factory=dict)


def particle_frame(quantities: Sequence[Quantity], arrays: Arrays) -> Frame:
    """Particles as vertices."""
    x = arrays["x"]
    data = {quantity.label: _spatial(quantity.values(arrays)) for quantity in quantities}
    return Frame(with_z(x), "vertex", np.arange(len(x))[:, None], data)


def grid_frame(quantities: Sequence[GridQuantity], snapshot: Snapshot) -> Frame:
    """Cells of the grid as squares; a call for all ranks."""
    nx, ny = snapshot.scene.grid.cells
    corner = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    squares = corner[:, None] + np.array([0, 1, nx + 2, nx + 1])
    data: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    for quantity in quantities:
        data[quantity.cells][quantity.label] = _spatial(quantity.of(snapshot))
    return Frame(with_z(vertices(snapshot.scene)), "quad", squares, *data)


def with_z(values: npt.ArrayLike) -> Array:
    """Vectors in the plane with a third component 0, as VTK expects them: n x 2 to n x 3."""
    return np.pad(np.asarray(values, dtype=float), ((0, 0), (0, 1)))


def _spatial(values: Array) -> Array:
    """Vectors with a third component, all other fields as they are."""
    return with_z(values) if values.ndim == 2 and values.shape[1] == 2 else values
