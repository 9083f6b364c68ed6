"""Frames: the content of one file of a series, made of quantities of the particles or of the grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base.shared_file import Rows, by_number
from tawami.motion.observer import Snapshot, Subject
from tawami.quantities.outline import Outline
from tawami.quantities.quantities import Arrays, Quantity, local_arrays, own_values
from tawami.results.grid_quantities import GridQuantity
from tawami.results.projection import vertices

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Frame:
    """Content of one file.

    Attributes:
        points: Positions, points x 3 [m].
        kind: Of the cells: 'vertex', 'line' or 'quad'.
        cells: Numbers of their points, cells x 1, 2 or 4.
        on_points: Fields by label, points or points x components.
        on_cells: Fields of the cells, likewise.
        first, total: Rows of other ranks before those of this rank, and rows of all; None where every
            rank has all.
    """

    points: Array
    kind: Literal["vertex", "line", "quad"]
    cells: Array
    on_points: dict[str, Array] = field(default_factory=dict)
    on_cells: dict[str, Array] = field(default_factory=dict)
    first: int = 0
    total: int | None = None

    def rows(self, comm: Any, array: Array) -> Rows:
        """The rows of an array that this rank writes."""
        if self.total is None:
            return Rows.of_first_rank(comm, array)
        return Rows(array, self.first, self.total)


def particle_frame(
    quantities: Sequence[Quantity], subject: Subject, own: Arrays | None = None
) -> Frame:
    """Particles as vertices, in the order of their numbers; a call for all ranks.

    Args:
        quantities: Fields of the particles.
        subject: Scene or motion.
        own: Arrays of this rank's particles; those of the subject by default.
    """
    own = local_arrays(subject) if own is None else own
    sort = by_number(subject.scene.grid.comm, own["number"])
    x = sort(own["x"])
    data = {one.label: _spatial(sort(own_values(one, subject, own)).own) for one in quantities}
    cells = x.first + np.arange(len(x.own))[:, None]
    return Frame(with_z(x.own), "vertex", cells, data, first=x.first, total=x.total)


def grid_frame(quantities: Sequence[GridQuantity], snapshot: Snapshot) -> Frame:
    """Cells of the grid as squares; a call for all ranks."""
    nx, ny = snapshot.scene.grid.cells
    corner = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    squares = corner[:, None] + np.array([0, 1, nx + 2, nx + 1])
    data: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    for quantity in quantities:
        data[quantity.cells][quantity.label] = _spatial(quantity.of(snapshot))
    return Frame(with_z(vertices(snapshot.scene)), "quad", squares, *data)


def border_frame(snapshot: Snapshot) -> Frame:
    """The border of the body as lines, one for each of its points."""
    now, scene = snapshot.scene.configuration, snapshot.scene
    assert now.border.points is not None
    outline = Outline(now.border.points, now.domain, now.before)
    length = np.linalg.norm(outline.area, axis=1)
    space, dim = scene.grid.space, outline.x.shape[1]
    traction = outline.tractions([*now.loads.tractions, *now.supports.tractions])
    return Frame(
        with_z(outline.sides(1.0 if now.model.moves else 0.0).reshape(-1, dim)),
        "line",
        np.arange(2 * len(length)).reshape(-1, 2),
        {"displacement [m]": with_z(outline.displacements().reshape(-1, dim))},
        {
            "normal [-]": with_z(outline.area / length[:, None]),
            f"area [{space.unit('m2')}]": length * space.thickness(outline.x),
            "part [-]": outline.part.astype(np.int32),
            "traction [Pa]": with_z(traction),
        },
    )


def with_z(values: npt.ArrayLike) -> Array:
    """Vectors in the plane with a third component 0, as VTK expects them: n x 2 to n x 3."""
    return np.pad(np.asarray(values, dtype=float), ((0, 0), (0, 1)))


def _spatial(values: Array) -> Array:
    """Vectors with a third component, all other fields as they are."""
    return with_z(values) if values.ndim == 2 and values.shape[1] == 2 else values
