"""Frames: the content of one file of a series, made of quantities of the particles or of the grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base.shared_file import Rows, by_number, in_blocks
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
        point_rows, cell_rows: Points or cells of other ranks before those of this rank, and the number
            of all; None where every rank has all.
    """

    points: Array
    kind: Literal["vertex", "line", "quad"]
    cells: Array
    on_points: dict[str, Array] = field(default_factory=dict)
    on_cells: dict[str, Array] = field(default_factory=dict)
    point_rows: tuple[int, int] | None = None
    cell_rows: tuple[int, int] | None = None

    def of_points(self, comm: Any, array: Array) -> Rows:
        """The rows of an array of points that this rank writes."""
        return _rows(comm, array, self.point_rows)

    def of_cells(self, comm: Any, array: Array) -> Rows:
        """The rows of an array of cells that this rank writes."""
        return _rows(comm, array, self.cell_rows)


def _rows(comm: Any, array: Array, place: tuple[int, int] | None) -> Rows:
    return Rows.of_first_rank(comm, array) if place is None else Rows(array, *place)


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
    cells, rows = x.first + np.arange(len(x.own))[:, None], (x.first, x.total)
    return Frame(with_z(x.own), "vertex", cells, data, point_rows=rows, cell_rows=rows)


def grid_frame(quantities: Sequence[GridQuantity], snapshot: Snapshot) -> Frame:
    """Cells of the grid as squares; a call for all ranks, each of which gets a block of the rows."""
    grid, window = snapshot.scene.grid, snapshot.scene.configuration.domain.layout.window
    nx, ny = grid.cells
    vertex = window.in_grid("bilinear", window.vertices)
    cell = window.cells_in_grid(np.flatnonzero(window.own))
    sort = [
        in_blocks(grid.comm, vertex, (nx + 1) * (ny + 1)), in_blocks(grid.comm, cell, nx * ny)
    ]  # fmt: skip
    x, number = sort[False](vertices(snapshot.scene)), sort[True](cell)
    corner = number.own + number.own // nx
    squares = corner[:, None] + np.array([0, 1, nx + 2, nx + 1])
    data: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    for quantity in quantities:
        rows = sort[quantity.cells](quantity.of(snapshot))
        data[quantity.cells][quantity.label] = _spatial(rows.own)
    return Frame(
        with_z(x.own), "quad", squares, *data,
        point_rows=(x.first, x.total), cell_rows=(number.first, number.total),
    )  # fmt: skip


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
