"""The outcome of a step: positions at its end, and all that a solution shows of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from tawami.base.arrays import Array, Mask
from tawami.step.reactions import Reactions
from tawami.step.step import Accepted


@dataclass(frozen=True)
class Outcome:
    """A step that was stored.

    Attributes:
        accepted: The step.
        coefficients: Of all fields: since the start where particles do not move, of the step where
            they do.
        reactions: Forces of supports and walls.
        particles: Arrays of this rank's particles at the end of the step.
    """

    accepted: Accepted
    coefficients: Array
    reactions: Reactions
    particles: Mapping[str, Array]


class Moved(NamedTuple):
    """Positions at the end of a step.

    Attributes:
        particles: Of this rank's particles [m], particles x dim.
        gone: Mask of those that leave the grid.
        border: Of the points of the border, with their areas.
    """

    particles: Array
    gone: Mask
    border: list[tuple[Array, Array]]
