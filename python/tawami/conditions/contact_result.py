"""Contact with an obstacle at the end of a step, for a driver script."""

from __future__ import annotations

from dataclasses import dataclass

from tawami.base.arrays import Array


@dataclass(frozen=True)
class ContactResult:
    """Contact with one obstacle at the end of a step.

    Attributes:
        name: Name of the obstacle.
        force: Force on the obstacle [N per metre depth].
        moment: Moment on it about its centre [N m per metre depth], one for each rotation.
        centre: Its centre [m].
        x: Points of the border, points x dim [m], where contact was evaluated.
        pressure: Pressure at these points [Pa], 0 where they are apart.
        friction: Friction on the body at these points [Pa], along the normal of the obstacle turned by
            a right angle counter-clockwise, points x (dim - 1).
        penetration: Largest mean penetration of a patch [m].
    """

    name: str
    force: Array
    moment: Array
    centre: Array
    x: Array
    pressure: Array
    friction: Array
    penetration: float
