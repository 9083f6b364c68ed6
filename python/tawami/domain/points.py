"""Points at which a driver script holds or asks for something, and whether the body reaches them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami.base import ranks
from tawami.base.errors import InputError
from tawami.domain.domain import Domain
from tawami.grid import edges
from tawami.grid.grid import Edge

#: Share of a cell, or of a value, that is round-off.
ROUND_OFF = 1e-9


def outside(what: str, distance: float) -> InputError:
    """The error for a point that is not in the body.

    Args:
        what: The point, for the message.
        distance: To the nearest particle [m].
    """
    return InputError(
        f"{what}: no body there; the nearest particle is {distance:.3g} m away: expected a point of the "
        "body"
    )


def _distance(domain: Domain, point: Sequence[float]) -> float:
    """Distance of a point from the nearest particle [m]; a call for all ranks."""
    mine = np.linalg.norm(domain.particles.x - np.asarray(point), axis=1)
    return -ranks.largest(domain.model.grid.comm, -float(mine.min(initial=np.inf)))


def is_in_body(domain: Domain, point: Sequence[float]) -> bool:
    """Whether a point is within half a diagonal of a cell of a particle; a call for all ranks."""
    grid = domain.model.grid
    return bool(_distance(domain, point) <= (0.5 + ROUND_OFF) * np.sqrt(grid.space.dim) * grid.h)


def check_in_body(domain: Domain, point: Sequence[float], what: str) -> None:
    """Check that a point is in the body: within half a diagonal of a cell of a particle.

    A call for all ranks.

    Raises:
        InputError: It is not, or is outside the grid.
    """
    edges.locate_point(domain.model.grid, point, what)
    if not is_in_body(domain, point):
        raise outside(what, _distance(domain, point))


def reach(domain: Domain, edge: Edge) -> float:
    """Distance of a body of loose particles from an edge of the grid [m]; a call for all ranks.

    A particle is a square of its area. It is 0 if the nearest one reaches the edge to a quarter of its
    size.
    """
    grid, particles = domain.model.grid, domain.particles
    away = grid.inwards(edge, particles.x) - 0.75 * np.sqrt(domain.areas)
    nearest = -ranks.largest(grid.comm, -float(away.min(initial=np.inf)))
    return max(nearest, 0.0)
