"""Discs and rings filled with particles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base.checks import LEAST, number, point
from tawami.base.errors import InputError
from tawami.body import cut_cells
from tawami.body.body import Body
from tawami.body.cut_cells import ON_LINE, ROUND_OFF, Numbers, Points
from tawami.grid.grid import Grid

Array = npt.NDArray[np.float64]
#: Chords around a circle, at least; and Gauss points along an arc and between arc and chord, with
#: which moments of the caps are exact to round-off.
CHORDS, ALONG, ACROSS = 32, 8, 4
#: Two ends of arcs nearer than this [rad] are one.
ONE_ANGLE = 1e-11


def disc(
    grid: Grid,
    centre: Sequence[float],
    radius: float,
    *,
    inner: float = 0.0,
    per_axis: int = 2,
    gauss: bool = False,
) -> Body:
    """A disc, or a ring, filled with particles.

    A full cell gets `per_axis` x `per_axis` particles, a cut one at most 28 that integrate over what
    the arcs leave of it, up to degree 6. Area and first moments are those of the circle, not of a
    polygon in it, to 1e-12; second moments too with `gauss` (and two or more per axis), without it they
    are too small by h^2 / (12 per_axis^2) times the area of the full cells.

    Args:
        grid: The grid.
        centre: (x, y) [m].
        radius: [m].
        inner: Radius of the hole of a ring [m].
        per_axis: Particles per full cell and axis.
        gauss: Put those at the Gauss points, with the Gauss weights, instead of evenly.

    Raises:
        InputError: A radius out of its range, or a circle that leaves the grid.
    """
    import shapely

    cut_cells.check("disc", grid, per_axis, gauss)
    x, y = point("centre", centre)
    radius = number("radius", radius, low=LEAST)
    inner = number("inner", inner, low=0.0)
    if inner >= radius:
        raise InputError(f"disc: inner = {inner:g} m: expected less than the radius, {radius:g} m")
    middle, r = (np.array([x, y]) - grid.origin) / grid.h, radius / grid.h
    if (middle - r < -ON_LINE).any() or (middle + r > np.add(grid.cells, ON_LINE)).any():
        raise InputError(
            f"disc: the circle around ({x:g}, {y:g}) m with a radius of {radius:g} m leaves the grid, "
            f"{grid.extent}; enlarge the grid or move the disc"
        )
    # a hole that is round-off is none
    hole = inner / grid.h if inner > ROUND_OFF * radius else 0.0
    # the chords of the outer circle stay clear of the inner one
    chords = max(CHORDS, int(np.ceil(2 * np.pi / np.sqrt(1 - hole / r))))
    outer, ends = _ring(grid, middle, r, chords)
    caps = _caps(grid, middle, r, ends)
    shape, holes = shapely.Polygon(outer), None
    if hole > 0:
        around, ends = _ring(grid, middle, hole, chords)
        shape = shapely.Polygon(outer, [around])
        holes = _caps(grid, middle, hole, ends)
    full, triangles, cell = cut_cells.clipped(shape)
    if holes is None:
        cut = cut_cells.in_triangles(triangles, cell) + caps
        return Body(*cut_cells.to_body(grid, full, cut, per_axis, gauss))
    full, triangles, cell = _touched(full, triangles, cell, holes)
    taken = Points(holes.x, -holes.weight, holes.cell)
    cut = cut_cells.in_triangles(triangles, cell) + caps + taken

    def outside(x: Array) -> npt.NDArray[np.bool_]:
        return np.asarray(np.hypot(*(x - middle).T) >= hole)

    return Body(*cut_cells.to_body(grid, full, cut, per_axis, gauss, outside))


def _ring(grid: Grid, middle: Array, r: float, chords: int) -> tuple[Array, Array]:
    """Points on a circle and their angles, ascending and closed: where it meets lines of the grid, so
    that every arc lies in one cell, and others.
    """
    angles = [2 * np.pi / chords * np.arange(chords)]
    for axis in range(2):
        lines = np.arange(np.ceil(middle[axis] - r), np.floor(middle[axis] + r) + 1)
        turn = np.arccos(np.clip((lines - middle[axis]) / r, -1, 1))
        angles.append(np.concatenate([turn, -turn]) + axis * np.pi / 2)
    sorted_angles = np.sort(np.concatenate(angles) % (2 * np.pi))
    ends = sorted_angles[np.diff(sorted_angles, append=np.inf) > ONE_ANGLE]
    x = middle + r * np.column_stack([np.cos(ends), np.sin(ends)])
    near = np.abs(x - np.rint(x)) < ONE_ANGLE * max(r, 1.0)
    corners: Array = np.clip(np.where(near, np.rint(x), x), 0, grid.cells)
    return corners, np.append(ends, ends[0] + 2 * np.pi)


def _caps(grid: Grid, middle: Array, r: float, ends: Array) -> Points:
    """Points that integrate over what is between the chords of a circle and its arcs."""
    (t, wt), (s, ws) = _rust.gauss(ALONG), _rust.gauss(ACROSS)
    span = np.diff(ends)
    # thinner ones are round-off of r^2
    large = np.flatnonzero(span**3 > ROUND_OFF * 1e-2)
    begin, span = ends[large, None], span[large, None]

    def at(angle: Array) -> Array:
        return np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    arc, tangent = r * at(begin + span * t), r * span[..., None] * at(begin + span * t + np.pi / 2)
    first, last = r * at(begin), r * at(begin + span)
    chord, along = first + t[:, None] * (last - first), last - first
    height: Array = arc - chord
    x: Array = np.asarray(chord[:, :, None] + s[:, None] * height[:, :, None], dtype=float)
    slope = along[:, :, None] + s[:, None] * (tangent - along)[:, :, None]
    area = slope[..., 1] * height[:, :, None, 0] - slope[..., 0] * height[:, :, None, 1]
    weight = area * wt[:, None] * ws
    x = (middle + x).reshape(len(span), ALONG * ACROSS, 2)
    cell = np.clip(np.floor(x.mean(axis=1)), 0, np.subtract(grid.cells, 1)).astype(np.int64)
    x = np.asarray(np.clip(x, cell[:, None], cell[:, None] + 1.0), dtype=float)
    return Points(x.reshape(-1, 2), weight.ravel(), np.repeat(cell, ALONG * ACROSS, axis=0))


def _touched(
    full: Numbers, triangles: Array, cell: Numbers, holes: Points
) -> tuple[Numbers, Array, Numbers]:
    """Full cells, and triangles with their cells, where the hole bulges beyond its chords: such a cell
    is not full, and its triangles are divided, for many of their points may be in the hole.
    """
    bulging = {tuple(c) for c in np.unique(holes.cell, axis=0)}
    cut = np.array([tuple(c) in bulging for c in full], dtype=bool)
    square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    halves = (full[cut][:, None, None] + square).reshape(-1, 3, 2)
    triangles = np.concatenate([triangles, halves])
    cell = np.concatenate([cell, np.repeat(full[cut], 2, axis=0)])
    fine = np.array([tuple(c) in bulging for c in cell], dtype=bool)
    parts, of_part = triangles[fine], cell[fine]
    for _ in range(2):
        a, b, c = parts.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        parts = np.concatenate([np.stack(corners, axis=1) for corners in four])
        of_part = np.tile(of_part, (4, 1))
    return (
        full[~cut],
        np.concatenate([triangles[~fine], parts]),
        np.concatenate([cell[~fine], of_part]),
    )
