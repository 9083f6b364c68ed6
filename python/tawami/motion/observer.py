"""What observers of a run look at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tawami.motion.dynamics import Dynamics
    from tawami.scene.scene import Scene
    from tawami.scene.solution import Solution


@dataclass(frozen=True)
class Moment:
    """A run after the start of a phase (step 0) and after every accepted step.

    Attributes:
        scene: The scene.
        motion: Its motion; None in `ramp` and `settle`.
        solution: Of the step; None at step 0.
        time: [s], or the share of the load in `ramp`, the number of the reset in `settle`.
        step: Number of the step in the phase.
        last: Whether it is the last of the phase.
    """

    scene: Scene
    motion: Dynamics | None
    solution: Solution | None
    time: float
    step: int
    last: bool
