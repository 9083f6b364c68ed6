"""Squares along the border of a level set, divided until the area of the body is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError
from tawami.body.points import areas

#: Bisections that find where the sign changes.
BISECTIONS = 46
#: Largest number of times that a square is divided.
DEEPEST = 20
#: Squares, besides four times the initial ones, above which the border is not a curve.
MANY = 20_000
#: Corners of a square, and its two triangles by one diagonal or the other, counter-clockwise.
CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
HALVES = np.array([[[0, 1, 3], [0, 3, 2]], [[0, 1, 2], [1, 3, 2]]])
#: Signs, as bytes.
Signs = npt.NDArray[np.int8]
#: Sign of the user's function at positions (..., 2) in cells: -1 inside the body, else 1.
Sign = Callable[[Array], Signs]


@dataclass(frozen=True)
class Squares:
    """Squares of one size.

    Attributes:
        corner: Lower left corners [cells], n x 2.
        size: Their side [cells].
        sign: Signs at the corners (0, 0), (1, 0), (0, 1), (1, 1) of each, n x 4; -1 is inside.
    """

    corner: Array
    size: float
    sign: Signs

    def __getitem__(self, chosen: Any) -> Squares:
        return Squares(self.corner[chosen], self.size, self.sign[chosen])

    @property
    def cut(self) -> Mask:
        """Mask of the squares with corners inside and outside."""
        return np.asarray((self.sign != self.sign[:, :1]).any(axis=1))

    def near(self, mask: Mask) -> Mask:
        """Mask of the given squares and of those that touch one of them."""
        place = np.rint(self.corner / self.size).astype(np.int64)
        width = int(place[:, 0].max(initial=0)) + 3
        key = (place + 1) @ [1, width]
        steps = np.array([i + width * j for i in (-1, 0, 1) for j in (-1, 0, 1)])
        return np.isin(key, (key[mask][:, None] + steps).ravel())


def triangulated(
    sign: Sign, squares: Squares, inside: float, tolerance: float
) -> tuple[Array, list[Squares], Array]:
    """Triangles (n x 3 x 2) and squares that fill the body in squares along its border, and the straight
    pieces of the border (n x 2 x 2, with the body on the left).

    Args:
        sign: Sign of the function.
        squares: Squares along the border.
        inside: Area of the body elsewhere [cells^2].
        tolerance: Error of the area, relative to the area.

    Raises:
        InputError: The tolerance is not reached.
    """
    done, whole, border = list[Array](), list[Squares](), [np.empty((0, 2, 2))]
    triangles, of_square, *_ = _pieces(sign, squares)
    most = MANY + 4 * len(squares.corner)
    for level in range(DEEPEST):
        count = len(squares.corner)
        if count > most:
            break
        if not count:
            return np.concatenate([triangles, *done]), whole, np.concatenate(border)
        before = np.bincount(of_square, areas(triangles), minlength=count)
        parts = _quarters(sign, squares)
        triangles, of_part, pieces, of_piece = _pieces(sign, parts)
        found = areas(triangles)
        change = np.abs(np.bincount(of_part // 4, found, minlength=count) - before)
        # A change is not a bound of the error: all levels together may leave a tenth of the tolerance.
        limit = 0.06 * tolerance * (inside + found.sum()) / (level + 1) ** 2
        split = (change > limit / count) & (change.sum() > limit)
        # If the border bends into the next square and back, only dividing that square shows it.
        again = np.repeat(squares.near(split), 4) & parts.near(parts.cut & np.repeat(split, 4))
        pending = again[of_part]
        full = (parts.sign < 0).all(axis=1)
        whole.append(parts[full & ~again])
        border.append(pieces[~again[of_piece]])
        done.append(triangles[~pending & ~full[of_part]])
        inside += found[~pending].sum()
        squares, triangles = parts[again], triangles[pending]
        of_square = (np.cumsum(again) - 1)[of_part[pending]]
    raise InputError(
        f"level_set: tolerance = {tolerance:g} of the area was not reached in squares of "
        f"{squares.size:.1g} cells: expected a border that is a curve; use a larger tolerance"
    )


def merged(corner: Array, size: float, cell: Indices) -> tuple[Array, Array]:
    """Boxes that are unions of squares of one cell: their lower and upper corners, n x 2.

    Args:
        corner: Lower left corners of the squares [cells], n x 2.
        size: Their side [cells].
        cell: Number of the cell of each.
    """
    low = np.rint(corner / size).astype(np.int64)
    high, cell = low + 1, np.asarray(cell)
    for axis in range(low.shape[1]):  # first rows along x, then equal rows along y
        same = [cell, *np.delete(low, axis, axis=1).T, *np.delete(high, axis, axis=1).T]
        order = np.lexsort((low[:, axis], *same))
        low, high, cell = low[order], high[order], cell[order]
        starts = np.ones(len(cell), dtype=bool)
        fixed = np.column_stack([part[order] for part in same])
        starts[1:] = (fixed[1:] != fixed[:-1]).any(axis=1) | (low[1:, axis] != high[:-1, axis])
        first = np.flatnonzero(starts)
        last = np.append(first[1:], len(cell)) - 1
        high = high[last[: len(first)]]
        low, cell = low[first], cell[first]
    return low * size, high * size


def _quarters(sign: Sign, squares: Squares) -> Squares:
    """The four quarters of each square, one after another."""
    half = squares.size / 2
    steps = np.array([[i, j] for j in range(3) for i in range(3)])
    known, new = [0, 2, 6, 8], [1, 3, 4, 5, 7]
    signs = np.empty((len(squares.corner), 9), dtype=np.int8)
    signs[:, known] = squares.sign
    signs[:, new] = sign(squares.corner[:, None] + half * steps[new])
    of_quarter = np.array([[0, 1, 3, 4], [1, 2, 4, 5], [3, 4, 6, 7], [4, 5, 7, 8]])
    corner = squares.corner[:, None] + half * steps[[0, 1, 3, 4]]
    return Squares(corner.reshape(-1, 2), half, signs[:, of_quarter].reshape(-1, 4))


def _pieces(sign: Sign, squares: Squares) -> tuple[Array, Indices, Array, Indices]:
    """Triangles that fill the body in squares, the square of each, pieces of the border (n x 2 x 2, with
    the body on the left), and the square of each.

    A square is two triangles. The border crosses a triangle from side to side through a point in
    between. This point is chosen so that the two straight pieces enclose the area of the parabola
    through the crossings: that area is two thirds of its height, so the point is at 4/3 of the height.
    """
    # The diagonal goes through the corner whose sign differs from the three others.
    odd = np.abs((squares.sign * squares.sign.sum(axis=1)[:, None]).argmin(axis=1) - 1.5) < 1
    halves = HALVES[odd.astype(int)].reshape(-1, 6)
    corners = squares.corner[:, None] + squares.size * CORNERS
    corners = np.take_along_axis(corners, halves[..., None], axis=1).reshape(-1, 3, 2)
    signs = np.take_along_axis(squares.sign, halves, axis=1).reshape(-1, 3)
    number = np.repeat(np.arange(len(squares.corner)), 2)
    count = (signs < 0).sum(axis=1)
    found, of = [corners[count == 3]], [number[count == 3]]
    border, of_border = list[Array](), list[Indices]()
    for alone, least in ((-1, 1), (1, 2)):  # one corner is inside, or one corner is outside
        mine = np.flatnonzero(count == least)
        first = (signs[mine] == alone).argmax(axis=1)
        a, b, c = (corners[mine, (first + k) % 3] for k in range(3))
        p, q = _crossing(sign, a, b, alone), _crossing(sign, a, c, alone)
        middle = (p + q) / 2
        side = sign(middle) if len(mine) else np.empty(0, dtype=np.int8)
        # from the middle of the chord towards the other sign
        target = np.where((side == alone)[:, None], (b + c) / 2, a)
        on = _crossing(sign, middle, target, side)
        share = np.minimum(4 / 3 * _share(middle, target, on), 1)
        m = middle + share[:, None] * (target - middle)
        fans = ((a, p, m), (a, m, q)) if alone < 0 else ((m, b, c), (m, c, q), (m, p, b))
        found += [np.stack(fan, axis=1) for fan in fans]
        of += [number[mine]] * len(fans)
        pieces = ((p, m), (m, q)) if alone < 0 else ((q, m), (m, p))
        border += [np.stack(ends, axis=1) for ends in pieces]
        of_border += [number[mine]] * 2
    triangles, squares_of = np.concatenate(found), np.concatenate(of)
    large = areas(triangles) > 0
    return triangles[large], squares_of[large], np.concatenate(border), np.concatenate(of_border)


def _crossing(sign: Sign, a: Array, b: Array, at_a: Any) -> Array:
    """Points between a, where the sign is `at_a`, and b where the sign changes; b if it does not."""
    low, high = np.zeros(len(a)), np.ones(len(a))
    if len(a):
        for _ in range(BISECTIONS):
            t = (low + high) / 2
            same = sign(a + t[:, None] * (b - a)) == at_a
            low, high = np.where(same, t, low), np.where(same, high, t)
    return a + high[:, None] * (b - a)


def _share(a: Array, b: Array, x: Array) -> Array:
    """Distance of x from a as a share of the distance from a to b; 0 if a and b coincide."""
    direction = b - a
    squared = (direction**2).sum(axis=1)
    along = ((x - a) * direction).sum(axis=1)
    return np.divide(along, squared, out=np.zeros(len(a)), where=squared > 0)
