"""Borders, obstacles and contacts for the tests of this folder."""

from __future__ import annotations

import numpy as np

from tawami.border.contact import Contact
from tawami.border.patches import patches
from tawami.border.points import BorderPoints
from tawami.border.rigid import Pose
from tawami.border.shapes import Function, half_plane, rigid_disc, rigid_polygon


def line(start, end, pieces, *, chain=0, begin=0.0):
    """Gauss points on a straight line with the body on its left: pieces with three points each."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    size = np.linalg.norm(end - start)
    at, weight = np.polynomial.legendre.leggauss(3)
    along = size * (np.arange(pieces)[:, None] + (1 + at) / 2).ravel() / pieces
    length = size * np.tile(weight / 2, pieces) / pieces
    to = (end - start) / size
    normal = np.tile([to[1], -to[0]], (len(along), 1))
    number = np.zeros(len(along), dtype=np.int64)
    x = start + along[:, None] * to
    return BorderPoints(x, length, normal, number, ("base",), number + chain, begin + along)


WEDGE = ((-0.5, -0.2), (0.3, -0.6), (0.6, 0.05), (0.1, -0.15), (-0.2, 0.1))
#: Obstacles below or around the origin, none of them symmetric.
SHAPES = {
    "half plane": half_plane((0.1, 0.02), (0.3, 1.0)),
    "disc": rigid_disc((0.05, -0.6), 0.62),
    "polygon": rigid_polygon(WEDGE),
    "round polygon": rigid_polygon(WEDGE, radius=0.07),
    "function": Function(
        lambda x, y: np.hypot(x - 0.05, y + 0.6) - 0.62, 1e-4, np.array([0.0, -0.5])
    ),
}


def rough(points, amount=0.01, seed=1):
    """Displacements without any pattern."""
    return amount * np.random.default_rng(seed).standard_normal(points.x.shape)


def contact(shape, points, friction, pose=None, *, size=0.2, penalty=1e3):
    """Contact from the present positions of the points."""
    pose = pose or Pose.at(shape.centre)
    groups = patches(points, size)
    return Contact(
        shape,
        groups,
        points.length,
        friction,
        np.full(groups.count, penalty),
        pose.to_local(points.x),
    )
