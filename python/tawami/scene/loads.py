"""Loads of a scene: weight, tractions on edges of the grid, forces on particles that move with them.

Loads that are new since the last full solve grow with a part from 0 to 1; the others stay.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import InputError, SupportError
from tawami.base.identity import text
from tawami.base.text import listed
from tawami.grid import edges
from tawami.grid.edges import Interval, Profile
from tawami.grid.grid import Edge, Grid
from tawami.scene.domain import Domain
from tawami.scene.share import Share, check_same_number

Array = npt.NDArray[np.float64]


@dataclass
class Traction:
    """A traction (t_x, t_y) [Pa] on an edge of the grid."""

    edge: Edge
    value: tuple[Profile, Profile]
    between: Interval | None = None
    share: Share = field(default_factory=Share)

    def __str__(self) -> str:
        return f"traction(edge='{self.edge}')"


@dataclass
class Forces:
    """Forces [N per metre depth] on particles of the body, particles of the body x dim."""

    force: Array
    share: Share = field(default_factory=Share)

    def __str__(self) -> str:
        return f"force on {np.count_nonzero(self.force.any(axis=1))} particles"


class Loads:
    """The loads of one scene.

    Args:
        grid: The grid.
        num_particles: Number of particles of the body.

    Attributes:
        weight: Acceleration of gravity (b_x, b_y) [m/s2], which grows like the other loads.
    """

    def __init__(self, grid: Grid, num_particles: int) -> None:
        self.grid, self.num_particles = grid, num_particles
        self.weight = Share(*np.zeros((3, grid.space.dim)))
        self.tractions: list[Traction] = []
        self.forces: list[Forces] = []

    @property
    def gravity(self) -> Array:
        """The acceleration that the script asked for [m/s2]."""
        return np.asarray(self.weight.target)

    @gravity.setter
    def gravity(self, acceleration: Array) -> None:
        self.weight.target = acceleration

    @property
    def signature(self) -> tuple[Any, ...]:
        """A value that differs once the loads are others."""
        return (*self.gravity, *map(id, self.tractions), *map(id, self.forces))

    def add_traction(
        self, edge: Edge, value: tuple[Profile, Profile], between: Interval | None
    ) -> None:
        """Load an edge of the grid with a traction [Pa]."""
        what = f"traction(edge='{edge}')"
        t_x, t_y = checks.pair(what, value, "components (t_x, t_y)")
        components = checks.profile(f"{what}: t_x", t_x), checks.profile(f"{what}: t_y", t_y)
        edges.cells_between(self.grid, edge, between)
        self.tractions.append(Traction(edge, components, between))

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
        each = np.zeros((self.num_particles, self.grid.space.dim))
        each[chosen] = total / len(chosen)
        self.forces.append(Forces(each))

    def external(self, domain: Domain, part: float) -> Array:
        """External forces on all coefficients.

        Args:
            domain: The particles where they are.
            part: Share of the loads that are new.
        """
        gravity, particles = self.weight.at(part), domain.particles
        external = np.zeros(domain.layout.size)
        if self.forces or gravity.any():
            on_particles = np.zeros((len(particles), self.grid.space.dim))
            if gravity.any():
                on_particles += domain.mass[:, None] * gravity
            for forces in self.forces:
                on_particles += forces.share.at(part) * forces.force[particles.number]
            sums = domain.sums(np.ones(len(particles)), on_particles)
            external[: sums.size] = sums.ravel()
        for traction in self.tractions:
            external += traction.share.at(part) * self._on_edge(domain, traction)
        return external

    def _on_edge(self, domain: Domain, traction: Traction) -> Array:
        """Forces of the whole traction on all coefficients."""
        edge = traction.edge
        nodes, loaded = domain.tractions.nodes(edge), self._cells(domain, traction)
        if not loaded.any():
            raise SupportError(
                f"{traction}: no cell along that edge of the grid holds particles; let the grid end "
                "where the body is loaded, or use load(particles, force)"
            )
        x, y = nodes[..., 0].ravel(), nodes[..., 1].ravel()
        values = [edges.evaluate(component, x, y, f"{traction}") for component in traction.value]
        at_nodes = np.stack(values, axis=-1).reshape(nodes.shape)
        return domain.tractions.forces(edge, np.where(loaded[:, None, None], at_nodes, 0.0))

    def _cells(self, domain: Domain, traction: Traction) -> npt.NDArray[np.bool_]:
        """Which cells with particles along its edge a traction loads."""
        part = edges.cells_between(self.grid, traction.edge, traction.between)
        mask: npt.NDArray[np.bool_] = part[domain.tractions.cells(traction.edge)]
        return mask

    def accept(self, part: float) -> None:
        """Later parts grow from this share of what is new."""
        for share in self._shares:
            share.accept(part)

    @property
    def _shares(self) -> Iterator[Share]:
        yield self.weight
        yield from (traction.share for traction in self.tractions)
        yield from (forces.share for forces in self.forces)

    # -- header, identity, checkpoints ---------------------------------------

    @property
    def line(self) -> str:
        """The loads in words, for the header of a run."""
        b = ", ".join(f"{component:g}" for component in self.gravity)
        texts = [f"gravity ({b}) m/s2"] if self.gravity.any() else []
        return listed([*texts, *map(str, self.tractions), *map(str, self.forces)])

    def identity(self) -> list[Any]:
        """What decides the results of a run, as JSON holds it."""
        return [
            list(map(float, self.gravity)),
            *([t.edge, *map(text, t.value), text(t.between)] for t in self.tractions),
            *(hashlib.sha256(f.force.tobytes()).hexdigest() for f in self.forces),
        ]

    def state(self) -> dict[str, Any]:
        """How much of each load the body carries."""
        return {
            "tractions": len(self.tractions),
            "forces": len(self.forces),
            "shares": [share.state() for share in self._shares],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, for the same loads.

        Raises:
            CheckpointError: The script has made another number of loads.
        """
        check_same_number("load", state["tractions"], len(self.tractions))
        check_same_number("load", state["forces"], len(self.forces))
        for share, values in zip(self._shares, state["shares"], strict=True):
            share.restore(values)
