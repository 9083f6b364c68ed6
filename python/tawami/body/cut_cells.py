"""Particles in the cells that a shape fills or cuts. All lengths here are cells of the grid, from its
origin; `to_body` makes metres of them.

A full cell gets per_axis x per_axis particles. What is left of a cut cell is divided into triangles
with the points of a Gauss rule in each; where these are more than MOST, they are thinned out to points
with positive weights that have the same moments up to the degree of the rule (Tchakaloff's theorem;
found by non-negative least squares: Piazzon, Sommariva and Vianello 2017).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base.checks import instance, room, shown, switch, whole_number
from tawami.base.errors import InputError
from tawami.fem import rules
from tawami.grid.grid import Grid

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
#: Degree of the rule on the triangles of a cut cell: grad w : C : grad u of quadratic splines.
DEGREE = 6
#: Particles that a cut cell has at most: the number of moments up to that degree.
MOST = (DEGREE + 1) * (DEGREE + 2) // 2
#: A side or vertex this near to a line of the grid lies on it.
ON_LINE = 1e-6
#: A part of a cell this small, or this share of a body smaller than a cell, is round-off.
ROUND_OFF = 1e-12
#: Points along an axis of the largest Gauss rule.
MOST_POINTS = 1000
#: Memory that a particle takes while a body is filled and in the arrays of a scene [bytes].
PARTICLE = 128.0
#: Error of a moment, over the area, from which on points are not thinned out.
MOMENT_ERROR = 1e-12


@dataclass(frozen=True)
class Points:
    """Points that integrate over parts of cells.

    Attributes:
        x: Where they are, n x 2.
        weight: Their areas, n; negative ones take away.
        cell: Lower left corner of the cell of each, n x 2.
    """

    x: Array
    weight: Array
    cell: Numbers

    def __add__(self, other: Points) -> Points:
        """Both together."""
        return Points(
            np.concatenate([self.x, other.x]),
            np.concatenate([self.weight, other.weight]),
            np.concatenate([self.cell, other.cell]),
        )


def along_an_axis(number: int, gauss: bool, cells: int = 1) -> tuple[Array, Array]:
    """Positions and weights of the particles of a full cell along an axis, the cell being 0 to 1, for
    so many cells.
    """
    number = whole_number("per_axis", number, low=1)
    what = f"per_axis = {shown(number)} in {cells} cell{'s' if cells > 1 else ''}"
    room(what, cells * number**2, PARTICLE, "expected fewer particles")
    if switch("gauss", gauss):
        return _rust.gauss(whole_number("per_axis", number, low=1, high=MOST_POINTS))
    return (np.arange(number) + 0.5) / number, np.full(number, 1 / number)


def check(name: str, grid: Any, per_axis: int, gauss: bool) -> None:
    """What all shapes are given, before anything is made of it.

    Raises:
        InputError: No grid, or particles that are no number or too many.
    """
    instance(f"{name}: grid", grid, Grid, "a tawami.Grid")
    along_an_axis(per_axis, gauss)


def in_full_cells(cell: Numbers, per_axis: int, gauss: bool) -> Points:
    """The particles of full cells, given by their lower left corners."""
    points, weights = along_an_axis(per_axis, gauss, max(len(cell), 1))
    n = len(points)
    lattice = np.column_stack([np.tile(points, n), np.repeat(points, n)])
    return Points(
        (cell[:, None] + lattice).reshape(-1, 2),
        np.tile(np.outer(weights, weights).ravel(), len(cell)),
        np.repeat(cell, n * n, axis=0),
    )


def areas(triangles: Array) -> Array:
    """Of triangles (n x 3 x 2), positive where their corners are counter-clockwise."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


def on_lines(scaled: Array) -> Array:
    """Positions in cells, those within ON_LINE of a line of the grid put on it."""
    near = np.isclose(scaled, np.rint(scaled), rtol=0, atol=ON_LINE)
    return np.where(near, np.rint(scaled), scaled)


def in_triangles(corners: Array, cell: Numbers) -> Points:
    """The Gauss points of triangles (n x 3 x 2), either way round, each in one cell."""
    points, weights = rules.triangle_rule(DEGREE)
    barycentric = np.column_stack([1 - points.sum(axis=1), points])
    return Points(
        (barycentric @ corners).reshape(-1, 2),
        np.outer(np.abs(areas(corners)), 2 * weights).ravel(),
        np.repeat(cell, len(weights), axis=0),
    )


def cells_of(bounds: Array) -> Numbers:
    """Lower left corners of the cells that touch a box (x, y, x1, y1), x fastest."""
    lower, upper = np.floor(bounds[:2]).astype(int), np.ceil(bounds[2:]).astype(int)
    i, j = (np.arange(a, b) for a, b in zip(lower, upper, strict=True))
    return np.column_stack([np.tile(i, len(j)), np.repeat(j, len(i))])


def clipped(shape: Any) -> tuple[Numbers, Array, Numbers]:
    """A polygon or multipolygon by cells: those that it fills, triangles (n x 3 x 2) of what it leaves
    of others, and their cells.
    """
    import shapely  # here and below: a scene without such bodies does without it

    cell = cells_of(np.array(shape.bounds))
    boxes = shapely.box(*cell.T, *(cell + 1).T)
    shapely.prepare(shape)
    full = shapely.covers(shape, boxes)
    rest = np.flatnonzero(~full & shapely.intersects(shape, boxes))
    parts = shapely.intersection(shape, boxes[rest])
    area = shapely.area(parts)
    full[rest[area > 1 - ROUND_OFF]] = True
    cut = (area > 0) & ~full[rest]
    triangles, of_part = shapely.get_parts(
        shapely.constrained_delaunay_triangles(parts[cut]), return_index=True
    )
    large = shapely.area(triangles) > ROUND_OFF * min(1.0, shape.area)
    corners = shapely.get_coordinates(triangles[large]).reshape(-1, 4, 2)[:, :3]
    return cell[full], corners, cell[rest[cut][of_part[large]]]


