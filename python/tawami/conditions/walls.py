"""Walls with Coulomb friction at the edges of the grid.

A wall is an obstacle, the half-plane behind the edge, for the border of the body. Loose particles have
no border, nor have parts that broke off. For these it holds functions of the grid that no border
reaches: each is apart from the wall, or in contact; in contact it sticks, or slides against a friction
of `mu` times its pressure:

    g_n >= 0,  r_n >= 0,  g_n r_n = 0;       |r_t| <= mu r_n,  sliding at |r_t| = mu r_n against it

g_n and r_n are displacement away from the wall and reaction of the function that the wall carries.
These states are found by an active set: a step is solved with those of the last one, states that
contradict it are changed, and it is solved again from there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask, of_components
from tawami.base.errors import InputError
from tawami.border.shapes import HalfPlane, half_plane
from tawami.conditions.action import Owner
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.obstacle_inputs import checked_friction
from tawami.domain.domain import Domain
from tawami.field.constraints import Held
from tawami.field.layout import Layout
from tawami.grid.basis import Basis
from tawami.grid.edges import edge_functions
from tawami.grid.grid import Edge, Grid

#: Forces and displacements below which they are round-off, relative to the largest force on the wall
#: and to h.
FORCE, GAP = 1e-6, 1e-12
#: Times that a function may come back to the wall, or to rest, in one step.
RETURNS = 4


def name_of(edge: str) -> str:
    """Name of the wall at an edge of the grid."""
    return f"wall {edge}"


@dataclass
class WallState:
    """State of the functions along a wall.

    Attributes:
        touching: Whether each is in contact.
        slip: Direction (-1 or 1) of the friction on each that slides, 0 for one that sticks.
    """

    touching: Mask
    slip: npt.NDArray[np.int8]


@dataclass(repr=False, eq=False)
class Wall:
    """A wall along an edge of the grid.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        edge: Its edge.
        friction: Coefficient mu; 0 is smooth.
        separates: Whether the body may leave it.
        owner: The supports of the scene that it is one of, if there is a scene.

    Attributes:
        obstacle: The obstacle; None for a body without a border.
        functions: Displacement functions of the whole grid along it.
        state: Their states of contact.
        returns: Number of times that each came back to the wall or to rest in this step.
        told: Whether a warning was issued that it acts at a distance from loose particles.
    """

    grid: Grid
    basis: Basis
    edge: Edge
    friction: float
    separates: bool
    owner: Owner[Any] | None = None
    obstacle: Obstacle | None = field(init=False, default=None)
    functions: npt.NDArray[np.int64] = field(init=False)
    state: WallState = field(init=False)
    returns: npt.NDArray[np.int64] = field(init=False)
    told: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        self.functions = edge_functions(self.grid, self.basis, self.edge)
        self._touch(np.ones(len(self.functions), dtype=bool))
        self.begin()

    def _touch(self, touching: Mask) -> None:
        """States of contact in which nothing has slipped."""
        # without friction nothing sticks; the sign does not matter then
        slip = np.full(len(touching), 1 if self.friction == 0 else 0, dtype=np.int8)
        self.state = WallState(touching, slip)

    def __str__(self) -> str:
        return f"wall(edge='{self.edge}') friction {self.friction:g}"

    def __repr__(self) -> str:
        return f"Wall({self})"

    def change(self, friction: float) -> None:
        """Replace the coefficient of friction from the next step on.

        Raises:
            InputError: It was released, or the friction is negative; nothing has changed.
        """
        owner = self._owner("change(...)")
        self.friction = checked_friction(f"wall(edge='{self.edge}')", friction)
        if self.obstacle is not None:
            self.obstacle.change(friction=friction)
        self._touch(self.state.touching)
        owner.changed()

    def release(self) -> None:
        """Remove it.

        Raises:
            InputError: It was released before.
        """
        self._owner("release()").remove(self)
        self.owner = None
        if self.obstacle is not None:
            self.obstacle.release()

    def _owner(self, what: str) -> Owner[Any]:
        if self.owner is None:
            raise InputError(f"{self}.{what} was called after its release: expected a new one")
        self.owner.activity.check_between_steps(f"{self}.{what}")
        return self.owner

    def stored(self) -> dict[str, Any]:
        """Its states for a checkpoint."""
        state = self.state
        touching, slip = np.array(state.touching), np.array(state.slip)
        return {"touching": touching, "slip": slip, "friction": self.friction}

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`stored`."""
        self.state = WallState(state["touching"], state["slip"])
        self.friction = state["friction"]

    def begin(self) -> None:
        """Start a step: forget how often functions came back in the last one."""
        self.returns = np.zeros(len(self.functions), dtype=np.int64)

    @property
    def name(self) -> str:
        """Its name for `solution.contact(...)`."""
        return name_of(self.edge)

    @property
    def half_plane(self) -> HalfPlane:
        """The half-plane behind the edge."""
        across, _, inward = self.axes
        point = self.grid.origin if inward > 0 else self.grid.upper
        return half_plane(point, inward * np.eye(self.grid.space.dim)[across])

    @property
    def axes(self) -> tuple[int, int, int]:
        """Axis across the wall, axis along it, and the sign of the direction into the grid."""
        axis, end = self.grid.edge(self.edge)
        return axis, 1 - axis, -1 if end else 1

    @property
    def stopped(self) -> npt.NDArray[np.int64]:
        """Coefficients of the whole grid that it stops from passing through."""
        across, _, _ = self.axes
        return self.grid.space.dim * self.functions[self.state.touching] + across

    def of_border(self, domain: Domain) -> Mask:
        """Mask of its functions that the border of the body reaches: they belong to the obstacle; a call
        for all ranks.
        """
        if self.obstacle is None:
            return np.zeros(len(self.functions), dtype=bool)
        cells = self.obstacle.place.cells(domain, torn=True)
        functions = cells.of_rank.tabulated(self.basis)[0][~cells.lost[cells.own]]
        in_grid = domain.layout.window.in_grid(self.basis, functions.ravel())
        return ranks.any_of(self.grid.comm, np.isin(self.functions, in_grid))

    def prescribed(self, fixed: Sequence[Indices]) -> Mask:
        """Whether other supports prescribe its components, functions x dim.

        Args:
            fixed: Coefficients of the whole grid that other supports prescribe.
        """
        components = of_components(self.functions, self.grid.space.dim)
        mask: Mask = np.isin(components, np.concatenate([components[:0, 0], *fixed]))
        return mask

    def held(self, layout: Layout, prescribed: Mask, start: Array, before: Array) -> list[Held]:
        """Values that the wall prescribes in the present states; a call for all ranks.

        Args:
            layout: Places of the coefficients.
            prescribed: As :meth:`prescribed` gives it; the wall leaves these to the other supports.
            start: Coefficients at the start of the step, which the values include.
            before: Displacement coefficients since the body touched the wall.
        """
        across, along, _ = self.axes
        touching, supports = self.state.touching, []
        for axis, mask in ((across, touching), (along, touching & (self.state.slip == 0))):
            chosen = self.functions[mask & ~prescribed[:, axis]]
            indices = self.grid.space.dim * chosen + axis
            indices = indices[layout.at(layout.active.astype(float), indices) > 0]
            values = layout.at(start, indices)
            if axis == across:
                values = values - layout.at(before, indices)
            supports.append(Held(indices, values, str(self)))
        return supports

    def friction_of(self, forces: Array, prescribed: Mask) -> Array:
        """Friction on the body from the forces with which the wall would hold it.

        Both are those of the functions of the wall, functions x dim.
        """
        across, along, inward = self.axes
        friction = np.zeros_like(forces)
        sliding = self.state.touching & (self.state.slip != 0) & ~prescribed[:, along]
        push = np.maximum(inward * forces[sliding, across], 0.0)
        slip = self.state.slip[sliding]
        friction[sliding, along] = self.friction * push * slip if self.friction else 0
        return friction

    def adapt(self, forces: Array, u: Array, before: Array, active: Mask, prescribed: Mask) -> bool:
        """Change the states that contradict a solution; returns whether there were any.

        A function that comes back to the wall, or to rest, more than RETURNS times in one step
        keeps its state: otherwise the search could repeat the same states forever.

        Args:
            forces: Forces of supports and walls on the body, functions of the wall x dim.
            u: Displacement increments, likewise.
            before: Displacement before them since the body touched the wall, likewise.
            active: Whether each function of the wall has particles.
            prescribed: As :meth:`prescribed` gives it.
        """
        across, along, inward = self.axes
        state, no_distance = self.state, GAP * self.grid.h
        here, free_of_supports = active, ~prescribed
        push, moved = inward * forces[:, across], u[:, along]
        no_force = FORCE * np.abs(forces).max(initial=0.0)
        below = inward * (before + u)[:, across] < -no_distance
        free = here & free_of_supports[:, across]
        leaves = free & state.touching & self.separates & (push < -no_force)
        meets = free & ~state.touching & below & (self.returns < RETURNS)
        slides, sticks = np.zeros_like(here), np.zeros_like(here)
        if self.friction > 0:
            held = here & state.touching & ~leaves & free_of_supports[:, along]
            bound = self.friction * np.maximum(push, 0.0) if np.isfinite(self.friction) else np.inf
            slides = held & (state.slip == 0) & (np.abs(forces[:, along]) > bound + no_force)
            sticks = held & (state.slip * moved > no_distance) & (self.returns < RETURNS)
        self.returns += meets | sticks
        state.touching = (state.touching & ~leaves) | meets
        state.slip[slides] = np.sign(forces[slides, along]).astype(np.int8)
        if self.friction > 0:
            state.slip[sticks | meets] = 0
        return bool((leaves | meets | slides | sticks).any())


def on_functions(walls: Sequence[Wall], domain: Domain) -> dict[Wall, Mask]:
    """The walls that hold functions of the grid, with masks of those that belong to their obstacles; a
    call for all ranks.
    """
    found, layout = {}, domain.layout
    for wall in walls:
        of_border = wall.of_border(domain)
        active = layout.at(layout.active.astype(float), wall.grid.space.dim * wall.functions) > 0
        if (active & ~of_border).any():
            found[wall] = of_border
    return found
