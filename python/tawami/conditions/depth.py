"""Obstacles that go through the border between its patches, as one that is smaller than a cell may."""

from __future__ import annotations

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import SupportWarning
from tawami.base.warn import warn
from tawami.border.shapes import Function, Shape
from tawami.border.thin import thinnest
from tawami.conditions.obstacle import Obstacle
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints
from tawami.grid.grid import Grid

#: Depth in an obstacle that a particle may have [cells].
DEEP = 0.3
#: Difference of distances from points of the border that is round-off [cells].
SAME = 1e-6


def warn_of_small(what: str, shape: Shape, grid: Grid) -> None:
    """Warn of an obstacle that is narrower somewhere than a cell.

    Of a distance function only parts that are so narrow that no particle can be deep inside them, and
    longer than wide, are found.

    Args:
        what: The obstacle, for messages.
        shape: Its shape.
        grid: The grid.

    Warns:
        SupportWarning: It is.
    """
    h, width = grid.h, shape.width
    if isinstance(shape, Function):
        width = thinnest(shape.values, grid.origin, grid.upper, 2 * DEEP * h)
    if width < h * (1 - 1e-9):
        warn(
            f"{what}: its shape is {width:.3g} m wide at its narrowest place, less than a cell: "
            "it may enter the body between patches of the border, which are about as long as a cell. "
            f"Expected {h:.3g} m at least: a finer grid, or a larger radius",
            SupportWarning,
        )


def warn_of_deep(obstacle: Obstacle, domain: Domain, border: MovingPoints, u: Array | None) -> bool:
    """Warn if a particle is deep inside an obstacle after a step; a call for all ranks.

    Args:
        obstacle: The obstacle.
        domain: The particles. Those that are nearer to a part of the border that may not touch the
            obstacle are left out.
        border: All points of the border.
        u: Displacement since the start where particles do not move, functions x dim.

    Returns:
        Whether one is.

    Warns:
        SupportWarning: One is deeper than 0.3 h.
    """
    at, grid = np.array(domain.particles.x), domain.model.grid
    x = at if u is None else at + domain.at_particles(u)
    distance = obstacle.shape.evaluate(obstacle.pose.to_local(x)).distance
    deep = distance < -DEEP * grid.h
    if deep.any() and len(obstacle.place) < len(border):
        from scipy.spatial import KDTree  # takes long to import

        nearest, own = (KDTree(p.x).query(at[deep])[0] for p in (border, obstacle.place))
        deep[deep] = own <= nearest + SAME * grid.h
    depth = ranks.largest(grid.comm, float(-np.min(distance[deep], initial=0.0)))
    if depth <= DEEP * grid.h:
        return False
    warn(
        f"{obstacle}: a particle of the body is {depth:.3g} m inside it after a step: contact acts on "
        "means over patches of the border, about as long as a cell, and an obstacle or a corner that is "
        f"not much larger enters between them. Expected at most 0.3 h = {DEEP * grid.h:.3g} m: a finer "
        "grid, a rounder obstacle, or where=... with all of the border that it may touch",
        SupportWarning,
    )
    return True
