"""Contact and friction of the walls in one step: states that the solution does not contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tawami.base.arrays import Array, Mask
from tawami.conditions.walls import Wall
from tawami.field.layout import Layout


@dataclass(frozen=True)
class ActiveSet:
    """The walls of a scene, and the components that other supports prescribe along them.

    Attributes:
        layout: Places of the coefficients.
        walls: The walls; :meth:`adapt` changes their states.
        prescribed: For each wall whether other supports prescribe its components, functions x dim.
    """

    layout: Layout
    walls: Sequence[Wall] = ()
    prescribed: Sequence[Mask] = ()

    def friction(self, forces: Array) -> Array:
        """Friction on the body (functions x dim) from the forces that supports and walls exert on it.

        A call for all ranks.
        """
        friction, dim = np.zeros_like(forces), forces.shape[1]
        for wall, prescribed in zip(self.walls, self.prescribed, strict=True):
            found = wall.friction_of(self.layout.vectors_at(forces, wall.functions), prescribed)
            places = self.layout.places(dim * wall.functions) // dim
            friction[places[places >= 0]] += found[places >= 0]
        return friction

    def adapt(self, forces: Array, u: Array, before: Array) -> bool:
        """Change the states of the walls that a solution contradicts; a call for all ranks.

        Args:
            forces: Forces of supports and walls on the body, functions x dim.
            u: Increments of the displacement, functions x dim.
            before: Displacement before them since the body touched the walls, functions x dim.

        Returns:
            Whether any state was changed.
        """
        changed = []
        for wall, prescribed in zip(self.walls, self.prescribed, strict=True):
            f, layout = wall.functions, self.layout
            push, moved, since = (layout.vectors_at(values, f) for values in (forces, u, before))
            active = layout.at(layout.active.astype(float), u.shape[1] * f) > 0
            changed.append(wall.adapt(push, moved, since, active, prescribed))
        return any(changed)
