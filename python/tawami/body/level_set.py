"""Bodies given by a function that is negative inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array, Indices, Mask
from tawami.base.checks import names, number, real_values, room, shown, whole_number
from tawami.base.errors import InputError
from tawami.base.space import lattice
from tawami.body.body import Body
from tawami.body.border_squares import Signs, Squares, merged, triangulated
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

    def at_samples(self, samples: int) -> Signs:
        """The same at `samples` points per cell and axis, y by x; rows of them are taken together."""
        nx, ny = (n * samples for n in self.grid.cells)
        rows = max(1, BLOCK // (nx + 1))
        x = np.arange(nx + 1) / samples
        return np.concatenate([
            self(lattice([x, along / samples]).reshape(len(along), nx + 1, 2))
            for along in np.split(np.arange(ny + 1), range(rows, ny + 1, rows))
        ])  # fmt: skip


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
    """The body where f(x, y) < 0, filled with particles; only the sign of f is used.

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
    room(what, (nx + 1) * (ny + 1), BYTES_PER_SAMPLE, "expected fewer samples")
    signs = sign.at_samples(samples)
    if not (signs < 0).any():
        raise InputError(
            f"level_set: f is not negative at any of the {signs.size} samples, "
            f"{grid.h / samples:g} m apart, so the body has no particles: expected f < 0 inside the "
            "body; change its sign, move it into the grid, or use more samples"
        )
    _check_ends(signs, [*ended, "left"] if grid.on_axis else ended)
    corners = signs[:-1, :-1], signs[:-1, 1:], signs[1:, :-1], signs[1:, 1:]
    least, most = reduce(np.minimum, corners), reduce(np.maximum, corners)
    border = _grown(least != most)
    inside = (most < 0) & ~border
    at = np.stack([corner[border] for corner in corners], axis=-1)
    squares = Squares(np.argwhere(border)[:, ::-1] / samples, 1 / samples, at)
    area = np.count_nonzero(inside) / samples**2
    triangles, whole, pieces = triangulated(sign, squares, area, tolerance)
    ending = outline(grid, pieces, name, bool(signs[0, 0] < 0))
    return _filled(filling, inside, triangles, whole, samples, ending)


def _grown(mask: Mask) -> Mask:
    """A mask of squares with all squares that touch it."""
    for axis in range(mask.ndim):
        grown, (low, high) = mask.copy(), (slice(None, -1), slice(1, None))
        along = (slice(None),) * axis
        grown[(*along, low)] |= mask[(*along, high)]
        grown[(*along, high)] |= mask[(*along, low)]
        mask = grown
    return mask


def _check_ends(signs: Signs, ends: Sequence[str]) -> None:
    """Check that the body only ends at these edges of the grid; signs at the samples, y by x."""
    along = {"left": signs[:, 0], "right": signs[:, -1], "bottom": signs[0], "top": signs[-1]}
    for edge in EDGES:
        if (along[edge] < 0).any() and edge not in ends:
            raise InputError(
                f"level_set: f is negative on the edge '{edge}' of the grid, where the body would end: "
                f"enlarge the grid, or allow it with ends=('{edge}',)"
            )


def _filled(
    filling: Filling,
    inside: Mask,
    triangles: Array,
    whole: Sequence[Squares],
    samples: int,
    border: Border,
) -> Body:
    """Particles for squares between samples that are inside, and along the border.

    Args:
        filling: Rule for filling cells.
        inside: Mask of the squares between samples, y by x.
        triangles: Triangles along the border, n x 3 x 2.
        whole: Smaller squares along the border.
        samples: Samples per cell and axis.
        border: The border of the body.
    """
    grid, (nx, ny) = filling.grid, filling.grid.cells
    count = inside.reshape(ny, samples, nx, samples).sum(axis=(1, 3), dtype=np.int64)
    area = count.ravel() / samples**2
    of_triangle = grid.cell_numbers(grid.cell_at(triangles.mean(axis=1)))
    area += np.bincount(of_triangle, areas(triangles), minlength=grid.num_cells)
    for one in whole:
        area += np.bincount(_cells(grid, one), minlength=grid.num_cells) * one.size**2
    full = area > 1 - ROUND_OFF
    in_cut_cells = np.kron(~full.reshape(ny, nx), np.ones((samples, samples), dtype=bool))
    corner = np.argwhere(inside & in_cut_cells)[:, ::-1] / samples
    parts = [in_triangles(triangles[~full[of_triangle]], of_triangle[~full[of_triangle]])]
    for one in [Squares(corner, 1 / samples, np.empty((0, 4), dtype=np.int8)), *whole]:
        cell = _cells(grid, one)
        lower, upper = merged(one.corner[~full[cell]], one.size, cell[~full[cell]])
        parts.append(in_boxes(lower, upper, grid.cell_numbers(grid.cell_at((lower + upper) / 2))))
    return filling.body(np.flatnonzero(full), joined(parts), border=border)


def _cells(grid: Grid, squares: Squares) -> Indices:
    """Numbers of the cells that hold squares."""
    return grid.cell_numbers(grid.cell_at(squares.corner + squares.size / 2))