def to_body(
    grid: Grid, full: Numbers, cut: Points, per_axis: int, gauss: bool, kept: Any = None
) -> tuple[Array, Array]:
    """Positions [m] and volumes [m2] of the particles of full cells and of parts of cells.

    Args:
        grid: The grid.
        full: Lower left corners of full cells.
        cut: Points that integrate over parts of cells.
        per_axis, gauss: As of `tawami.box`.
        kept: Says which points (n x 2) particles may be at; all by default.
    """
    whole = in_full_cells(full, per_axis, gauss)
    x, weight, _ = thinned(cut, len(full), kept)
    x, weight = np.concatenate([whole.x, x]), np.concatenate([whole.weight, weight])
    if not len(x):
        raise InputError("a body without particles: expected a shape with an area")
    return grid.origin + grid.h * x, grid.h**2 * weight


def thinned(points: Points, full: int, kept: Any = None) -> tuple[Array, Array, Numbers]:
    """At most MOST points for each cell, their weights, and the first of the points of that cell; none
    where that is round-off of the body, which has so many full cells besides.
    """
    none = np.empty(0, dtype=np.int64)
    x, weight, first = [points.x[:0]], [points.weight[:0]], [none]
    width = int(points.cell[:, 0].max(initial=0)) + 1
    key = points.cell[:, 0] + width * points.cell[:, 1]
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    least = ROUND_OFF * min(1.0, full + float(points.weight.sum()))
    for group in np.split(order, starts)[1:]:
        if points.weight[group].sum() <= least:
            continue
        found = _of_cell(points.x[group], points.weight[group], kept)
        x.append(found[0])
        weight.append(found[1])
        first.append(np.full(len(found[0]), group[0]))
    return np.concatenate(x), np.concatenate(weight), np.concatenate(first)


def _of_cell(x: Array, weight: Array, kept: Any) -> tuple[Array, Array]:
    """The points of a cell, at most MOST and with positive weights."""
    may = weight > 0
    if kept is not None:
        may &= kept(x)
    if may.all() and len(x) <= MOST:
        return x, weight
    area = weight.sum()
    may = may if may.any() else weight > 0
    low, high = x.min(axis=0), x.max(axis=0)
    t = (2 * x - low - high) / np.maximum(high - low, np.finfo(float).tiny)
    px, py = (t[:, k, None] ** np.arange(DEGREE + 1) for k in range(2))
    moments = np.column_stack(
        [px[:, i] * py[:, j] for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    )
    # functions that are orthonormal over the points: a sliver is as well conditioned as a square
    root = np.sqrt(weight[may])
    q, r = np.linalg.qr(root[:, None] * moments[may])
    wanted = q.T @ root
    if not may.all():
        wanted = wanted + np.linalg.lstsq(r.T, moments[~may].T @ weight[~may], rcond=None)[0]
    size = np.linalg.norm(wanted)
    found, rest = _fitted((q / root[:, None]).T, wanted, weight[may])
    if rest > MOMENT_ERROR * size and may.all():
        return x, weight
    chosen = found > 0
    found = found[chosen]
    return x[may][chosen], found * (area / found.sum())


def _fitted(functions: Array, moments: Array, weight: Array) -> tuple[Array, float]:
    """Non-negative weights with these moments, and how far they are off; `weight` if there are none."""
    from scipy.optimize import nnls  # here: a scene without cut cells does without it

    found, rest = weight, np.inf
    with suppress(RuntimeError):  # too many iterations
        found = nnls(functions, moments)[0]
        rest = float(np.linalg.norm(functions @ found - moments))
    if rest > 0.1 * MOMENT_ERROR * np.linalg.norm(moments):  # SciPy 1.12 to 1.15 may end too early
        again = _active_set(functions, moments)
        off = float(np.linalg.norm(functions @ again - moments))
        if off < rest:
            return again, off
    return found, rest


def _active_set(functions: Array, moments: Array) -> Array:
    """The same by Lawson and Hanson's method (1974), until nothing is left of the moments."""
    n = functions.shape[1]
    found, free = np.zeros(n), np.zeros(n, dtype=bool)
    for _ in range(3 * n):
        rest = moments - functions @ found
        gain = np.where(free, -np.inf, functions.T @ rest)
        enough = np.linalg.norm(rest) <= 0.01 * MOMENT_ERROR * np.linalg.norm(moments)
        if enough or gain.max() <= 0 or free.sum() == len(moments):
            break
        free[gain.argmax()] = True
        while free.any():
            tried = np.zeros(n)
            tried[free] = np.linalg.lstsq(functions[:, free], moments, rcond=None)[0]
            below = free & (tried <= 0)
            if not below.any():
                found = tried
                break
            share = (found[below] / (found[below] - tried[below])).min()
            found = np.where(free, found + share * (tried - found), 0.0)
            free &= found > 1e-15 * found.max(initial=0.0)
    return found
