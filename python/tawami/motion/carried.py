"""Velocities and accelerations of the particles in a motion, and their transfer to the grid and back.

At small strain particles do not move: velocity and acceleration stay on the grid.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami.base import ranks
from tawami.base.archive import check_like
from tawami.base.arrays import Array
from tawami.base.shared_file import picked
from tawami.motion.transfer import Transfer, gradient_of, to_grid
from tawami.step.configuration import Configuration

#: Arrays of the particles, with the rank of their values: vectors and tensors.
ARRAYS = {"velocity": 1, "acceleration": 1, "velocity_gradient": 2, "acceleration_gradient": 2}


class Carried:
    """Velocities and accelerations of the particles of a scene.

    Args:
        configuration: The body.
        transfer: Transfer of velocities.
        damping: Time in which velocities of FLIP relax towards those of PIC [s].
    """

    def __init__(self, configuration: Configuration, transfer: Transfer, damping: float) -> None:
        self._now, self.transfer, self.damping = configuration, transfer, damping
        particles = configuration.domain.particles
        self._space = configuration.model.space
        for name, rank in ARRAYS.items():
            particles.carry(name, self._space.dim**rank)
            particles.carried(name)[:] = 0.0
        #: v and a of a grid that stays (functions x dim), and velocities and numbers of its particles.
        self._stationary: tuple[Array, Array, Array, Array] | None = None

    @property
    def velocity(self) -> Array:
        """v_p [m/s], a view: particles x dim."""
        return self._view("velocity")

    @property
    def acceleration(self) -> Array:
        """a_p [m/s2], a view: particles x dim."""
        return self._view("acceleration")

    @property
    def velocity_gradient(self) -> Array:
        """C_p [1/s], a view: particles x dim x dim."""
        return self._space.tensors(self._view("velocity_gradient"))

    @property
    def acceleration_gradient(self) -> Array:
        """Gradient of the acceleration [1/s2], a view: particles x dim x dim."""
        return self._space.tensors(self._view("acceleration_gradient"))

    def _view(self, name: str) -> Array:
        return self._now.domain.particles.carried(name)

    @property
    def on_grid(self) -> tuple[Array, Array] | None:
        """v and a of a grid that stays, functions x dim; None once velocities were written."""
        if self._stationary is None:
            return None
        v, a, given, number = self._stationary
        given = given[np.isin(number, self._now.domain.particles.number)]  # some may be removed
        written = np.array([not np.array_equal(given, self.velocity)])
        return None if ranks.any_of(self._now.model.grid.comm, written)[0] else (v, a)

    def mapped(self, mass: Array) -> tuple[Array, Array]:
        """v and a of the grid at the start of a step, functions x dim.

        Args:
            mass: Lumped mass of each function [kg per metre depth].
        """
        stationary = self.on_grid
        if stationary is not None:
            return stationary
        domain = self._now.domain
        fields = (
            (self.velocity, self.velocity_gradient),
            (self.acceleration, self.acceleration_gradient),
        )
        v, a = (divided(sums, mass[:, None]) for sums in to_grid(domain, domain.mass, fields))
        return v, a

    def at_end(self, u: Array, before: Array, v1: Array, a1: Array, dt: float) -> dict[str, Array]:
        """The arrays of the particles at the end of a step, by name.

        Args:
            u: Increments of the displacement, functions x dim [m].
            before: Velocity of the grid as mapped from the particles.
            v1, a1: Velocity and acceleration of the grid at the end of the step.
            dt: Length of the step [s].
        """
        domain = self._now.domain
        velocity = pic = domain.at_particles(v1)
        if self.transfer.flip and self._now.model.moves:
            flip = self.velocity + domain.at_particles(v1 - before)
            velocity = pic + np.exp(-dt / self.damping) * (flip - pic)
        back = np.linalg.inv(np.eye(self._space.dim) + domain.gradients(u))
        return {
            "velocity": velocity,
            "acceleration": domain.at_particles(a1),
            "velocity_gradient": gradient_of(self.transfer, domain, v1, back),
            "acceleration_gradient": gradient_of(self.transfer, domain, a1, back),
        }

    def store(self, arrays: Mapping[str, Array], v1: Array, a1: Array) -> None:
        """Store the arrays of :meth:`at_end`, and v and a where the grid stays."""
        for name, values in arrays.items():
            array = self._view(name)
            array[:] = values.reshape(array.shape)
        if not self._now.model.moves:
            self._stationary = v1, a1, *self._given()

    def state(self) -> dict[str, Any]:
        """The part of the state that is not in the particles, for a checkpoint."""
        stationary = self.on_grid
        if stationary is None:
            return {"on_grid": None}
        owned = self._now.domain.layout.owned
        return {"on_grid": [owned(v.ravel()).rows for v in stationary]}

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`, after the particles were restored.

        Raises:
            ValueError: v and a do not belong to the grid.
        """
        on_grid, layout = state["on_grid"], self._now.domain.layout
        if on_grid is not None:
            if [np.shape(values) for values in on_grid] != [(layout.num_displacement_of_grid,)] * 2:
                raise ValueError("v and a of the grid have another number of functions")
            check_like(on_grid, [np.zeros(1)] * 2, "v and a of the grid")
        self._stationary = None
        if on_grid is not None:
            wanted = layout.in_grid[: layout.num_displacement]
            v, a = (picked(layout.grid.comm, values, wanted) for values in on_grid)
            vectors = self._space.vectors
            self._stationary = vectors(v), vectors(a), *self._given()

    def _given(self) -> tuple[Array, Array]:
        """Copies of the velocities and numbers of the particles."""
        return np.array(self.velocity), np.array(self._now.domain.particles.number)


def divided(sums: Array, weights: Array) -> Array:
    """Means from weighted sums; 0 for functions without particles."""
    return np.asarray(np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0))
