"""Walls with Coulomb friction at the edges of the grid.

A function of the wall is apart from it, or in contact; in contact it sticks, or slides against a
friction of `mu` times its pressure:

    g_n >= 0,  r_n >= 0,  g_n r_n = 0;       |r_t| <= mu r_n,  sliding at |r_t| = mu r_n against it

g_n and r_n are displacement away from the wall and reaction of the function that the wall carries.
These states are found by an active set: a step is solved with those of the last one, states that
contradict it are changed, and it is solved again from there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tawami.basis import Basis
from tawami.boundary import Held, edge_functions
from tawami.grid import Edge, Grid

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

#: Forces and displacements that count as none, relative to the largest on the wall and to h.
FORCE, GAP = 1e-6, 1e-12


@dataclass
class Contact:
    """State of the functions along a wall.

    Attributes:
        touching: Whether each is in contact.
        slip: Direction (-1 or 1) of the friction on each that slides, 0 for one that sticks.
    """

    touching: Mask
    slip: npt.NDArray[np.int8]


@dataclass
class Wall:
    """A wall along an edge of the grid.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        edge: Its edge.
        friction: Coefficient mu; 0 is smooth.
        separates: Whether the body may leave it.

    Attributes:
        functions: Displacement functions along it.
        state: Their state.
    """

    grid: Grid
    basis: Basis
    edge: Edge
    friction: float
    separates: bool
    functions: npt.NDArray[np.int64] = field(init=False)
    state: Contact = field(init=False)

    def __post_init__(self) -> None:
        self.functions = edge_functions(self.grid, self.basis, self.edge)
        n = len(self.functions)
        # without friction nothing sticks; the sign does not matter then
        slip = np.full(n, 1 if self.friction == 0 else 0, dtype=np.int8)
        self.state = Contact(np.ones(n, dtype=bool), slip)

    @property
    def _axes(self) -> tuple[int, int, int]:
        """Axis across the wall, axis along it, and the sign of the direction into the grid."""
        axis, end = self.grid.edge(self.edge)
        return axis, 1 - axis, -1 if end else 1

    def held(self, active: Mask) -> list[Held]:
        """What the wall prescribes in the present states; `active`: coefficients with particles."""
        across, along, _ = self._axes
        supports = []
        touching = self.state.touching
        for axis, mask in ((across, touching), (along, touching & (self.state.slip == 0))):
            indices = 2 * self.functions[mask] + axis
            indices = indices[active[indices]]
            supports.append(Held(indices, np.zeros(len(indices))))
        return supports

    def friction_of(self, forces: Array) -> Array:
        """Friction on the body (functions x 2), from what the wall has to give to hold it."""
        across, along, inward = self._axes
        friction = np.zeros_like(forces)
        sliding = self.functions[self.state.touching & (self.state.slip != 0)]
        push = np.maximum(inward * forces[sliding, across], 0.0)
        direction = self.state.slip[self.state.touching & (self.state.slip != 0)]
        friction[sliding, along] = self.friction * push * direction if self.friction else 0.0
        return friction

    def adapt(self, forces: Array, u: Array, active: Mask, *, monotone: bool) -> bool:
        """Change the states that contradict a solution; whether there were any.

        Args:
            forces: Reactions that supports and walls give, functions x 2.
            u: Displacement increments, functions x 2.
            active: Whether each function has particles.
            monotone: Functions only let go: what came back would go round in circles.
        """
        across, along, inward = self._axes
        here, f = active[self.functions], self.functions
        push, moved = inward * forces[f, across], u[f, along]
        none, nowhere = FORCE * np.abs(forces[f]).max(initial=0.0), GAP * self.grid.h
        leaves = here & self.state.touching & self.separates & (push < -none)
        meets = here & ~self.state.touching & (inward * u[f, across] < -nowhere)
        slides, sticks = np.zeros_like(here), np.zeros_like(here)
        if self.friction > 0:
            held = here & self.state.touching & ~leaves
            bound = self.friction * np.maximum(push, 0.0) if np.isfinite(self.friction) else np.inf
            slides = held & (self.state.slip == 0) & (np.abs(forces[f, along]) > bound + none)
            sticks = held & (self.state.slip != 0) & (self.state.slip * moved > nowhere)
        if monotone:
            meets, sticks = np.zeros_like(here), np.zeros_like(here)
        self.state.touching = (self.state.touching & ~leaves) | meets
        self.state.slip[slides] = np.sign(forces[f, along][slides]).astype(np.int8)
        if self.friction > 0:
            self.state.slip[sticks | meets] = 0
        return bool((leaves | meets | slides | sticks).any())
