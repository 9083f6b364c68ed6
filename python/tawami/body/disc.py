"""Discs and rings filled with particles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.checks import LEAST, number, point
from tawami.base.errors import InputError
from tawami.body import clipping
from tawami.body.body import Body
from tawami.body.dealing import dealt
from tawami.body.filling import PER_AXIS, Filling
from tawami.body.points import ROUND_OFF, Points, halves, in_triangles, joined
from tawami.border.pieces import Border
from tawami.grid.grid import Grid

#: Least number of chords around a circle.
CHORDS = 32
#: Gauss points along an arc, and between an arc and its chord: moments are exact to round-off.
ALONG, ACROSS = 8, 4
#: Directions of the ends of quarters of a circle, counter-clockwise.
COMPASS = ((1, 0), (0, 1), (-1, 0), (0, -1))
#: Two ends of arcs that are nearer than this [rad] are the same.
ONE_ANGLE = 1e-11


def disc(
    grid: Grid,
    centre: Sequence[float],
    radius: float,
    *,
    inner: float = 0.0,
    per_axis: int = PER_AXIS,
    gauss: bool = False,
) -> Body:
    """A disc, or a ring, filled with particles; a sphere, or a spherical shell, where its centre is on
    the axis of an axisymmetric grid. A call for all ranks.

    A full cell gets `per_axis` x `per_axis` particles. A cut cell gets at most 28, which integrate
    exactly over its part of the disc up to degree 6. Area and first moments are those of the circle to
    1e-12. Second moments are too if `gauss` is set and `per_axis` is at least 2. With evenly spaced
    particles they are too small by h^2 / (12 per_axis^2) times the area of the full cells.

    Its border is 'outer', and 'inner' for a ring.

    Args:
        grid: The grid.
        centre: Position (x, y) [m].
        radius: Radius [m].
        inner: Radius of the hole of a ring [m].
        per_axis: Particles per full cell and axis.
        gauss: Place the particles of full cells at the Gauss points with the Gauss weights.

    Raises:
        InputError: A radius is out of its range, or the circle leaves the grid.
    """
    import shapely

    filling = Filling("disc", grid, per_axis, gauss)
    x, y = point("centre", centre)
    radius = number("radius", radius, low=LEAST)
    inner = number("inner", inner, low=0.0)
    if inner >= radius:
        raise InputError(f"disc: inner = {inner:g} m: expected less than the radius, {radius:g} m")
    middle, r = grid.in_cells(np.array([x, y])), radius / grid.h
    ends = np.array([middle - r, middle + r])
    margin = clipping.tolerance(ends)
    if grid.on_axis and x == 0:
        ends[:, 0] = np.maximum(ends[:, 0], 0.0)  # the half on the right of the axis
    if (ends < -margin).any() or (ends > np.add(grid.cells, margin)).any():
        raise InputError(
            f"disc: the circle around ({x:g}, {y:g}) m with a radius of {radius:g} m leaves the grid, "
            f"{grid.extent}; enlarge the grid or move the disc"
        )
    hole = inner / grid.h if inner > ROUND_OFF * radius else 0.0
    # The chords of the outer circle must not cross the inner one.
    chords = max(CHORDS, int(np.ceil(2 * np.pi / np.sqrt(1 - hole / r))))
    border, caps = _circle(grid, middle, r, chords)
    caps = caps[dealt(grid, caps.cell)]
    arcs = _border(grid, middle, {"outer": r, "inner": hole})
    if hole == 0.0:
        full, triangles, cell = clipping.clipped(grid, shapely.Polygon(border))
        return filling.body(full, joined([in_triangles(triangles, cell), caps]), border=arcs)
    inner_border, removed = _circle(grid, middle, hole, chords)
    removed = removed[dealt(grid, removed.cell)]
    clipped = clipping.clipped(grid, shapely.Polygon(border, [inner_border]))
    full, triangles, cell = _refined(grid, *clipped, removed.cell)
    removed = Points(removed.x, -removed.weight, removed.cell, removed.material)

    def outside_hole(x: Array) -> Mask:
        return np.asarray(np.hypot(*(x - middle).T) >= hole)

    cut = joined([in_triangles(triangles, cell), caps, removed])
    return filling.body(full, cut, border=arcs, allowed=outside_hole)


def _border(grid: Grid, middle: Array, radii: dict[str, float]) -> Border:
    """Quarters of circles by name, right of the axis of axisymmetry if that is in the middle.

    The first circle has the body inside, the others are holes; those with a radius of 0 are left out.
    """
    half = grid.on_axis and middle[0] == 0
    corner = np.array([(0, -1), (1, 0), (0, 1)] if half else [*COMPASS, COMPASS[0]])
    start, end, curvature, tag = [], [], [], []
    names = [name for name, radius in radii.items() if radius > 0]
    for k, name in enumerate(names):
        x = grid.in_metres(middle + radii[name] * (corner if k == 0 else corner[::-1]))
        start.append(x[:-1])
        end.append(x[1:])
        curvature.append(np.full(len(x) - 1, (1 if k == 0 else -1) / (radii[name] * grid.h)))
        tag.append(np.full(len(x) - 1, k))
    first, last, bent = (np.concatenate(part) for part in (start, end, curvature))
    return Border(first, last, bent, np.concatenate(tag), tuple(names))


def _circle(grid: Grid, middle: Array, r: float, chords: int) -> tuple[Array, Points]:
    """A circle as a polygon, and points that integrate over the caps between its chords and arcs.

    The corners of the polygon include all points where the circle meets lines of the grid, so that
    every arc lies in one cell.
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
    return corners, _caps(grid, middle, r, np.append(ends, ends[0] + 2 * np.pi))


