"""Contact of the border with one obstacle in one step (`tawami.solve.terms`).

Pressure and friction act on means over patches (`tawami.border.contact`) with a penalty of 200 mu/h, and
of 40 rho h/dt^2 more in dynamics, in passes with better multipliers until penetration and slip of
sticking patches are below 1e-3 of those of the penalty alone: below 5e-6 h times the largest pressure
over mu.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import SupportError
from tawami.border.contact import OPEN, Contact, ContactForces, Multipliers
from tawami.border.rigid import Pose
from tawami.conditions.contact_result import ContactResult
from tawami.conditions.contact_states import ContactStates
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.obstacle_motion import ObstacleMotion
from tawami.domain.domain import Domain
from tawami.domain.near_border import BorderNear
from tawami.field.constraints import PointHeld
from tawami.solve.bordered import Blocks, GivesWayError

#: Penetration, relative to that of the penalty alone, below which no other pass is needed; and the
#: penetration that is round-off [cells].
SETTLED, ROUND_OFF = 1e-3, 1e-9
#: Distance of patches that are evaluated from the start of a step on [cells].
REACH = 1.0
#: Distance at which a patch touches at the start of a static step, and at which the nearest patch does
#: if no other touches [cells].
TOUCHING, ALMOST = 1e-6, 0.1
#: A motion is held by nothing if its stiffness is below this, relative to that of the penalty.
UNHELD = 1e-12


class ObstacleContact:
    """Contact with one obstacle in one step.

    Args:
        domain: The particles at its start.
        obstacle: The obstacle.
        motion: Its motion in the step.
        before: Displacement coefficients since the start where particles do not move, else 0.
    """

    first_work = 0.0

    def __init__(
        self, domain: Domain, obstacle: Obstacle, motion: ObstacleMotion, before: Array
    ) -> None:
        self.obstacle, self.motion = obstacle, motion
        self._dim, self._layout = domain.model.space.dim, domain.layout
        self._border = BorderNear(
            domain, obstacle.place, obstacle.shape, motion.start, before,
            motion.slope / motion.factor, obstacle.groups,
        )  # fmt: skip
        groups, weights = self._border.groups, self._border.weights
        self._pressure = groups.means(weights, obstacle.pressure)
        self._traction = groups.means(weights, obstacle.traction)
        gap = groups.means(weights, self._border.distance)
        self._least = self._offsets(gap)
        self._stays = (self._pressure != 0) | (gap < TOUCHING * self._border.h)
        self._stays &= not obstacle.separates
        if motion.times is not None:
            # what pushed such a patch out would give energy to the body
            self._least = np.minimum(gap, self._least)
        reach = REACH * self._border.h + np.abs(motion.unknown[: self._dim]).max(initial=0.0)
        pressed = ((self._pressure != 0) | self._stays)[groups.number]
        self._choose((self._border.distance < reach) | pressed)
        self.at_start = self._forces_at_start()
        if motion.times is None:
            self._touch(gap)

    def _offsets(self, gap: Array) -> Array:
        """Mean distances of patches that touch.

        That of a patch of a bent border is not zero when it touches. A new patch that lies where others
        pushed before touches where it is, unless it is inside the obstacle. Otherwise it would lose
        contact, and the force would drop.
        """
        near, obstacle = self._border, self.obstacle
        if near.groups is obstacle.groups:
            return near.groups.means(near.weights, obstacle.offset)
        return np.where(self._pressure != 0, np.maximum(gap, 0.0), 0.0)

    def _choose(self, points: Mask) -> None:
        """Evaluate the patches of further points from now on."""
        near = self._border
        near.choose(points)
        self._contact = Contact(
            self.obstacle.shape, near.patches, near.weights[near.points], self.obstacle.friction,
            near.penalty[near.chosen], near.start[near.points], self._least[near.chosen],
            self._stays[near.chosen],
        )  # fmt: skip

    def _touch(self, gap: Array) -> None:
        """Let patches that touch in statics push from the first evaluation on.

        If none does, the nearest does that is almost there, as at the apex of a curved border.
        """
        near, h = self._border, self._border.h
        nearest = float(gap.min())
        reach = max(nearest, 0.0) if nearest < ALMOST * h and not self._pressure.any() else 0.0
        new = (np.abs(gap) < reach + TOUCHING * h) & (self._pressure == 0)
        self._pressure[new] = (near.penalty * (np.maximum(gap, 0.0) + ROUND_OFF * h))[new]

    @property
    def _held(self) -> Multipliers:
        chosen = self._border.chosen
        return Multipliers(self._pressure[chosen], self._traction[chosen])

    # -- forces, see `Term` --------------------------------------------------

    @property
    def prescribed(self) -> float:
        """The largest displacement that the obstacle prescribes in this step [m]."""
        return float(np.abs(self.motion.change[: self._dim]).max(initial=0.0))

    def restart(self) -> None:
        """See `Term`."""
        self.motion.restart()
        self._states = ContactStates()

    def forces(self, coefficients: Array) -> Array:
        """See `Term`: in dynamics with the factors of both ends of the step."""
        pose, x = self.motion.pose, self._border.positions(coefficients)
        reached = self._border.reached(pose.to_local(x))
        if reached.any():
            self._choose(reached)
        x = x[self._border.points]
        self.now: ContactForces = self._contact.evaluate(
            x, pose, self._held, sticking=self._states.sticking(len(x))
        )
        self._pulls = self._is_loose and bool(self._held.pressure.any())
        if self._pulls:  # otherwise nothing would bring it back
            self.now = self._contact.evaluate(x, pose, self._held, sticking=True, tied=True)
        self.at_end = self._border.on_all(self.now.forces)
        factor = self.motion.factor
        return np.asarray(factor * self.at_end - (factor - 1) * self.at_start[0])

    @property
    def _is_loose(self) -> bool:
        """Whether it is free and away from the body in statics, where only contact holds it."""
        is_held = self.motion.times is not None or not self.motion.free.any()
        return not is_held and bool((self.now.state == OPEN).all())

    def _forces_at_start(self) -> tuple[Array, Array]:
        """Forces at the start of the step: of this rank on all coefficients, and on the obstacle."""
        x, held = self._border.x[self._border.points], self._held
        now = self._contact.evaluate(x, self.motion.start, held)
        now = replace(now, pressure=held.pressure, traction=held.traction)
        return self._border.on_all(now.forces), now.resultant

    @property
    def far(self) -> Indices:
        """See `ContactTerm`."""
        return self._border.far

    def stiffness(self, far: Indices) -> sp.csr_matrix:
        """See `Term`. Its entries are in the same places as long as no patch comes near."""
        self.now = self._states.linearised(self.now)
        return self._border.on_coefficients(-self.motion.factor * self.now.derivatives, far)

    def improve(self) -> bool:
        """See `ContactTerm`."""
        now, penalty = self.now, self._contact.penalty
        allowed = SETTLED * np.max(np.abs(now.pressure) / penalty, initial=0.0)
        settled = now.violation <= max(allowed, ROUND_OFF * self._border.h)
        if settled and not now.exceeded and not self._pulls:
            return False
        if not settled or self._pulls:
            held = now.multipliers
            self._pressure[self._border.chosen] = held.pressure
            self._traction[self._border.chosen] = held.traction
        return True

    @property
    def unsettled(self) -> str:
        """See `ContactTerm`."""
        return (
            f"{self.obstacle}: contact and friction do not settle in this step: the penetration or the "
            f"slip of a patch is still off by {self.now.violation:.3g} m: expected shorter steps"
        )

    def accept(self) -> None:
        """Keep pressures, friction and pose for later steps."""
        obstacle = self.obstacle
        obstacle.groups = self._border.groups
        pressure, traction = self.pressures
        obstacle.pressure, obstacle.traction = pressure, traction
        obstacle.offset = np.where(pressure != 0, self._least[self._border.groups.number], 0.0)
        obstacle.pose = self.motion.pose
        obstacle.rates = self.motion.rates_at_end(self.at_start[1], self.now.resultant)

    @property
    def pressures(self) -> tuple[Array, Array]:
        """Pressure and friction at all points [Pa]."""
        number, points = self._contact.patches.number, self._border.points
        pressure = np.zeros(len(self._border.x))
        traction = np.zeros((len(self._border.x), self._dim - 1))
        pressure[points], traction[points] = self.now.pressure[number], self.now.traction[number]
        return pressure, traction

    def result(self) -> ContactResult:
        """The contact at the last forces."""
        now, dim = self.now, self._dim
        pressure, traction = self.pressures
        x = self._border.x.copy()
        x[self._border.points] = now.x
        return ContactResult(
            self.obstacle.name, now.resultant[:dim], now.resultant[dim:], self.pose.position, x,
            pressure, traction, now.penetration,
        )  # fmt: skip

    @property
    def jump(self) -> Array:
        """Contact forces of this rank at the end of a dynamic step, less those at its start."""
        return np.asarray(self.at_end - self.at_start[0])

    @property
    def pose(self) -> Pose:
        """Present pose of the obstacle."""
        return self.motion.pose

    def energies(self, u: Array) -> tuple[float, float, float]:
        """Work on body and obstacle from outside, dissipation by friction, and loss by impact.

        A call for all ranks.

        Args:
            u: Increments of the displacement.
        """
        q, free, resultant = self.motion.unknown, self.motion.free, self.now.resultant
        external = float(self.motion.force[free] @ q[free] - resultant[~free] @ q[~free])
        friction = float(self.now.dissipation.sum())
        on_body = ranks.total(self._layout.grid.comm, float(self.at_end[: u.size] @ u.ravel()))
        return external, friction, -on_body - float(resultant @ q) - friction

    # -- unknowns of its own, see `tawami.solve.bordered` ---------------------

    @property
    def num_unknowns(self) -> int:
        """Number of its free motions."""
        return int(self.motion.free.sum())

    @property
    def residual(self) -> Array:
        """Forces out of balance in its free motions."""
        return sum(self._parts, np.zeros(self.num_unknowns))

    @property
    def _parts(self) -> list[Array]:
        return self.motion.parts(self.at_start[1], self.now.resultant)

    @property
    def measure(self) -> float:
        """Residual of each free motion relative to the largest force or moment, the largest of these."""
        moves = np.flatnonzero(self.motion.free) < self._dim
        sizes = np.maximum(np.abs(self._parts).max(axis=0), self.motion.round_off)
        force = max(np.abs(self.now.forces).sum(), sizes[moves].max(initial=0.0))
        sizes = np.maximum(sizes, np.where(moves, force, force * self._border.h))
        shares = np.divide(np.abs(self.residual), sizes, out=np.zeros_like(sizes), where=sizes > 0)
        return float(shares.max(initial=0.0))

    def blocks(self) -> Blocks:
        """Derivatives of the equations of body and obstacle by each other's unknowns."""
        free, factor, now = self.motion.free, self.motion.factor, self.now
        transposed = self._border.at_points.csr.T
        of_body = -factor * (transposed @ now.by_motion[:, free])
        by_body = -factor * (transposed @ now.resultant_by_positions[free].T).T
        own = self.motion.stiffness - factor * now.resultant_by_motion[np.ix_(free, free)]
        return Blocks(of_body, by_body, own)

    def add(self, change: Array) -> None:
        """Go to the next iterate of its free motions."""
        self.first_work = float(self.residual @ change)
        self.motion.add(change)

    def shorten(self, share: float) -> None:
        """Take a share of the last change of its free motions."""
        self.motion.shorten(share)

    @property
    def work(self) -> float:
        """Work of its residual on the last change."""
        return float(self.residual @ self.motion.last_change)

    def check_held(self, matrix: Array) -> None:
        """Check that its motions are held in statics.

        Args:
            matrix: Stiffness of its free motions, with that of the body.

        Raises:
            SupportError: One is free, as the obstacle does not touch the body, or slides.
            GivesWayError: The body gives way to it after the first iteration.
        """
        if self.motion.times is not None:
            return
        arm = np.linalg.norm(
            self._border.x[self._border.points] - self.motion.pose.position, axis=1
        )
        stiffness = float(self._border.penalty.max(initial=0.0)) * float(self._border.weights.max())
        motions = np.flatnonzero(self.motion.free)
        scale = np.where(motions < self._dim, 1.0, max(arm.max(initial=0.0), self._border.h))
        scaled = matrix / (stiffness * np.outer(scale, scale))
        _, sizes, directions = np.linalg.svd(scaled)
        if sizes[-1] > UNHELD:
            return
        weakest = motions[int(np.argmax(np.abs(directions[-1])))]
        motion, away = self.obstacle.motions[weakest], bool((self.now.state == OPEN).all())
        if not away and self._states.tangents > 1:
            raise GivesWayError(f"{self.obstacle}: the body gives way to its motion '{motion}'")
        state = "does not touch the body" if away else "slides freely"
        raise SupportError(
            f"{self.obstacle}: nothing holds its motion '{motion}', as it {state}: expected an obstacle "
            "in contact, or free=... without this motion"
        )

    @property
    def rows(self) -> list[PointHeld]:
        """Means over patches that push, as constraints that find rigid motions in statics.

        A call for all ranks.
        """
        if self.motion.free.any():
            return []
        now = self._contact.evaluate(
            self._border.x[self._border.points], self.motion.pose, self._held
        )
        rows, directions = [], [now.surface.normal]
        if self.obstacle.friction > 0:
            directions += list(now.tangent.transpose(1, 0, 2))
        shares, (at_points, number) = now.contact.shares, self._border.at_points_on_all
        for k in np.flatnonzero(now.pressure):
            mine = now.contact.patches.number == k
            x, y = now.x[mine][0]
            for direction in directions:
                along = (mine * shares)[:, None] * direction
                weights = at_points.transposed_times(along.ravel())
                some = np.flatnonzero(weights)
                of = number[some], weights[some], 0.0, f"{self.obstacle}", (x, y)
                rows.append(PointHeld(*of))
        return rows
