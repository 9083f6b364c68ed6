"""Rigid motions of the parts of the body, and those that the supports leave free."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from tawami.base.arrays import Array, Mask
from tawami.base.errors import SupportError
from tawami.base.space import Space
from tawami.field.constraints import PointHeld
from tawami.field.layout import Layout

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

    Args:
        layout: Places of the coefficients.
        part: Whether each displacement coefficient belongs to the part.

    Returns:
        Coefficients of the translations and rotations (coefficients x motions), the centre of the part
        [m], and the length that divides the rotations [m].
    """
    dim = layout.grid.space.dim
    mine = layout.greville[part[::dim]]
    centre = mine.mean(axis=0)
    length = float(np.ptp(mine, axis=0).max())
    modes = rigid_motions(layout.greville - centre, layout.grid.space)
    modes[:, dim:] /= length
    return modes, centre, length


def check_rigid_motions(layout: Layout, fixed: Mask, points: Sequence[PointHeld]) -> None:
    """Check that supports prevent the rigid motions of each separate part of the body.

    Args:
        layout: Places of the coefficients.
        fixed: Whether each coefficient is prescribed.
        points: Multi-point constraints.

    Raises:
        SupportError: A motion is free; the message names it.
    """
    axes = layout.grid.space.axes
    for number in range(layout.num_parts):
        mine = layout.part == number
        modes, centre, length = rigid_modes(layout, mine)
        held = modes[mine & fixed[: layout.num_displacement]]
        rows = [p.weights @ modes[p.indices] for p in points if mine[p.indices].any()]
        matrix = np.vstack([held.T @ held, *rows, np.zeros((modes.shape[1],) * 2)])
        _, singular, vectors = np.linalg.svd(matrix)
        free = vectors[singular < FREE * max(singular[0], 1e-300)]
        if not len(free):
            continue
        hoop = layout.grid.space.hoop
        names = [f"translation in {axes[-1]}"] if hoop else _names(free, centre, length)
        what = "the body"
        if layout.num_parts > 1:
            what = (
                f"the part of the body around ({centre[0]:.3g}, {centre[1]:.3g}), which shares no "
                f"function with the others ({layout.num_parts} parts),"
            )
        raise SupportError(
            f"the supports leave {what} free to move: {', '.join(names)}. "
            "A static scene needs supports that prevent it: add scene.fix(...) or scene.hold(...)"
        )


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
