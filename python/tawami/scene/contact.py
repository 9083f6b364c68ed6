"""Contact and friction of the walls in one step: states that the solution does not contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami.scene.walls import Wall

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class ActiveSet:
    """The walls of a scene, and the components that other supports prescribe along them.

    Attributes:
        walls: The walls; :meth:`adapt` changes their states.
        prescribed: For each wall whether other supports prescribe its components, functions x dim.
    """

    walls: Sequence[Wall] = ()
    prescribed: Sequence[Mask] = ()

    def friction(self, forces: Array) -> Array:
        """Friction on the body (functions x dim) from the forces that supports and walls exert on it."""
        pairs = zip(self.walls, self.prescribed, strict=True)
        parts = (wall.friction_of(forces, prescribed) for wall, prescribed in pairs)
        return sum(parts, np.zeros_like(forces))

    def adapt(self, forces: Array, u: Array, before: Array, active: Mask) -> bool:
        """Change the states of the walls that a solution contradicts.

        Args:
            forces: Forces of supports and walls on the body, functions x dim.
            u: Increments of the displacement, functions x dim.
            before: Displacement before them since the body touched the walls, functions x dim.
            active: Whether each function has particles.

        Returns:
            Whether any state was changed.
        """
        changed = [
            wall.adapt(forces, u, before, active, prescribed)
            for wall, prescribed in zip(self.walls, self.prescribed, strict=True)
        ]
        return any(changed)
