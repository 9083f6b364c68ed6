"""What observers of a run get to see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tawami.dynamics import Dynamics
    from tawami.scene import Scene
    from tawami.solution import Solution


@dataclass(frozen=True)
class Moment:
    """The start of a phase of a run, or the end of one of its accepted steps.

    Attributes:
        scene: The scene.
        motion: Its motion; None in `ramp` and `settle`.
        solution: What the step found; None at the start.
        time: [s], or share of the load in a ramp, or number of the reset in `settle`.
        step: Number of the step in its phase; 0 at the start.
        last: Whether the phase ends here.
    """

    scene: Scene
    motion: Dynamics | None
    solution: Solution | None
    time: float
    step: int
    last: bool
