"""Rigid motions of the parts of the body, and those that the supports leave free."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami.base.arrays import Array, Mask
from tawami.base.errors import SupportError
from tawami.field.constraints import PointHeld
from tawami.field.layout import Layout

#: Singular values, relative to the largest, and components of motions that count as zero.
FREE, ZERO = 1e-10, 1e-8


def rigid_modes(layout: Layout, part: Mask) -> tuple[Array, Array, float]:
    """Rigid motions of a part of the body.

    Args:
        layout: Places of the coefficients.
        part: Whether each displacement coefficient belongs to the part.

    Returns:
        Coefficients of the translations in x and y and of the rotation (coefficients x 3), the centre
        of the part [m], and the length that divides the rotation [m].
    """
    points = layout.greville
    mine = points[part[::2]]
    centre = mine.mean(axis=0)
    length = float(np.ptp(mine, axis=0).max())
    modes = np.zeros((layout.num_displacement, 3))
    modes[0::2, 0] = modes[1::2, 1] = 1.0
    modes[0::2, 2] = -(points[:, 1] - centre[1]) / length
    modes[1::2, 2] = (points[:, 0] - centre[0]) / length
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
    for number in range(layout.num_parts):
        mine = layout.part == number
        modes, centre, length = rigid_modes(layout, mine)
        held = modes[mine & fixed[: layout.num_displacement]]
        rows = [p.weights @ modes[p.indices] for p in points if mine[p.indices].any()]
        matrix = np.vstack([held.T @ held, *rows, np.zeros((3, 3))])
        _, singular, vectors = np.linalg.svd(matrix)
        free = vectors[singular < FREE * max(singular[0], 1e-300)]
        if not len(free):
            continue
        what = "the body"
        if layout.num_parts > 1:
            what = (
                f"the part of the body around ({centre[0]:.3g}, {centre[1]:.3g}), which shares no "
                f"function with the others ({layout.num_parts} parts),"
            )
        raise SupportError(
            f"the supports leave {what} free to move: {', '.join(_names(free, centre, length))}. "
            "A static scene needs supports that prevent it: add scene.fix(...) or scene.hold(...)"
        )


def _names(free: Array, centre: Array, length: float) -> list[str]:
    """Names of the rigid motions spanned by the rows (translation x, y, rotation)."""
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
