"""Loads of a scene: weight, tractions on edges of the grid, forces on particles that move with them.

Loads that are new since the last full solve grow with a part from 0 to 1; the others stay.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError, SupportError
from tawami.base.identity import text
from tawami.base.text import listed
from tawami.grid import edges
from tawami.grid.edges import Interval
from tawami.grid.grid import Edge, Grid
from tawami.scene.action import Action, Owner, Term, Value, restored
from tawami.scene.activity import Activity
from tawami.scene.domain import Domain
from tawami.scene.factor import Factor
from tawami.scene.share import Moment

Numbers = npt.NDArray[np.integer[Any]]


class Load(Action):
    """A load of a scene: :meth:`change` replaces its value, :meth:`release` takes it away."""

    __slots__ = ()

    @property
    def line(self) -> str:
        """The load in words, for the header of a run."""
        return f"{self}{self.terms[-1].factor}{' until it fades' if self.released else ''}"

    def place(self) -> list[Any]:
        """Place where it acts, in the types of JSON."""
        return []


class Weight(Load):
    """The weight of the body; its values are the components of an acceleration [m/s2]."""

    __slots__ = ()

    def _checked(self, value: Any) -> tuple[Value, ...]:
        return checks.point("gravity", value)

    @property
    def acceleration(self) -> Array:
        """The acceleration in the driver script [m/s2]."""
        return np.array(self.terms[-1].values if not self.released else np.zeros(2), dtype=float)

    def __str__(self) -> str:
        b = ", ".join(f"{component:g}" for component in self.terms[-1].values)
        return f"gravity ({b}) m/s2"


class Traction(Load):
    """A traction on an edge of the grid; its values are components [Pa]."""

    __slots__ = ("between", "edge")

    def __init__(
        self, owner: Owner[Any], edge: Edge, value: Any, between: Interval | None, factor: Factor
    ) -> None:
        self.edge, self.between = edge, between
        super().__init__(owner, value, factor)

    def _checked(self, value: Any) -> tuple[Value, ...]:
        t_x, t_y = checks.pair(f"{self}", value, "components (t_x, t_y)")
        return checks.profile(f"{self}: t_x", t_x), checks.profile(f"{self}: t_y", t_y)

    def place(self) -> list[Any]:
        """Edge, and part of it."""
        return [self.edge, text(self.between)]

    def __str__(self) -> str:
        return f"traction(edge='{self.edge}')"


class Forces(Load):
    """Forces on particles of the body [N per metre depth]; its values are the components of one force
    that they share by volume, or arrays of the components on each particle of the body.

    Attributes:
        chosen: Numbers of the particles.
        shares: Share of each particle of the body in one force.
    """

    __slots__ = ("_dim", "chosen", "shares")

    def __init__(
        self, owner: Loads, chosen: Indices, volume: Array, value: Any, factor: Factor
    ) -> None:
        self._dim = owner.grid.space.dim
        self.chosen, self.shares = chosen, np.zeros(len(volume))
        self.shares[chosen] = volume[chosen] / volume[np.unique(chosen)].sum()
        super().__init__(owner, value, factor)

    def _checked(self, value: Any) -> tuple[Value, ...]:
        given = checks.any_array("load(...): force", value)
        if given.ndim != 2:
            return checks.point("load(...): force", value)
        forces = checks.array("load(...): force", given, 2)
        n, dim = len(self.chosen), self._dim
        if forces.shape != (n, dim):
            raise InputError(
                f"load(...): force has shape {forces.shape}: expected ({n}, {dim}), one row for each of "
                f"the {n} particles in their order, or {dim} components of a force that they share"
            )
        if not np.isfinite(forces).all():
            k = int(np.flatnonzero(~np.isfinite(forces).all(axis=1))[0])
            raise InputError(f"load(...): force[{k}] = {forces[k]}: expected finite numbers")
        if len(np.unique(self.chosen)) < n:
            raise InputError(
                "load(...): a particle is given twice, with a force for each: expected each once"
            )
        on_body = np.zeros((dim, len(self.shares)))
        on_body[:, self.chosen] = forces.T
        return tuple(on_body)

    def on(self, term: Term, number: Numbers) -> Array:
        """Forces of a term on the particles of these numbers, particles x dim."""
        return np.column_stack(
            [
                v[number] if isinstance(v, np.ndarray) else v * self.shares[number]
                for v in term.values
            ]
        )

    def place(self) -> list[Any]:
        """A hash of the shares."""
        return [hashlib.sha256(self.shares.tobytes()).hexdigest()]

    def __str__(self) -> str:
        return f"force on {np.count_nonzero(self.shares)} particles"


class Loads(Owner[Load]):
    """The loads of one scene.

    Args:
        grid: The grid.
        volume: Volume of each particle of the body [m2].
        activity: Time and activity of the scene.

    Attributes:
        all: The loads, also those that were released and have not faded.
        unbalanced: Forces on all coefficients that keep the body in equilibrium after its particles or
            laws have changed, and that fade as a released load does [N per metre depth]; None for none.
        version: A number that changes with every change of a load.
    """

    def __init__(self, grid: Grid, volume: Array, activity: Activity) -> None:
        super().__init__(activity)
        self.grid, self._volume = grid, volume
        self.unbalanced: Array | None = None

    def remove(self, action: Load) -> None:
        """A released load stays until it has faded."""
        self._drop_faded()
        self.changed()

    def _drop_faded(self) -> None:
        self.all = [
            load
            for load in self.all
            if not load.released or any(not t.share.is_gone for t in load.terms)
        ]

    def _factor(self, where: str, amplitude: Any) -> Factor:
        self.activity.check_between_steps(where)
        return Factor(where, amplitude, time=self.activity.time)

    def add_gravity(self, acceleration: Any, amplitude: Any) -> Load:
        """Load the body by its weight."""
        weight = Weight(self, acceleration, self._factor("gravity(...)", amplitude))
        self.all.append(weight)
        return weight

    def add_traction(
        self, edge: Edge, value: Any, between: Interval | None, amplitude: Any
    ) -> Load:
        """Load an edge of the grid with a traction [Pa]."""
        factor = self._factor(f"traction(edge='{edge}')", amplitude)
        edges.cells_between(self.grid, edge, between)
        traction = Traction(self, edge, value, between, factor)
        self.all.append(traction)
        return traction

    def add_forces(self, particles: Indices, force: Any, amplitude: Any) -> Load:
        """Load particles of the body, given by their numbers."""
        factor = self._factor("load(...)", amplitude)
        forces = Forces(self, particles, self._volume, force, factor)
        self.all.append(forces)
        return forces

    @property
    def gravity(self) -> Array:
        """The acceleration in the driver script, without amplitudes [m/s2]."""
        weights = [load.acceleration for load in self.all if isinstance(load, Weight)]
        return sum(weights, np.zeros(self.grid.space.dim))

    def acceleration(self, now: Moment) -> Array:
        """Acceleration of all weights at a moment [m/s2]."""
        total = np.zeros(self.grid.space.dim)
        for load, term, factor in self._acting(now):
            if isinstance(load, Weight):
                total += factor * np.array(term.values, dtype=float)
        return total

    @property
    def vary(self) -> bool:
        """Whether any load follows an amplitude in time."""
        return any(term.factor.moves for load in self.all for term in load.terms)

    # -- forces --------------------------------------------------------------

    def external(self, domain: Domain, now: Moment) -> Array:
        """External forces on all coefficients.

        Args:
            domain: The particles where they are.
            now: Part of the loads that are new, and time.
        """
        particles, external = domain.particles, np.zeros(domain.layout.size)
        on_particles, any_on_particles = np.zeros((len(particles), self.grid.space.dim)), False
        for load, term, factor in self._acting(now):
            if isinstance(load, Traction):
                external += factor * self._on_edge(domain, load, term)
                continue
            if isinstance(load, Forces):
                on_particles += factor * load.on(term, particles.number)
            else:
                on_particles += domain.mass[:, None] * (factor * np.array(term.values, dtype=float))
            any_on_particles = True
        if any_on_particles:
            sums = domain.sums(np.ones(len(particles)), on_particles)
            external[: sums.size] += sums.ravel()
        if self.unbalanced is not None:
            external += (1 - now.part) * self.unbalanced
        return external

    def keep_balance(self, forces: Array) -> None:
        """Add forces on all coefficients that fade from now on [N per metre depth]."""
        self.unbalanced = forces if self.unbalanced is None else self.unbalanced + forces
        self.changed()

    def _acting(self, now: Moment) -> Iterator[tuple[Load, Term, float]]:
        """The terms with their factors, but for those that are zero."""
        for load in self.all:
            for term in load.terms:
                factor = term.at(now)
                if not term.is_zero and (factor or isinstance(load, Traction)):
                    yield load, term, factor

    def _on_edge(self, domain: Domain, traction: Traction, term: Term) -> Array:
        """Forces of the whole traction on all coefficients."""
        edge = traction.edge
        nodes, loaded = domain.tractions.nodes(edge), self._cells(domain, traction)
        if not loaded.any() and traction.released:  # what it loaded was removed
            return np.zeros(domain.layout.size)
        if not loaded.any():
            raise SupportError(
                f"{traction}: no cell along that edge of the grid holds particles; let the grid end "
                "where the body is loaded, or use load(particles, force)"
            )
        x, y = nodes[..., 0].ravel(), nodes[..., 1].ravel()
        values = [edges.evaluate(component, x, y, f"{traction}") for component in term.values]
        at_nodes = np.stack(values, axis=-1).reshape(nodes.shape)
        return domain.tractions.forces(edge, np.where(loaded[:, None, None], at_nodes, 0.0))

    def _cells(self, domain: Domain, traction: Traction) -> Mask:
        """Mask of the cells with particles along its edge that a traction loads."""
        part = edges.cells_between(self.grid, traction.edge, traction.between)
        mask: Mask = part[domain.tractions.cells(traction.edge)]
        return mask

    def accept(self, now: Moment) -> None:
        """Let later parts grow from this moment; drop loads that have faded."""
        super().accept(now)
        self._drop_faded()
        if self.unbalanced is not None:
            self.unbalanced = (1 - now.part) * self.unbalanced if now.part != 1.0 else None

    # -- header, identity, checkpoints ---------------------------------------

    @property
    def line(self) -> str:
        """The loads in words, for the header of a run."""
        lines = [load.line for load in self.all if load.released or not load.terms[-1].is_zero]
        if self.unbalanced is not None:
            lines.append("forces of removed particles or replaced laws until they fade")
        return listed(lines)

    def identity(self) -> list[Any]:
        """Facts that decide the results of a run, in the types of JSON."""
        return [[type(load).__name__, *load.place(), *load.identity()] for load in self.all]

    def state(self) -> dict[str, Any]:
        """Share of each load that the body carries, and the forces that fade."""
        unbalanced = np.zeros(0) if self.unbalanced is None else self.unbalanced
        return {"all": [load.state() for load in self.all], "unbalanced": unbalanced}

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, for the same loads.

        Raises:
            CheckpointError: The script has made others.
        """
        self.all = restored("load", self.all, state["all"])
        self.unbalanced = state["unbalanced"] if len(state["unbalanced"]) else None
        self.changed()