def _caps(grid: Grid, middle: Array, r: float, ends: Array) -> Points:
    """Points that integrate over the caps of a circle right of x = 0; `ends` are the angles of the ends
    of the arcs.
    """
    (t, wt), (s, ws) = _rust.gauss(ALONG), _rust.gauss(ACROSS)
    span = np.diff(ends)
    right = middle[0] + r * np.cos(ends[:-1] + span / 2) > 0
    large = np.flatnonzero(
        right & (span**3 > ROUND_OFF * 1e-2)
    )  # smaller caps are round-off of r^2
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
    index = grid.cell_at(x.mean(axis=1))
    x = np.asarray(np.clip(x, index[:, None], index[:, None] + 1.0), dtype=float)
    cell = np.repeat(grid.cell_numbers(index), ALONG * ACROSS)
    return Points(x.reshape(-1, 2), weight.ravel(), cell, np.zeros_like(cell))


def _refined(
    grid: Grid, full: Indices, triangles: Array, cell: Indices, hole: Indices
) -> tuple[Indices, Array, Indices]:
    """Full cells, and triangles with their cells, refined in the cells along a hole.

    The hole extends beyond its chords into these cells: they are not full, and their triangles are
    divided into 16, because many points of a large triangle would be in the hole.

    Args:
        grid: The grid.
        full: Numbers of the full cells.
        triangles: Parts of cut cells, n x 3 x 2.
        cell: Number of the cell of each triangle.
        hole: Numbers of the cells along the hole.
    """
    cut = np.isin(full, hole)
    triangles = np.concatenate([triangles, halves(grid.cell_indices(full[cut])).reshape(-1, 3, 2)])
    cell = np.concatenate([cell, np.repeat(full[cut], 2)])
    along = np.isin(cell, hole)
    parts, of_part = triangles[along], cell[along]
    for _ in range(2):
        a, b, c = parts.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        parts = np.concatenate([np.stack(corners, axis=1) for corners in four])
        of_part = np.tile(of_part, 4)
    return (
        full[~cut],
        np.concatenate([triangles[~along], parts]),
        np.concatenate([cell[~along], of_part]),
    )
