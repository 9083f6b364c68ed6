"""Walls that act at a distance from a body without a border.

Such a wall holds functions of the grid. It stops the body as soon as these reach its particles, and not
where the gap between them and the edge closes.
"""

from __future__ import annotations

from collections.abc import Iterable

from tawami.base.errors import SupportWarning
from tawami.base.warn import warn
from tawami.conditions.walls import FORCE, Wall
from tawami.domain.domain import Domain
from tawami.domain.points import reach
from tawami.step.step import Accepted


def warn_of_new(wall: Wall, domain: Domain) -> None:
    """Warn of a wall that is made at a distance from the particles; a call for all ranks.

    Args:
        wall: The wall.
        domain: The particles.

    Warns:
        SupportWarning: Its functions reach them.
    """
    gap = reach(domain, wall.edge)
    if 0 < gap < wall.grid.h:
        _warn(wall, gap, "the wall acts already")


def warn_of_distant(walls: Iterable[Wall], domain: Domain, accepted: Accepted) -> None:
    """Warn, once for each wall, of one that pushed the particles in a step at a distance from them.

    A call for all ranks.

    Args:
        walls: The walls.
        domain: The particles at the end of the step.
        accepted: The step.

    Warns:
        SupportWarning: A wall did.
    """
    layout, forces = accepted.problem.reduction.layout, accepted.forces
    for wall in walls:
        if wall.told or wall.obstacle is not None:
            continue
        across, _, inward = wall.axes
        on_wall = layout.vectors_at(forces, wall.functions[wall.state.touching])
        push = inward * on_wall[:, across]
        if push.max(initial=0.0) <= FORCE * layout.largest(forces):
            continue
        gap = reach(domain, wall.edge)
        if gap > 0:
            _warn(wall, gap, "the wall pushed them in a step")


def _warn(wall: Wall, gap: float, what: str) -> None:
    wall.told = True
    warn(
        f"wall(edge='{wall.edge}'): the particles of a body without a border end {gap:.3g} m = "
        f"{gap / wall.grid.h:.3g} h away from this edge of the grid, and {what}: it holds functions of "
        "the grid, and does not wait until the gap closes. Expected particles that reach the edge, or "
        "Body(x, volume, border=tawami.polyline(corners)), for which the wall waits",
        SupportWarning,
    )
