"""Motion of a rigid obstacle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import expm

from tawami.base.arrays import Array


@lru_cache
def generators(dim: int) -> Array:
    """Velocities of points at x of the unit rotations, as matrices on x: rotations x dim x dim.

    In the plane this is the rotation from x to y.
    """
    pairs = [(i, j) for i in range(dim) for j in range(i + 1, dim)]
    spins = np.zeros((len(pairs), dim, dim))
    for spin, (i, j) in zip(spins, pairs, strict=True):
        spin[j, i], spin[i, j] = 1.0, -1.0
    return spins


def num_modes(dim: int) -> int:
    """Number of rigid motions: translations, then rotations."""
    return dim + len(generators(dim))


def modes(x: Array, centre: Array) -> Array:
    """Displacements of points in the rigid motions: translations, then rotations about a centre.

    Args:
        x: Positions [m], points x dim.
        centre: The centre of rotation [m].

    Returns:
        Points x dim x motions.
    """
    num, dim = x.shape
    translations = np.broadcast_to(np.eye(dim), (num, dim, dim))
    rotations = np.einsum("kab,jb->jak", generators(dim), x - centre)
    return np.concatenate([translations, rotations], axis=2)


@dataclass(frozen=True)
class Pose:
    """Place and direction of a rigid obstacle, relative to those in which its shape is described.

    Attributes:
        centre: Its centre where the shape is described [m].
        translation: Displacement of the centre [m].
        turn: Rotation about the centre [rad], one number in the plane, counterclockwise.
    """

    centre: Array
    translation: Array
    turn: Array

    @classmethod
    def at(cls, centre: Array) -> Pose:
        """The pose in which the shape is described."""
        dim = len(centre)
        return cls(np.asarray(centre, dtype=float), np.zeros(dim), np.zeros(num_modes(dim) - dim))

    @property
    def position(self) -> Array:
        """Present position of the centre [m]."""
        return self.centre + self.translation

    @property
    def coordinates(self) -> Array:
        """Translation [m] and rotation [rad] in one array, in the order of :func:`modes`."""
        return np.concatenate([self.translation, self.turn])

    @cached_property
    def rotation(self) -> Array:
        """The matrix of the rotation, dim x dim."""
        if not self.turn.any():
            return np.eye(len(self.centre))
        return np.asarray(expm(np.tensordot(self.turn, generators(len(self.centre)), axes=1)))

    def moved(self, coordinates: Array) -> Pose:
        """The pose after a further translation [m] and rotation [rad]."""
        dim = len(self.centre)
        translation, turn = self.translation + coordinates[:dim], self.turn + coordinates[dim:]
        return replace(self, translation=translation, turn=turn)

    def to_local(self, x: Array) -> Array:
        """Positions in the frame that moves with the obstacle, points x dim."""
        return np.asarray((x - self.position) @ self.rotation + self.centre)

    def to_global(self, x: Array) -> Array:
        """Positions of points of the obstacle, given where its shape is described."""
        return np.asarray((x - self.centre) @ self.rotation.T + self.position)

    def modes(self, x: Array) -> Array:
        """Displacements of points that move with the obstacle, points x dim x motions."""
        return modes(x, self.position)

    def velocity(self, x: Array, rates: Array) -> Array:
        """Velocities of points that move with the obstacle [m/s], points x dim.

        Args:
            x: Present positions [m], points x dim.
            rates: Velocity of the centre [m/s] and rate of rotation [rad/s].
        """
        return np.asarray(self.modes(x) @ rates)

    def resultant(self, x: Array, forces: Array) -> Array:
        """Resultant force and moment about the centre of forces at points.

        Args:
            x: Present positions [m], points x dim.
            forces: Forces, points x dim.
        """
        return np.asarray(np.einsum("jak,ja->k", self.modes(x), forces))
