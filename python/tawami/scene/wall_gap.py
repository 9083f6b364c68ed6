"""Walls that act on a body at a distance from its border.

A wall holds functions of the grid. It stops a body as soon as these reach its particles, and not where
the gap between the border and the edge closes.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tawami.base.arrays import Array
from tawami.base.errors import SupportWarning
from tawami.base.warn import warn
from tawami.grid.grid import ON_LINE
from tawami.scene.moving_points import MovingPoints
from tawami.scene.step import Accepted
from tawami.scene.walls import FORCE, Wall

#: Distances [cells]: at which the functions of a wall end, and below which a border that moves is on
#: the edge of the grid.
REACH, CLOSED = 1 - 1e-9, 1e-3


def warn_of_new(wall: Wall, border: MovingPoints | None, *, moves: bool) -> None:
    """Warn of a wall that is made at a distance from the border of the body.

    Args:
        wall: The wall.
        border: The border, None for a body without one.
        moves: Whether particles move; the body may reach the wall later then.

    Warns:
        SupportWarning: It is.
    """
    if border is None or not len(border):
        return
    gap = border.gap(wall.edge)
    acts = gap < REACH * wall.grid.h
    if gap > ON_LINE * wall.grid.h and (acts or not moves):
        _warn(wall, gap, "the wall acts already" if acts else "the wall never acts")


def warn_of_distant(walls: Iterable[Wall], border: MovingPoints | None, accepted: Accepted) -> None:
    """Warn, once for each wall, of one that pushed the body in a step at a distance from its border.

    A call for all ranks.

    Args:
        walls: The walls.
        border: The border at the end of the step, None for a body without one.
        accepted: The step.

    Warns:
        SupportWarning: A wall did.
    """
    if border is None or not len(border):
        return
    layout, forces = accepted.problem.reduction.layout, accepted.forces
    for wall in walls:
        if wall.told:
            continue
        across, _, inward = wall.axes
        on_wall = layout.vectors_at(forces, wall.functions[wall.state.touching])
        push = inward * on_wall[:, across]
        if push.max(initial=0.0) <= FORCE * layout.largest(forces):
            continue
        gap = border.gap(wall.edge)
        if gap > CLOSED * wall.grid.h:
            _warn(wall, gap, "the wall pushed it in a step")


def _warn(wall: Wall, gap: float, what: str) -> None:
    wall.told, grid = True, wall.grid
    across, _, inward = wall.axes
    normal = np.zeros(grid.space.dim)
    normal[across] = inward
    edge = np.array(grid.origin if inward > 0 else grid.upper, dtype=float)
    friction = f"{wall.friction:g}" if np.isfinite(wall.friction) else "float('inf')"
    warn(
        f"wall(edge='{wall.edge}'): the border of the body is {gap:.3g} m = {gap / grid.h:.3g} h away "
        f"from this edge of the grid, and {what}: it holds functions of the grid, and does not wait "
        "until the gap closes. Expected a border that lies on the edge, or in place of the wall "
        f"scene.obstacle(tawami.half_plane({_text(edge)}, {_text(normal)}), {friction}) and a grid with "
        "another row of cells beyond it; in statics, where nothing else holds the body until the gap "
        f"closes, an obstacle that begins at the border, with the point {_text(edge + gap * normal)}",
        SupportWarning,
    )


def _text(values: Array) -> str:
    return f"({', '.join(f'{float(value):.12g}' for value in values)})"
