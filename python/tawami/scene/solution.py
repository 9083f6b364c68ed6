"""What a step gives back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.process import Unique
from tawami.field.reduction import Reduction
from tawami.form.kinematics import KINEMATICS
from tawami.grid import edges
from tawami.grid.grid import EDGES, Edge
from tawami.particles import placement
from tawami.scene import description
from tawami.solve.newton import Converged, History

if TYPE_CHECKING:
    from tawami.scene.scene import Scene
    from tawami.scene.supports import Supports

Array = npt.NDArray[np.float64]


def supported_edges(supports: Supports) -> set[str]:
    """Names of the edges of the grid that supports or walls act on."""
    edges = {support.place for support in supports.all if isinstance(support.place, str)}
    return edges | {wall.edge for wall in supports.walls}


def supported_edge(place: str, edges: set[str]) -> Edge:
    """The edge of that name, one of those with supports.

    Raises:
        InputError: No such edge, or none with supports.
    """
    if place not in EDGES:
        raise InputError(f"reaction({checks.shown(place)}): expected one of {', '.join(EDGES)}")
    if place not in edges:
        raise InputError(
            f"reaction('{place}'): nothing supports that edge: expected one of "
            f"{', '.join(sorted(edges)) or 'none'}, or fix('{place}', ...) or wall('{place}') before"
        )
    return place


class Solution(description.Elsewhere, Unique):
    """Equilibrium of a scene, or the end of a step. On several ranks all of it is on every rank, and
    arrays of particles are in the order of their numbers.

    Attributes:
        scene: What was solved.
        u: Coefficients of the displacement [m], two per function, x fastest: since the start, and of
            the last step where strains are finite.
        unknowns: Number of reduced unknowns.
        iterations: Newton iterations of the last step.
        history: (momentum, volume) measures of every residual of the last step.
        krylov: FGMRES iterations of every linear solve of the last step; 0 where the tangent was
            factorised.
        number: Numbers of the particles in the body, ascending: all, unless some have left.
        x: Positions of the particles [m].
        volume: Their volumes [m2] at the start.
        stress: Their stress [Pa] (xx, yy, zz, xy), as it was when this was solved.
        displacement_of_particles: Their displacement [m] since the start.
        condition: Estimate of the condition number of the tangent last factorised, scaled: its
            Frobenius norm over the square root of its size, times that of its inverse as random
            vectors show it.
        symmetric: Whether that tangent was symmetric.
        on_edges: Forces of edges and walls on the body, functions x 2 [N per metre depth].
    """

    def __init__(
        self, scene: Scene, step: Converged, reduction: Reduction, coefficients: Array
    ) -> None:
        self.scene = scene
        self.u, self._volumetric = scene.split(coefficients)
        self.unknowns, self.iterations = reduction.size, step.iterations
        self.history: History = step.history
        self.krylov = tuple(step.krylov)
        self.condition, self.symmetric = step.condition, step.symmetric
        self._on_points: list[tuple[tuple[Any, ...], int, float]] = []
        self._reactions(step.forces, reduction)
        particles, comm = scene.particles, scene.grid.comm
        whole = placement.in_order(comm, particles.number)
        self.number = whole(particles.number)
        self.x, self.volume = whole(particles.x), whole(particles.volume)
        self.stress = whole(particles.stress)
        self.displacement_of_particles = whole(particles.displacement)
        mixed = scene.form.kinematics.has_eps_v
        self._eps_v = whole(particles.eps_v) if mixed else None

    @property
    def volumetric(self) -> Array:
        """Coefficients of eps_v, or of p [Pa].

        Raises:
            InputError: The form has neither.
        """
        return self._of_form("volumetric", self._volumetric, "volume_fields")

    @property
    def eps_v(self) -> Array:
        """Volumetric strain of the particles.

        Raises:
            InputError: The form does not have that field.
        """
        return self._of_form("eps_v", self._eps_v, "has_eps_v")

    def _of_form(self, name: str, values: Array | None, having: str) -> Array:
        if values is None:
            form = self.scene.form
            kinematics = [k.name for k in KINEMATICS.values() if getattr(k, having)]
            raise InputError(
                f"{name}: form {form.name} does not have it: expected a form with the kinematics "
                f"{' or '.join(map(repr, kinematics))}, as form='{form.strain.mixed_form}'"
            )
        return values

    def displacement(self, point: Sequence[float]) -> Array:
        """Displacement (u_x, u_y) [m] of the grid at a point.

        Raises:
            InputError: The point is outside the grid.
        """
        location = edges.locate_point(self.scene.grid, point, "displacement(...)")
        value = _rust.interpolate(location, self.scene.basis, 2, self.u)[0]
        return np.asarray(value)

    def reaction(self, place: str | Sequence[float]) -> Array:
        """Force (x, y) [N per metre depth] that a support or wall exerts on the body.

        Args:
            place: Name of an edge of the grid: the sum over the functions along it, so that what acts
                at a corner belongs to both its edges; or the point (x, y) of a `hold` [m], as it was
                given or where it is now. In dynamics it is the force at the end of the step and the
                impulse at its beginning over its length.

        Raises:
            InputError: No such edge or nothing that supports it, or no point held there.
        """
        if isinstance(place, str):
            edge = supported_edge(place, self._edges)
            functions = edges.edge_functions(self.scene.grid, self.scene.basis, edge)
            return np.asarray(self.on_edges[functions].sum(axis=0))
        place = checks.point("reaction(...)", place)
        force, found = np.zeros(2), False
        for places, component, multiplier in self._on_points:
            near = 1e-8 * self.scene.grid.h
            if any(np.abs(np.subtract(place, known)).max() <= near for known in places):
                force[component] += multiplier
                found = True
        if not found:
            raise InputError(f"reaction({tuple(place)}): no point is held there")
        return force

    @property
    def on_points(self) -> list[tuple[tuple[float, float], Array]]:
        """Where each point is held (x, y) [m], as the step began, and its force [N per metre depth]."""
        return [
            (places[-1], force * np.eye(2)[component])
            for places, component, force in self._on_points
        ]

    def _reactions(self, forces: Array, reduction: Reduction) -> None:
        """What supports give: of the points by their multipliers, the rest of the edges and walls.

        Args:
            forces: What is out of balance without them on all coefficients.
            reduction: What they leave free.
        """
        n = len(self.u)
        scene, points = self.scene, reduction.points
        self._edges = supported_edges(scene.supports)
        rest = forces[:n].copy()
        if points:
            weights = np.zeros((n, len(points)))
            for k, point in enumerate(points):
                weights[point.indices, k] = point.weights
            loose = ~reduction.fixed[:n]
            multipliers = np.linalg.lstsq(weights[loose], rest[loose], rcond=None)[0]
            rest -= weights @ multipliers
            supports = [s for s in scene.supports.all if not isinstance(s.place, str)]
            for point, support, multiplier in zip(points, supports, multipliers, strict=True):
                places = (support.given, support.place, point.place)
                self._on_points.append((places, support.component, float(multiplier)))
        held = np.where(reduction.fixed[:n], rest, 0.0).reshape(-1, 2)
        self.on_edges = held + scene.supports.friction(forces[:n].reshape(-1, 2))

    @property
    def mean_stress(self) -> Array:
        """Mean stress [Pa] at the particles, (xx + yy + zz)/3, tension positive."""
        return np.asarray(self.stress[:, :3].mean(axis=1))
