"""Bodies on an inclined plane: gravity is inclined, the plane is horizontal."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

import tawami

G = 9.81


def slope(angle):
    return G * np.sin(angle), -G * np.cos(angle)


def block_on_incline(angle, friction):
    """A block in equilibrium on a rough incline, which then has another friction."""
    h = 0.125
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=h, cells=(12, 4))
    foot = 0.046  # cuts the cells
    body = tawami.box(grid, (0.2375, foot), (0.7375, foot + 0.25), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1000.0)
    scene.gravity(slope(angle))
    plane = scene.obstacle(tawami.half_plane((0.0, foot), (0.0, 1.0)), 1.0)
    scene.solve()
    plane.change(friction=friction)
    return scene, plane


def disc_on_incline(angle, friction, cells, length=0.35):
    """A disc of radius .5 m in equilibrium on a level plane, which is then inclined.

    Args:
        angle: [rad]
        friction: Of the plane.
        cells: Cells over the radius.
        length: Way for which there is room [m].
    """
    radius, h = 0.5, 0.5 / cells
    room = (int(np.ceil((2 * radius + length) / h)) + 4, int(np.ceil(2 * radius / h)) + 4)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=h, cells=room)
    centre = (radius + 2 * h + 0.013, radius + 1.7 * h)
    body = tawami.disc(grid, centre, radius, per_axis=2)
    law = tawami.linear_elastic(E=1e7, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1000.0)
    weight = scene.gravity((0.0, slope(angle)[1]))
    plane = tawami.half_plane((0.0, centre[1] - radius + 0.02 * h), (0.0, 1.0))
    obstacle = scene.obstacle(plane, friction)
    held = scene.hold((centre[0], centre[1] + 0.3), "x")
    scene.solve()
    held.release()
    weight.change(slope(angle))
    return scene, obstacle


def speed_of(motion):
    """Mean velocity along the plane [m/s]."""
    return float(motion.linear_momentum[0] / motion.mass.sum())
