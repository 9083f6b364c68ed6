"""The ground of the cases on foundations."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import tawami


def ground(
    h: float,
    sides: tuple[float, float],
    depth: float,
    law: Any,
    *,
    room: float = 0.0,
    per_axis: int = 2,
    **options: Any,
) -> tawami.Scene:
    """Weightless ground with a level surface at y = 0; left and right edge smooth, bottom held.

    Args:
        h: Size of the cells [m].
        sides: Left and right end [m].
        depth: Of the ground [m].
        law: Material.
        room: Height of the grid above the ground [m].
        per_axis: Particles per cell and axis.
        options: Of the scene.
    """
    left, right = sides
    cells = (round((right - left) / h), round((depth + room) / h))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(left, -depth), h=h, cells=cells)
    body = tawami.box(grid, (left, -depth), (right, 0.0), per_axis=per_axis)
    scene = tawami.Scene(grid, body, law, tolerance=1e-5, **options)
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    return scene
