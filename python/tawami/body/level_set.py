"""Bodies given by a function that is negative inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np
import numpy.typing as npt

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.checks import names, number, real_values, room, shown, whole_number
from tawami.base.errors import InputError
from tawami.base.space import lattice
from tawami.body.body import Body
from tawami.body.border_squares import CORNERS, Signs, Squares, merged, triangulated
from tawami.body.dealing import dealt_cells
from tawami.body.filling import PER_AXIS, Filling
from tawami.body.outline import outline
from tawami.body.points import ROUND_OFF, areas, in_boxes, in_triangles, joined
from tawami.border.pieces import Border
from tawami.grid.grid import EDGES, Edge, Grid

#: Memory of a sample [bytes], and number of samples that the function is given at once.
BYTES_PER_SAMPLE, BLOCK = 16.0, 1_000_000


class Function:
    """Sign of the user's function at positions in cells."""

    def __init__(self, grid: Grid, f: Callable[[Array, Array], npt.ArrayLike]) -> None:
        if not callable(f):
            raise InputError(f"level_set: f = {shown(f)}: expected a function f(x, y) on arrays")
        self.grid, self.f = grid, f

    def __call__(self, x: Array) -> Signs:
        """-1 if the function is negative, else 1, as bytes; for positions of shape (..., 2)."""
        points = self.grid.in_metres(x).reshape(-1, 2)
        if not len(points):  # on a rank without cells
            return np.empty(x.shape[:-1], dtype=np.int8)
        try:
            values = real_values(self.f(points[:, 0], points[:, 1]))
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(
                f"level_set: f failed on arrays ({error}): expected f(x, y) on arrays of positions, "
                "with np.where and np.minimum in place of if and min"
            ) from error
        if values.shape not in ((), points[:, 0].shape):
            raise InputError(
                f"level_set: f returned an array of shape {values.shape}: expected "
                f"{points[:, 0].shape}, the shape of x"
            )
        values = np.broadcast_to(values, len(points))
        bad = np.flatnonzero(np.isnan(values))
        if len(bad):
            px, py = points[bad[0]]
            raise InputError(
                f"level_set: f is NaN at {len(bad)} points, the first is ({px:g}, {py:g}) m: expected "
                "a value everywhere on the grid"
            )
        signs = np.ones(len(points), dtype=np.int8)
        signs[values < 0] = -1
        return signs.reshape(x.shape[:-1])

    def in_cells(self, index: Indices, samples: int) -> Signs:
        """The same at `samples` points per axis in cells, and at their ends: cells x y x x.

        Args:
            index: Indices (i, j) of the cells.
            samples: Number per cell and axis.
        """
        step = lattice([np.arange(samples + 1)] * 2)
        count = max(1, BLOCK // len(step))
        parts = np.split(samples * index[:, None], range(count, len(index), count))
        signs = np.concatenate([self((part + step) / samples) for part in parts])
        return signs.reshape(-1, samples + 1, samples + 1)


def level_set(
    grid: Grid,
    f: Callable[[Array, Array], npt.ArrayLike],
    *,
    ends: Sequence[Edge] = (),
    name: str = "border",
    tolerance: float = 1e-6,
    samples: int = 8,
    per_axis: int = PER_AXIS,
    gauss: bool = False,
) -> Body:
    """The body where f(x, y) < 0, filled with particles; only the sign of f is used. A call for all
    ranks, each of which calls f in its cells.

    f is evaluated at `samples` x `samples` points in every cell. The squares between samples where f
    changes sign are divided until dividing changes the area by less than the tolerance. In each of
    them the border goes through the zeros of f on its sides and one zero in between, which is placed
    so that curved parts have the right area. A full cell gets `per_axis` x `per_axis` particles, a cut
    one at most 28.

    Parts and gaps thinner than h / samples may lie between the samples, and are then lost completely
    or in part.

    Args:
        grid: The grid.
        f: A function on arrays of x and y [m].
        ends: Edges of the grid ('left', 'right', 'bottom', 'top') where the body may end, so that f
            may be negative there.
        name: Name of the border. The parts on edges of the grid have the names of these.
        tolerance: Error of the area, relative to the area, estimated from the last division; 1e-13 at
            least.
        samples: Samples per cell and axis.
        per_axis: Particles per full cell and axis.
        gauss: Place the particles of full cells at the Gauss points with the Gauss weights.

    Raises:
        InputError: f is never negative on the grid, is NaN, or does not return an array; the body ends
            at an edge of the grid that is not in `ends`; or the tolerance is not reached.
    """
    filling = Filling("level_set", grid, per_axis, gauss)
    tolerance = number("tolerance", tolerance, low=1e-13, high=0.1)
    if not isinstance(name, str) or not name or name in EDGES:
        raise InputError(
            f"level_set: name = {shown(name)}: expected a name, and no edge of the grid"
        )
    ended = names("ends", ends, EDGES)
    samples, sign = whole_number("samples", samples, low=2), Function(grid, f)
    nx, ny = (n * samples for n in grid.cells)
    what = f"level_set: samples = {shown(samples)} in {grid.cells[0]} x {grid.cells[1]} cells"
    of_rank = BYTES_PER_SAMPLE / grid.comm.size
    room(what, (nx + 1) * (ny + 1), of_rank, "expected fewer samples")
    index = dealt_cells(grid, (0, 0), grid.cells)
    with ranks.raise_together(grid.comm):
        signs = sign.in_cells(index, samples)
    if not ranks.anywhere(grid.comm, (signs < 0).any()):
        raise InputError(
            f"level_set: f is not negative at any of the {(nx + 1) * (ny + 1)} samples, "
            f"{grid.h / samples:g} m apart, so the body has no particles: expected f < 0 inside the "
            "body; change its sign, move it into the grid, or use more samples"
        )
    _check_ends(grid, index, signs, [*ended, "left"] if grid.on_axis else ended)
    inside, squares = _along_border(grid, sign, index, signs, samples)
    area = ranks.total(grid.comm, np.count_nonzero(inside)) / samples**2
    with ranks.raise_together(grid.comm):
        triangles, whole, pieces = triangulated(sign, squares, area, tolerance)
        ending = outline(grid, pieces, name, bool(sign(np.zeros((1, 2)))[0] < 0))
    return _filled(filling, index, inside, triangles, whole, ending)


def _along_border(
    grid: Grid, sign: Function, index: Indices, signs: Signs, samples: int
) -> tuple[Mask, Squares]:
    """Mask of the squares between samples that are inside and not along the border, cells x y x x, and
    the squares along the border, where the sign changes or that touch one of these, on all ranks.

    Args:
        grid: The grid.
        sign: Sign of the function.
        index: Indices (i, j) of this rank's cells.
        signs: Signs at the samples in these cells.
        samples: Samples per cell and axis.
    """
    corners = signs[:, :-1, :-1], signs[:, :-1, 1:], signs[:, 1:, :-1], signs[:, 1:, 1:]
    least, most = reduce(np.minimum, corners), reduce(np.maximum, corners)
    count = np.multiply(grid.cells, samples)
    cell, j, i = np.nonzero(least != most)
    found = ranks.allgathered(grid.comm, samples * index[cell] + np.stack([i, j], axis=-1))
    grown = (found[:, None] + lattice([np.arange(-1, 2)] * 2)).reshape(-1, 2)
    grown = grown[((grown >= 0) & (grown < count)).all(axis=1)]
    key = np.unique(grown @ [1, count[0]])  # in rows along x
    place = np.stack(np.unravel_index(key, count, order="F"), axis=-1)
    with ranks.raise_together(grid.comm):
        at = sign((place[:, None] + CORNERS) / samples)
    inside = most < 0
    number, mine = grid.cell_numbers(index), grid.cell_numbers(place // samples)
    own = np.flatnonzero(np.isin(mine, number))
    i, j = (place[own] % samples).T
    inside[np.searchsorted(number, mine[own]), j, i] = False
    return inside, Squares(place / samples, 1 / samples, at)


def _check_ends(grid: Grid, index: Indices, signs: Signs, ends: Sequence[str]) -> None:
    """Check that the body only ends at these edges of the grid, given the signs in this rank's cells."""
    (i, j), (nx, ny) = index.T, grid.cells
    along = {
        "left": signs[i == 0, :, 0], "right": signs[i == nx - 1, :, -1],
        "bottom": signs[j == 0, 0], "top": signs[j == ny - 1, -1],
    }  # fmt: skip
    reached = ranks.any_of(grid.comm, np.array([(along[edge] < 0).any() for edge in EDGES]))
    for edge, reaches in zip(EDGES, reached, strict=True):
        if reaches and edge not in ends:
            raise InputError(
                f"level_set: f is negative on the edge '{edge}' of the grid, where the body would end: "
                f"enlarge the grid, or allow it with ends=('{edge}',)"
            )


def _filled(
    filling: Filling,
    index: Indices,
    inside: Mask,
    triangles: Array,
    whole: Sequence[Squares],
    border: Border,
) -> Body:
    """Particles for squares between samples that are inside, and along the border.

    Args:
        filling: Rule for filling cells.
        index: Indices (i, j) of this rank's cells.
        inside: Mask of the squares between samples in them, cells x y x x.
        triangles: Triangles along the border, n x 3 x 2.
        whole: Smaller squares along the border.
        border: The border of the body.
    """
    grid, samples = filling.grid, inside.shape[1]
    number = grid.cell_numbers(index)
    area = inside.sum(axis=(1, 2), dtype=np.int64) / samples**2
    of_triangle = grid.cell_numbers(grid.cell_at(triangles.mean(axis=1)))
    mine = np.isin(of_triangle, number)
    triangles, of_triangle = triangles[mine], of_triangle[mine]
    whole = [one[np.isin(_cells(grid, one), number)] for one in whole]

    def place(cell: Indices) -> Indices:
        return np.searchsorted(number, cell)

    area += np.bincount(place(of_triangle), areas(triangles), minlength=len(number))
    for one in whole:
        area += np.bincount(place(_cells(grid, one)), minlength=len(number)) * one.size**2
    full = area > 1 - ROUND_OFF
    cell, j, i = np.nonzero(inside & ~full[:, None, None])
    corner = (samples * index[cell] + np.stack([i, j], axis=-1)) / samples
    rest = ~full[place(of_triangle)]
    parts = [in_triangles(triangles[rest], of_triangle[rest])]
    for one in [Squares(corner, 1 / samples, np.empty((0, 4), dtype=np.int8)), *whole]:
        cell = _cells(grid, one)
        rest = ~full[place(cell)]
        lower, upper = merged(one.corner[rest], one.size, cell[rest])
        parts.append(in_boxes(lower, upper, grid.cell_numbers(grid.cell_at((lower + upper) / 2))))
    return filling.body(number[full], joined(parts), border=border)


def _cells(grid: Grid, squares: Squares) -> Indices:
    """Numbers of the cells that hold squares."""
    return grid.cell_numbers(grid.cell_at(squares.corner + squares.size / 2))
