"""Loads of a scene: weight, tractions on edges of the grid, forces on particles that move with them.

What is new since the last step that was solved in full comes by a share `part` from 0 to 1; what was
there already stays.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.base.errors import CheckpointError, InputError, SupportError
from tawami.base.identity import text
from tawami.grid import edges
from tawami.grid.edges import Interval, Profile
from tawami.grid.grid import Edge, Grid
from tawami.scene.domain import Attached

Array = npt.NDArray[np.float64]


@dataclass
class Traction:
    """A traction (t_x, t_y) [Pa] on an edge of the grid; `carried` is 1 once the body has borne it."""

    edge: Edge
    value: tuple[Profile, Profile]
    between: Interval | None = None
    carried: float = 0.0


@dataclass
class Forces:
    """Forces [N per metre depth] on particles of the body, particles of the body x 2."""

    force: Array
    carried: float = 0.0


def check_alike(what: str, there: int, here: int) -> None:
    """Whether a stored state has as many loads or supports as the script has made.

    Raises:
        CheckpointError: It has not.
    """
    if there != here:
        raise CheckpointError(
            f"the run had {there} {what}s of a kind when it was stored, and the script has made {here}: "
            f"they were changed while it ran (each=). Expected {what}s to change between two phases"
        )


class Loads:
    """The loads of one scene.

    Args:
        grid: The grid.
        num_particles: Number of particles of the body.
    """

    def __init__(self, grid: Grid, num_particles: int) -> None:
        self.grid, self.num_particles = grid, num_particles
        self.gravity, self._carried_gravity = np.zeros(2), np.zeros(2)
        self.tractions: list[Traction] = []
        self.forces: list[Forces] = []

    @property
    def signature(self) -> tuple[Any, ...]:
        """Another one once the loads are others."""
        return (*self.gravity, *map(id, self.tractions), *map(id, self.forces))

    def state(self) -> dict[str, Any]:
        """What of them the body bears already."""
        return {
            "gravity": self._carried_gravity,
            "target": self.gravity,
            "tractions": [traction.carried for traction in self.tractions],
            "forces": [forces.carried for forces in self.forces],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, of the same loads."""
        check_alike("load", len(state["tractions"]), len(self.tractions))
        check_alike("load", len(state["forces"]), len(self.forces))
        self._carried_gravity, self.gravity = state["gravity"], state["target"]
        for traction, carried in zip(self.tractions, state["tractions"], strict=True):
            traction.carried = carried
        for forces, carried in zip(self.forces, state["forces"], strict=True):
            forces.carried = carried

    def identity(self) -> list[Any]:
        """What tells them from other loads, for checkpoints."""
        return [
            list(map(float, self.gravity)),
            *([t.edge, *map(text, t.value), text(t.between)] for t in self.tractions),
            *(hashlib.sha256(f.force.tobytes()).hexdigest() for f in self.forces),
        ]

    def add_forces(self, particles: npt.ArrayLike, force: Sequence[float]) -> None:
        """Share a force [N per metre depth] out among particles of the body, a mask or numbers."""
        total = np.array(checks.point("load(...): force", force))
        chosen = checks.any_array("load(...): particles", particles)
        if chosen.dtype == bool and chosen.shape == (self.num_particles,):
            chosen = np.flatnonzero(chosen)
        inside = chosen.dtype.kind in "iu" and chosen.ndim == 1
        if not (inside and ((chosen >= 0) & (chosen < self.num_particles)).all()):
            raise InputError(
                f"load(particles={checks.shown(particles)}): expected a mask of the "
                f"{self.num_particles} particles of the body, or their numbers"
            )
        chosen = np.unique(chosen)
        if chosen.size == 0:
            raise InputError("load(...): no particle was chosen; the force would act on nothing")
        each = np.zeros((self.num_particles, 2))
        each[chosen] = total / len(chosen)
        self.forces.append(Forces(each))

    def external(
        self,
        attached: Attached,
        particles: _rust.Particles,
        mass: Callable[[], Array],
        part: float,
    ) -> Array:
        """External forces on all coefficients.

        Args:
            attached: The particles where they are.
            particles: The particles of this rank.
            mass: Gives their masses [kg per metre depth]; called where there is gravity only.
            part: Share of the loads that are new.
        """
        gravity = self._gravity_at(part)
        external = np.zeros(attached.layout.size)
        if self.forces or gravity.any():
            on_particles = np.zeros((len(particles), 2))
            if gravity.any():
                on_particles += mass()[:, None] * gravity
            for forces in self.forces:
                on_particles += _share(forces, part) * forces.force[particles.number]
            sums = attached.sums(np.ones(len(particles)), on_particles)
            external[: sums.size] = sums.ravel()
        for traction in self.tractions:
            external += _share(traction, part) * self._on_edge(attached, traction)
        return external

    def _on_edge(self, attached: Attached, traction: Traction) -> Array:
        edge, what = traction.edge, f"traction(edge='{traction.edge}')"
        nodes, loaded = attached.field.edge_nodes(edge), self._cells(attached, traction)
        if not loaded.any():
            raise SupportError(
                f"{what}: no cell along that edge of the grid holds particles; let the grid end where "
                "the body is loaded, or use load(particles, force)"
            )
        x, y = nodes[..., 0].ravel(), nodes[..., 1].ravel()
        values = [edges.evaluate(component, x, y, what) for component in traction.value]
        at_nodes = np.stack(values, axis=-1).reshape(nodes.shape)
        return attached.field.traction(edge, np.where(loaded[:, None, None], at_nodes, 0.0))

    def _cells(self, attached: Attached, traction: Traction) -> npt.NDArray[np.bool_]:
        """Which cells with particles along its edge a traction loads."""
        part = edges.cells_between(self.grid, traction.edge, traction.between)
        mask: npt.NDArray[np.bool_] = part[attached.field.along(traction.edge)]
        return mask

    def accept(self, part: float) -> None:
        """This share of what is new is there now."""
        self._carried_gravity = self._gravity_at(part)
        loads: list[Traction | Forces] = [*self.tractions, *self.forces]
        for load in loads:
            load.carried = _share(load, part)

    def _gravity_at(self, part: float) -> Array:
        return np.asarray(self._carried_gravity + part * (self.gravity - self._carried_gravity))


def _share(load: Traction | Forces, part: float) -> float:
    return load.carried + part * (1.0 - load.carried)
