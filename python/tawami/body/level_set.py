"""Bodies given by a function that is negative inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array, Indices
from tawami.base.checks import names, number, real_values, room, shown, whole_number
from tawami.base.errors import InputError
from tawami.base.space import lattice
from tawami.body.body import Body
from tawami.body.border_squares import Squares, triangulated
from tawami.body.filling import PER_AXIS, Filling
from tawami.body.points import ROUND_OFF, areas, halves, in_triangles
from tawami.grid.grid import EDGES, Edge, Grid

#: Memory of a sample while the function is evaluated [bytes].
BYTES_PER_SAMPLE = 64.0


class Function:
    """Sign of the user's function at positions in cells."""

    def __init__(self, grid: Grid, f: Callable[[Array, Array], npt.ArrayLike]) -> None:
        if not callable(f):
            raise InputError(f"level_set: f = {shown(f)}: expected a function f(x, y) on arrays")
        self.grid, self.f = grid, f

    def __call__(self, x: Array) -> Indices:
        """-1 if the function is negative, else 1; for positions of shape (..., 2)."""
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
        return np.where(values < 0, -1, 1).reshape(x.shape[:-1])


def level_set(
    grid: Grid,
    f: Callable[[Array, Array], npt.ArrayLike],
    *,
    ends: Sequence[Edge] = (),
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

    What lies between the samples is not seen: parts and gaps thinner than h / samples are lost
    completely or in part.

    Args:
        grid: The grid.
        f: A function on arrays of x and y [m].
        ends: Edges of the grid ('left', 'right', 'bottom', 'top') where the body may end, so that f
            may be negative there.
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
    ended = names("ends", ends, EDGES)
    samples, sign = whole_number("samples", samples, low=2), Function(grid, f)
    nx, ny = (n * samples for n in grid.cells)
    what = f"level_set: samples = {shown(samples)} in {grid.cells[0]} x {grid.cells[1]} cells"
    room(what, (nx + 1) * (ny + 1), BYTES_PER_SAMPLE, "expected fewer samples")
    x = lattice([np.arange(n + 1) / samples for n in (nx, ny)]).reshape(ny + 1, nx + 1, 2)
    signs = sign(x)
    if not (signs < 0).any():
        raise InputError(
            f"level_set: f is not negative at any of the {signs.size} samples, "
            f"{grid.h / samples:g} m apart, so the body has no particles: expected f < 0 inside the "
            "body; change its sign, move it into the grid, or take more samples"
        )
    _check_ends(signs, ended)
    at = np.stack([signs[:-1, :-1], signs[:-1, 1:], signs[1:, :-1], signs[1:, 1:]], axis=-1)
    squares = Squares(x[:-1, :-1].reshape(-1, 2), 1 / samples, at.reshape(-1, 4))
    border = squares.near(squares.cut)
    inside = squares.corner[(squares.sign < 0).all(axis=1) & ~border]
    area = len(inside) / samples**2
    triangles = triangulated(sign, squares[border], area, tolerance)
    return _filled(filling, inside, triangles, samples)


def _check_ends(signs: Indices, ends: Sequence[str]) -> None:
    """Check that the body only ends at these edges of the grid; signs at the samples, y by x."""
    along = {"left": signs[:, 0], "right": signs[:, -1], "bottom": signs[0], "top": signs[-1]}
    for edge in EDGES:
        if (along[edge] < 0).any() and edge not in ends:
            raise InputError(
                f"level_set: f is negative on the edge '{edge}' of the grid, where the body would end: "
                f"enlarge the grid, or allow it with ends=('{edge}',)"
            )


def _filled(filling: Filling, corner: Array, triangles: Array, samples: int) -> Body:
    """Particles for squares that are inside, and for triangles along the border."""
    grid, size = filling.grid, 1 / samples
    of_square = grid.cell_numbers(grid.cell_at(corner + size / 2))
    of_triangle = grid.cell_numbers(grid.cell_at(triangles.mean(axis=1)))
    area = np.bincount(of_square, minlength=grid.num_cells) * size**2
    area += np.bincount(of_triangle, areas(triangles), minlength=grid.num_cells)
    full = area > 1 - ROUND_OFF
    rest, cut = ~full[of_square], ~full[of_triangle]
    points = in_triangles(
        np.concatenate([halves(corner[rest], size).reshape(-1, 3, 2), triangles[cut]]),
        np.concatenate([np.repeat(of_square[rest], 2), of_triangle[cut]]),
    )
    return filling.body(np.flatnonzero(full), points)
