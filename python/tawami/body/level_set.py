"""Bodies given by a function that is negative inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base.checks import names, number, room, shown, whole_number
from tawami.base.errors import InputError
from tawami.body import cut_cells
from tawami.body.body import Body
from tawami.body.cut_cells import ROUND_OFF, Numbers, areas
from tawami.grid.grid import EDGES, Edge, Grid

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
#: Halvings that find where the function changes its sign, and the most often that a square is divided.
BISECTIONS, DEEPEST = 46, 20
#: Squares along a border from which on it is no curve, besides four times those at first.
MANY = 20_000
#: Corners of a square, and its two triangles by one diagonal or the other, counter-clockwise.
LATTICE = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
HALVES = np.array([[[0, 1, 3], [0, 3, 2]], [[0, 1, 2], [1, 3, 2]]])
#: Memory that a sample takes while f is taken [bytes].
SAMPLE = 64.0


@dataclass(frozen=True)
class Squares:
    """Squares that the border of a body passes through, and those beside them.

    Attributes:
        corner: Lower left corners [cells], n x 2.
        size: Of all of them [cells].
        f: Signs at the corners (0, 0), (1, 0), (0, 1), (1, 1) of each, n x 4; -1 is inside.
    """

    corner: Array
    size: float
    f: npt.NDArray[np.int64]

    def __getitem__(self, chosen: Any) -> Squares:
        return Squares(self.corner[chosen], self.size, self.f[chosen])

    @property
    def cut(self) -> Mask:
        """Which ones have corners inside and outside."""
        return np.asarray((self.f != self.f[:, :1]).any(axis=1))

    def beside(self, mask: Mask) -> Mask:
        """Which ones are those of a mask, or touch one of them."""
        place = np.rint(self.corner / self.size).astype(np.int64)
        width = int(place[:, 0].max(initial=0)) + 3
        key = (place + 1) @ [1, width]
        steps = np.array([i + width * j for i in (-1, 0, 1) for j in (-1, 0, 1)])
        return np.isin(key, (key[mask][:, None] + steps).ravel())


class Function:
    """The user's function, on positions in cells; its sign."""

    def __init__(self, grid: Grid, f: Callable[[Array, Array], npt.ArrayLike]) -> None:
        if not callable(f):
            raise InputError(f"level_set: f = {shown(f)}: expected a function f(x, y) on arrays")
        self.grid, self.f = grid, f

    def __call__(self, x: Array) -> npt.NDArray[np.int64]:
        """-1 where the function is negative, else 1; x has any shape, x 2."""
        points = (self.grid.origin + self.grid.h * x).reshape(-1, 2)
        try:
            values = np.asarray(self.f(points[:, 0], points[:, 1]), dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(
                f"level_set: f failed on arrays ({error}): expected f(x, y) on arrays of positions, "
                "with np.where and np.minimum in place of if and min"
            ) from error
        if values.shape not in ((), points[:, 0].shape):
            raise InputError(
                f"level_set: f returned an array of shape {values.shape}: expected "
                f"{points[:, 0].shape}, that of x"
            )
        values = np.broadcast_to(values, len(points))
        bad = np.flatnonzero(np.isnan(values))
        if len(bad):
            px, py = points[bad[0]]
            raise InputError(
                f"level_set: f is not a number at ({px:g}, {py:g}) m and {len(bad) - 1} other points: "
                "expected a value everywhere on the grid"
            )
        return np.where(values < 0, -1, 1).reshape(x.shape[:-1])


def level_set(
    grid: Grid,
    f: Callable[[Array, Array], npt.ArrayLike],
    *,
    ends: Sequence[Edge] = (),
    tolerance: float = 1e-6,
    samples: int = 8,
    per_axis: int = 2,
    gauss: bool = False,
) -> Body:
    """The body where f(x, y) < 0, filled with particles; only the sign of f counts.

    f is taken at `samples` x `samples` points in every cell. Squares of these where it changes sign
    are divided until that changes the area by less than the tolerance; the border in them is where f
    is 0 on their sides and in between, joined so that curved parts have no area too much or too
    little. A full cell gets `per_axis` x `per_axis` particles, a cut one at most 28.

    What lies between the samples is not seen: parts and gaps thinner than h / samples are lost in
    whole or in part.

    Args:
        grid: The grid.
        f: A function on arrays of x and y [m].
        ends: Edges of the grid ('left', 'right', 'bottom', 'top') at which the body may end, f being
            negative there.
        tolerance: Of the area, as a share of it, judged by what dividing changes; 1e-13 at least.
        samples: Along a cell in each axis.
        per_axis: Particles per full cell and axis.
        gauss: Put those at the Gauss points, with the Gauss weights, instead of evenly.

    Raises:
        InputError: f is never negative on the grid, is NaN, or does not return an array; a body that
            another edge of the grid would end; a tolerance that cannot be kept.
    """
    cut_cells.check("level_set", grid, per_axis, gauss)
    tolerance = number("tolerance", tolerance, low=1e-13, high=0.1)
    ended = names("ends", ends, EDGES)
    samples, sign = whole_number("samples", samples, low=2), Function(grid, f)
    nx, ny = (n * samples for n in grid.cells)
    what = f"level_set: samples = {shown(samples)} in {grid.cells[0]} x {grid.cells[1]} cells"
    room(what, (nx + 1) * (ny + 1), SAMPLE, "expected fewer samples")
    x, y = np.meshgrid(np.arange(nx + 1) / samples, np.arange(ny + 1) / samples)
    signs = sign(np.stack([x, y], axis=-1))
    if not (signs < 0).any():
        raise InputError(
            f"level_set: f is nowhere negative at the {signs.size} points where it was taken, "
            f"{grid.h / samples:g} m apart: a body without particles. Expected f < 0 inside the body; "
            "change its sign, move it into the grid, or take more samples"
        )
    _check_ends(signs, ended)
    at = np.stack([signs[:-1, :-1], signs[:-1, 1:], signs[1:, :-1], signs[1:, 1:]], axis=-1)
    corner = np.stack([x, y], axis=-1)[:-1, :-1].reshape(-1, 2)
    squares = Squares(corner, 1 / samples, at.reshape(-1, 4))
    border = squares.beside(squares.cut)
    inside = corner[(squares.f < 0).all(axis=1) & ~border]
    triangles = _refined(sign, squares[border], len(inside) / samples**2, tolerance)
    return _filled(grid, inside, triangles, samples, per_axis, gauss)


def _check_ends(signs: Numbers, ends: Sequence[str]) -> None:
    """Whether only those edges of the grid end the body; signs at the samples, y by x."""
    along = {"left": signs[:, 0], "right": signs[:, -1], "bottom": signs[0], "top": signs[-1]}
    for edge in EDGES:
        if (along[edge] < 0).any() and edge not in ends:
            raise InputError(
                f"level_set: f is negative on the edge '{edge}' of the grid, which would end the body "
                f"there: enlarge the grid, or say so with ends=('{edge}',)"
            )


def _filled(
    grid: Grid,
    corner: Array,
    triangles: Array,
    samples: int,
    per_axis: int,
    gauss: bool,
) -> Body:
    """Particles for squares that are inside, and for triangles along the border."""
    (nx, ny), size = grid.cells, 1 / samples

    def cells(middle: Array) -> Numbers:
        return np.clip(np.floor(middle), 0, [nx - 1, ny - 1]).astype(np.int64)

    of_square, of_triangle = cells(corner + size / 2), cells(triangles.mean(axis=1))
    key_of_square, key_of_triangle = of_square @ [1, nx], of_triangle @ [1, nx]
    area = np.bincount(key_of_square, minlength=nx * ny) * size**2
    area += np.bincount(key_of_triangle, areas(triangles), minlength=nx * ny)
    whole = area > 1 - ROUND_OFF
    rest, cut = ~whole[key_of_square], ~whole[key_of_triangle]
    halves = (LATTICE * size)[HALVES[0]]
    squares = (corner[rest][:, None, None] + halves).reshape(-1, 3, 2)
    points = cut_cells.in_triangles(
        np.concatenate([squares, triangles[cut]]),
        np.concatenate([np.repeat(of_square[rest], 2, axis=0), of_triangle[cut]]),
    )
    full = np.flatnonzero(whole)
    cell = np.column_stack([full % nx, full // nx])
    return Body(*cut_cells.to_body(grid, cell, points, per_axis, gauss))


def _refined(sign: Function, squares: Squares, inside: float, tolerance: float) -> Array:
    """Triangles that fill the body in squares along its border, which are divided where it matters.

    Args:
        sign: Of the function.
        squares: Along the border.
        inside: Area of the body elsewhere [cells^2].
        tolerance: Of the area, as a share of it.
    """
    done = list[Array]()
    triangles, of_square = _pieces(sign, squares)
    most = MANY + 4 * len(squares.corner)
    for level in range(DEEPEST):
        count = len(squares.corner)
        if count > most:
            break
        if not count:
            return np.concatenate([triangles, *done])
        before = np.bincount(of_square, areas(triangles), minlength=count)
        parts = _quarters(sign, squares)
        triangles, of_part = _pieces(sign, parts)
        found = areas(triangles)
        change = np.abs(np.bincount(of_part // 4, found, minlength=count) - before)
        # what all levels leave adds up to a tenth of the tolerance: a change is no bound of the error
        limit = 0.06 * tolerance * (inside + found.sum()) / (level + 1) ** 2
        split = (change > limit / count) & (change.sum() > limit)
        # a border that bends into the next square and back is seen there when that is divided
        again = np.repeat(squares.beside(split), 4) & parts.beside(parts.cut & np.repeat(split, 4))
        pending = again[of_part]
        done.append(triangles[~pending])
        inside += found[~pending].sum()
        squares, triangles = parts[again], triangles[pending]
        of_square = (np.cumsum(again) - 1)[of_part[pending]]
    raise InputError(
        f"level_set: tolerance = {tolerance:g} of the area was not reached in squares of "
        f"{squares.size:.1g} cells: expected a border that is a curve; take a larger tolerance"
    )


def _quarters(sign: Function, squares: Squares) -> Squares:
    """The four quarters of each square, one after the other."""
    half = squares.size / 2
    steps = np.array([[i, j] for j in range(3) for i in range(3)])
    known, new = [0, 2, 6, 8], [1, 3, 4, 5, 7]
    f = np.empty((len(squares.corner), 9), dtype=np.int64)
    f[:, known] = squares.f
    f[:, new] = sign(squares.corner[:, None] + half * steps[new])
    of_quarter = np.array([[0, 1, 3, 4], [1, 2, 4, 5], [3, 4, 6, 7], [4, 5, 7, 8]])
    corner = squares.corner[:, None] + half * steps[[0, 1, 3, 4]]
    return Squares(corner.reshape(-1, 2), half, f[:, of_quarter].reshape(-1, 4))


def _pieces(sign: Function, squares: Squares) -> tuple[Array, Numbers]:
    """Triangles that fill the body in squares, and the square of each.

    A square is two triangles. In one that the border passes through it goes from side to side, by a
    point in between: where a parabola has its area (two thirds of what is below its height, so 4/3 of
    the height).
    """
    # the diagonal goes through a corner whose sign is that of no other
    odd = np.abs((squares.f * squares.f.sum(axis=1)[:, None]).argmin(axis=1) - 1.5) < 1
    halves = HALVES[odd.astype(int)].reshape(-1, 6)
    corners = squares.corner[:, None] + squares.size * LATTICE
    corners = np.take_along_axis(corners, halves[..., None], axis=1).reshape(-1, 3, 2)
    f = np.take_along_axis(squares.f, halves, axis=1).reshape(-1, 3)
    number = np.repeat(np.arange(len(squares.corner)), 2)
    count = (f < 0).sum(axis=1)
    found, of = [corners[count == 3]], [number[count == 3]]
    for alone, least in ((-1, 1), (1, 2)):  # the corner that is alone is inside, or outside
        mine = np.flatnonzero(count == least)
        first = (f[mine] == alone).argmax(axis=1)
        a, b, c = (corners[mine, (first + k) % 3] for k in range(3))
        p, q = _crossing(sign, a, b, alone), _crossing(sign, a, c, alone)
        middle = (p + q) / 2
        side = sign(middle) if len(mine) else np.empty(0, dtype=np.int64)
        # from the middle of the chord towards where the function has the other sign
        target = np.where((side == alone)[:, None], (b + c) / 2, a)
        on = _crossing(sign, middle, target, side)
        m = middle + np.minimum(4 / 3 * _share(middle, target, on), 1)[:, None] * (target - middle)
        fans = ((a, p, m), (a, m, q)) if alone < 0 else ((m, b, c), (m, c, q), (m, p, b))
        found += [np.stack(fan, axis=1) for fan in fans]
        of += [number[mine]] * len(fans)
    triangles, squares_of = np.concatenate(found), np.concatenate(of)
    large = areas(triangles) > 0
    return triangles[large], squares_of[large]


def _crossing(sign: Function, a: Array, b: Array, at_a: Any) -> Array:
    """Where the function changes its sign between points a, where it is `at_a`, and b; b if it does
    not.
    """
    low, high = np.zeros(len(a)), np.ones(len(a))
    if len(a):
        for _ in range(BISECTIONS):
            t = (low + high) / 2
            same = sign(a + t[:, None] * (b - a)) == at_a
            low, high = np.where(same, t, low), np.where(same, high, t)
    return a + high[:, None] * (b - a)


def _share(a: Array, b: Array, x: Array) -> Array:
    """How far x is on the way from a to b; 0 where there is no way."""
    way = b - a
    length = (way**2).sum(axis=1)
    return np.divide(((x - a) * way).sum(axis=1), length, out=np.zeros(len(a)), where=length > 0)
