"""Rigid motions of the parts of the body, and those that the supports leave free."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import SupportError
from tawami.base.space import Space
from tawami.field.constraints import PointHeld
from tawami.field.layout import Layout
from tawami.grid.basis import greville_1d

#: Singular values, relative to the largest, and components of motions that count as zero.
FREE, ZERO = 1e-10, 1e-8


def rigid_motions(points: Array, space: Space) -> Array:
    """Displacements at points (points x dim) of translations and of rotations about the origin.

    In axisymmetry only the translation along the axis of rotation is rigid.

    Returns:
        Components x motions, where the components are those of one point after the other.
    """
    dim = points.shape[1]
    if space.hoop:
        along = np.zeros_like(points)
        along[:, -1] = 1.0
        return along.reshape(-1, 1)
    planes = list(combinations(range(dim), 2))
    motions = np.zeros((*points.shape, dim + len(planes)))
    for axis in range(dim):
        motions[:, axis, axis] = 1.0
    for number, (i, j) in enumerate(planes, start=dim):
        motions[:, i, number], motions[:, j, number] = -points[:, j], points[:, i]
    return motions.reshape(points.size, -1)


def rigid_modes(layout: Layout, part: Mask) -> tuple[Array, Array, float]:
    """Rigid motions of a part of the body.

    A collective call.

    Args:
        layout: Places of the coefficients.
        part: Whether each displacement coefficient belongs to the part.

    Returns:
        Coefficients of the translations and rotations (coefficients x motions), the centre of the part
        [m], and the length that divides the rotations [m].
    """
    dim, comm = layout.grid.space.dim, layout.grid.comm
    mine = layout.greville[(part & layout.own[: len(part)])[::dim]]
    sums = ranks.sum_of(comm, np.array([*mine.sum(axis=0), len(mine)]))
    centre = sums[:dim] / sums[dim]
    ends = np.concatenate([mine.min(axis=0, initial=np.inf), -mine.max(axis=0, initial=-np.inf)])
    low, high = np.split(ranks.least_of(comm, ends), 2)
    length = float((-high - low).max())
    return motions_about(layout.greville, centre, length, layout.grid.space), centre, length


def motions_about(points: Array, centre: Array, length: float, space: Space) -> Array:
    """Rigid motions at points; rotations are about a centre and divided by a length [m]."""
    modes = rigid_motions(points - centre, space)
    modes[:, points.shape[1] :] /= length
    return modes


def check_rigid_motions(layout: Layout, fixed: Mask, points: Sequence[PointHeld]) -> None:
    """Check that supports prevent the rigid motions of each separate part of the body.

    A collective call.

    Args:
        layout: Places of the coefficients.
        fixed: Whether each coefficient is prescribed.
        points: Multi-point constraints, the same on every rank.

    Raises:
        SupportError: A motion is free; the message names it.
    """
    axes, n, comm = layout.grid.space.axes, layout.num_displacement, layout.grid.comm
    num_parts, part = layout.parts
    of_points = [layout.at(part + 1.0, p.indices) - 1 for p in points]
    for number in range(num_parts):
        mine = part == number
        modes, centre, length = rigid_modes(layout, mine)
        held = modes[mine & fixed[:n] & layout.own[:n]]
        about = centre, length, layout.grid.space
        rows = [
            p.weights @ _at_coefficients(layout, p.indices, *about)
            for p, its_part in zip(points, of_points, strict=True)
            if (its_part == number).any()
        ]
        square = ranks.sum_of(comm, np.ascontiguousarray(held.T @ held))
        matrix = np.vstack([square, *rows, np.zeros((modes.shape[1],) * 2)])
        _, singular, vectors = np.linalg.svd(matrix)
        free = vectors[singular < FREE * max(singular[0], 1e-300)]
        if not len(free):
            continue
        hoop = layout.grid.space.hoop
        names = [f"translation in {axes[-1]}"] if hoop else _names(free, centre, length)
        what = "the body"
        if num_parts > 1:
            what = (
                f"the part of the body around ({centre[0]:.3g}, {centre[1]:.3g}), which shares no "
                f"function with the others ({num_parts} parts),"
            )
        raise SupportError(
            f"the supports leave {what} free to move: {', '.join(names)}. "
            "A static scene needs supports that prevent it: add scene.fix(...) or scene.hold(...)"
        )


def _at_coefficients(
    layout: Layout, in_grid: Indices, centre: Array, length: float, space: Space
) -> Array:
    """Rigid motions at some displacement coefficients of the whole grid, coefficients x motions."""
    dim, grid = space.dim, layout.grid
    function, component = np.divmod(in_grid, dim)
    along = [greville_1d(layout.basis, n) for n in grid.cells]
    index = np.unravel_index(function, [len(points) for points in along], order="F")
    points = np.stack([of[i] for of, i in zip(along, index, strict=True)], axis=-1)
    motions = motions_about(grid.in_metres(points), centre, length, space)
    return np.asarray(motions.reshape(len(in_grid), dim, -1)[np.arange(len(in_grid)), component])


def _names(free: Array, centre: Array, length: float) -> list[str]:
    """Names of the rigid motions of the plane spanned by the rows (translation x, y, rotation)."""
    names, rest = [], free
    for axis, name in enumerate("xy"):
        unit = np.eye(3)[axis]
        if np.linalg.norm(free @ unit) > 1 - ZERO:
            names.append(f"translation in {name}")
            rest = rest - np.outer(rest @ unit, unit)
    _, singular, vectors = np.linalg.svd(rest)
    for motion in vectors[: len(singular)][singular > ZERO]:
        if abs(motion[2]) < ZERO:
            names.append(f"translation along ({motion[0]:.3g}, {motion[1]:.3g})")
        else:
            # u = a + w (-(y - yc), x - xc) / L vanishes at this point
            x, y = centre + length * np.array([-motion[1], motion[0]]) / motion[2]
            names.append(f"rotation about ({x:.3g}, {y:.3g})")
    return names
