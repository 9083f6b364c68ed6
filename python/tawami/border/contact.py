"""Contact of a border with a rigid obstacle: pressure and Coulomb friction on patches.

On a patch the contact law relates means over its points, weighted with their areas w (Wriggers 2006,
sections 5.2 and 5.3; Simo and Laursen 1992 for the augmented form):

    pressure   p = [lambda - r g]+ ,                       g = mean distance from the obstacle
    friction   T = T0 - r s , |T| <= mu p ,                s = mean of t . (slip since the step began)
    forces     f = w (p n + T t)                           on each point

n is the outward normal of the obstacle at the point and t a tangent. The slip is measured in the frame
that moves with the obstacle, so rigid motions of both leave all values unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Indices, Mask, of_components
from tawami.base.checks import LEAST
from tawami.border.patches import Patches
from tawami.border.rigid import Pose, generators
from tawami.border.shapes import Distance, Shape

#: States of a patch.
OPEN, STICKING, SLIDING = 0, 1, 2


@dataclass(frozen=True)
class Multipliers:
    """Pressure and friction from which a solution starts.

    Attributes:
        pressure: lambda of each patch [Pa].
        traction: T0 of each patch [Pa], along the tangents, patches x (dim - 1).
    """

    pressure: Array
    traction: Array

    @classmethod
    def zero(cls, count: int, dim: int) -> Multipliers:
        """Those of patches that have not touched the obstacle."""
        return cls(np.zeros(count), np.zeros((count, dim - 1)))


@dataclass(frozen=True)
class Contact:
    """Contact of the patches of a border with one obstacle during one step.

    Attributes:
        shape: The obstacle.
        patches: Patches of the points.
        weights: Area of each point [m2]: its length in plane strain. It is constant in the step.
        friction: Coefficient of friction: 0 for a smooth obstacle, infinite for one without sliding.
        penalty: r of each patch [Pa/m], about 200 mu / h.
        start: Positions at the start of the step in the frame of the obstacle, `pose.to_local(x)`.
        least: Mean distance at which each patch touches [m]: 0, or negative for one that may stay
            inside the obstacle where it is.
        stays: Which patches cannot leave the obstacle, and may pull; False for none.
    """

    shape: Shape
    patches: Patches
    weights: Array
    friction: float
    penalty: Array
    start: Array
    least: Array | float = 0.0
    stays: Mask | bool = False

    @cached_property
    def areas(self) -> Array:
        """Area of each patch [m2]."""
        return self.patches.sums(self.weights)

    @cached_property
    def shares(self) -> Array:
        """Share of each point in the area of its patch."""
        return np.asarray(self.weights / self.areas[self.patches.number])

    def _means(self, values: Array) -> Array:
        return self.patches.sums((values.T * self.shares).T)

    def evaluate(
        self,
        x: Array,
        pose: Pose,
        held: Multipliers,
        *,
        sticking: bool | ContactForces = False,
        tied: bool = False,
    ) -> ContactForces:
        """Pressures, friction and forces at present positions.

        Args:
            x: Positions [m], points x dim.
            pose: Pose of the obstacle.
            held: Multipliers: at first those of the last step, later those of an earlier evaluation,
                `ContactForces.multipliers`.
            sticking: Take all touching patches as sticking; or the last evaluation: take those as
                sticking whose friction would turn round. It prevents cycles between states in Newton's
                method; without friction it has no effect.
            tied: Take all patches whose held pressure is positive as touching, even if they pull.
        """
        local = pose.to_local(x)
        surface = _turned(self.shape.evaluate(local), pose.rotation)
        moved = (local - self.start) @ pose.rotation.T
        tangent, turning = tangents(surface)
        gap = self._means(surface.distance) - self.least
        pressure = held.pressure - self.penalty * gap
        touching = ((held.pressure > 0) if tied else (pressure > 0)) | self.stays
        pressure[~touching] = 0.0
        slip = self._means(np.einsum("jka,ja->jk", tangent, moved))
        trial = held.traction - self.penalty[:, None] * slip
        size, limit = np.linalg.norm(trial, axis=1), np.zeros_like(pressure)
        if self.friction > 0:
            sticks = touching if np.isinf(self.friction) else pressure > 0
            limit[sticks] = self.friction * np.maximum(pressure[sticks], LEAST)
        bound = limit.copy()
        if self.friction > 0:
            if isinstance(sticking, ContactForces):
                turned = np.einsum("ak,ak->a", trial, sticking.traction) < 0
                limit[touching & turned & (sticking.state == SLIDING)] = np.inf
            elif sticking:
                limit[touching] = np.inf
        stuck = touching & (size < limit)
        scale = stuck.astype(float)  # ratio of the friction to the trial
        np.divide(limit, size, out=scale, where=~stuck & (size > 0))
        return ContactForces(
            contact=self, pose=pose, x=x, surface=surface, tangent=tangent,
            slip_gradient=tangent + np.einsum("jkab,ja->jkb", turning, moved), turning=turning,
            gap=gap, slip=slip, trial=trial, scale=scale, pressure=pressure,
            traction=scale[:, None] * trial, held=held,
            state=np.where(stuck, STICKING, np.where(touching, SLIDING, OPEN)),
            exceeded=bool((stuck & (size > bound)).any()),
        )  # fmt: skip


@dataclass(frozen=True)
class ContactForces:
    """Contact of one evaluation.

    Attributes:
        contact: The contact.
        pose: Pose of the obstacle.
        x: Positions [m], points x dim.
        surface: Distances, normals and curvatures of the obstacle at the points.
        tangent: Tangents, points x (dim - 1) x dim.
        turning: Derivatives of the tangents by the position [1/m], points x (dim - 1) x dim x dim.
        slip_gradient: Derivative of the slip of a point by its position, points x (dim - 1) x dim.
        gap: Mean distance of each patch, less the least one [m].
        slip: Mean slip of each patch since the step began [m], patches x (dim - 1).
        trial: Friction if the patch stuck [Pa], patches x (dim - 1).
        scale: Ratio of the friction to the trial.
        pressure: Pressure of each patch [Pa].
        traction: Friction of each patch along the tangents [Pa], patches x (dim - 1).
        held: Multipliers of the evaluation.
        state: `OPEN`, `STICKING` or `SLIDING` for each patch.
        exceeded: Whether the friction of a patch that was taken as sticking is larger than mu p.
        bends: Whether derivatives count the change of normals and tangents along the obstacle. They are
            exact with it. Without, the stiffness of pressures alone is never negative, and Newton's
            method takes no steps along a border whose patches still change between open and closed.
    """

    contact: Contact
    pose: Pose
    x: Array
    surface: Distance
    tangent: Array
    turning: Array
    slip_gradient: Array
    gap: Array
    slip: Array
    trial: Array
    scale: Array
    pressure: Array
    traction: Array
    held: Multipliers
    state: Indices
    exceeded: bool
    bends: bool = True

    @cached_property
    def forces(self) -> Array:
        """Forces of the obstacle on the points [N per m], points x dim."""
        number, weights = self.contact.patches.number, self.contact.weights[:, None]
        normal = self.pressure[number, None] * self.surface.normal
        along = np.einsum("jk,jka->ja", self.traction[number], self.tangent)
        return np.asarray(weights * (normal + along))

    @property
    def resultant(self) -> Array:
        """Forces on the obstacle [N per m], then the moment about its centre [N m per m]."""
        return -self.pose.resultant(self.x, self.forces)

    @property
    def multipliers(self) -> Multipliers:
        """The multipliers of the next augmented pass, or of the next step."""
        pressure = np.where(self.contact.stays, self.pressure, np.maximum(self.pressure, 0.0))
        return Multipliers(pressure, self.traction)

    @property
    def penetration(self) -> float:
        """Largest mean penetration of a patch [m]."""
        return float(np.max(-(self.gap + self.contact.least), initial=0.0))

    @property
    def violation(self) -> float:
        """Largest gap of a loaded patch, penetration, or slip of a sticking patch [m].

        It is zero if pressure and friction solve the contact problem without penalty.
        """
        held, penalty = self.held, self.contact.penalty
        normal = np.abs(self.pressure - held.pressure) / penalty
        change = np.linalg.norm(self.slip, axis=1) * (self.state == STICKING)
        return float(max(np.max(normal, initial=0.0), np.max(change, initial=0.0)))

    @property
    def dissipation(self) -> Array:
        """Energy that friction dissipates on each patch in the step [J per m], never negative.

        It is the work of the friction on the slip that the penalty does not give back.
        """
        contact = self.contact
        sliding = (self.trial - self.traction) / contact.penalty[:, None]
        work = np.einsum("ak,ak->a", self.traction, sliding)
        return np.asarray(contact.areas * work)

    @cached_property
    def derivatives(self) -> Array:
        """Derivatives of the forces on the points of each patch by their positions [N/m per m]: patches
        x points x dim x points x dim, of the points in the order of `Patches.table`.

        They are symmetric without friction.
        """
        contact = self.contact
        points, inside = contact.patches.table
        loaded = self.state != OPEN
        weights = contact.weights[points] * (inside * loaded[:, None])
        shares = contact.shares[points] * inside
        by_gap, by_slip = self._law()
        gap, slips = self._weighted(shares, self.surface.normal, self.slip_gradient)
        normal, tangent = self._weighted(weights, self.surface.normal, self.tangent)
        rows = [normal, *tangent]
        columns = [-contact.penalty[:, None, None] * gap]
        for k in range(len(slips)):
            change = by_gap[:, k, None, None] * gap
            columns.append(
                sum((by_slip[:, k, m, None, None] * slip for m, slip in enumerate(slips)), change)
            )
        total = np.einsum("ckja,ckib->cjaib", np.stack(rows, axis=1), np.stack(columns, axis=1))
        if self.bends and self.surface.curvature.any():
            number = contact.patches.number
            bent = self.pressure[number, None, None] * self.surface.curvature
            bent += np.einsum("jk,jkab->jab", self.traction[number], self.turning)
            place = np.arange(points.shape[1])
            total[:, place, :, place] += (weights[..., None, None] * bent[points]).swapaxes(0, 1)
        return np.asarray(total)

    def _weighted(self, weights: Array, first: Array, others: Array) -> tuple[Array, list[Array]]:
        """Vectors at the points of each patch times weights, patches x points x dim."""
        points = self.contact.patches.table[0]
        vectors = [first, *others.swapaxes(0, 1)]
        found = [weights[..., None] * vector[points] for vector in vectors]
        return found[0], found[1:]

    @cached_property
    def derivative(self) -> sp.csr_matrix:
        """The same as a matrix: the components of the first point, then of the second, and so on."""
        points, _ = self.contact.patches.table
        index = of_components(points, self.x.shape[1])
        rows, columns = np.broadcast_arrays(index[:, :, :, None, None], index[:, None, None, :, :])
        entries = (self.derivatives.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_matrix(entries, shape=(self.x.size, self.x.size))

    @cached_property
    def by_motion(self) -> Array:
        """Derivative of the forces by the motion of the obstacle, points dim x motions.

        A motion of obstacle and points together turns the forces and changes nothing else.
        """
        return np.asarray(self._turned_forces - self.derivative @ self._modes)

    @property
    def resultant_by_positions(self) -> Array:
        """Derivative of :attr:`resultant` by the positions of all points, motions x points dim."""
        return np.asarray(self._turned_forces.T - (self.derivative.T @ self._modes).T)

    @property
    def resultant_by_motion(self) -> Array:
        """Derivative of :attr:`resultant` by the motion of the obstacle, motions x motions."""
        change, dim = -self._modes.T @ self.by_motion, self.x.shape[1]
        change[dim:, :dim] -= generators(dim) @ self.forces.sum(axis=0)
        return np.asarray(change)

    @property
    def _modes(self) -> Array:
        modes = self.pose.modes(self.x)
        return modes.reshape(self.x.size, modes.shape[2])

    @property
    def _turned_forces(self) -> Array:
        """Change of forces that turn with the obstacle, points dim x motions."""
        num, dim = self.x.shape
        turned = np.einsum("kab,jb->jak", generators(dim), self.forces)
        fixed = np.zeros((num, dim, dim))
        both = np.concatenate([fixed, turned], axis=2)
        return np.asarray(both.reshape(num * dim, both.shape[2]))

    def _law(self) -> tuple[Array, Array]:
        """Derivatives of the friction by the gap and by the slip, for each patch.

        Sticking: dT = -r ds. Sliding, with e the direction of the trial T* and y = mu p:
        dT = mu dp e - r y / |T*| (1 - e e^T) ds.
        """
        contact, size = self.contact, np.linalg.norm(self.trial, axis=1)[:, None]
        direction = np.divide(self.trial, size, out=np.zeros_like(self.trial), where=size > 0)
        sliding, minus_r = self.state == SLIDING, -contact.penalty
        by_gap, num = np.zeros_like(self.trial), self.trial.shape[1]
        if contact.friction > 0:
            by_gap[sliding] = contact.friction * (minus_r[:, None] * direction)[sliding]
        along = np.where(sliding, 1.0, 0.0)[:, None, None]
        across = np.eye(num) - along * direction[:, :, None] * direction[:, None, :]
        return by_gap, (minus_r * self.scale)[:, None, None] * across


def tangents(surface: Distance) -> tuple[Array, Array]:
    """Unit tangents and their derivatives by the position.

    In the plane the tangent is the normal turned by a right angle. A surface in space needs two, which
    this function does not have.

    Returns:
        Tangents, points x (dim - 1) x dim, and derivatives, points x (dim - 1) x dim x dim.
    """
    (turn,) = generators(2)
    turned = np.asarray(turn @ surface.curvature)
    return (surface.normal @ turn.T)[:, None], turned[:, None]


def _turned(local: Distance, rotation: Array) -> Distance:
    """Distances in the frame of the obstacle as distances in space."""
    curvature = rotation @ local.curvature @ rotation.T
    return Distance(local.distance, local.normal @ rotation.T, curvature)
