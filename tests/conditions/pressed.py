"""Elastic bodies that rigid planes press: Hertz (1882), Cattaneo (1938), Mindlin (1949)."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

import tawami

#: Radius of the body, half the width of the contact that the load belongs to, and Young's modulus.
RADIUS, HALF, E = 50.0, 1.0, 1.0


class Pressed:
    """A body with a parabolic top under a plane that is pressed down by the force of Hertz.

    Args:
        nu: Poisson's ratio.
        cells: Cells over half of the contact.
        size: Depth and half-width of the body, in halves of the contact.
        half: Only one half of it, with a plane of symmetry.
        options: Of the scene.
    """

    def __init__(self, nu, cells, size, *, half, **options):
        self.load = np.pi * E / (1 - nu**2) * HALF**2 / (4 * RADIUS)
        h, left = HALF / cells, 0.0 if half else -size
        shape = (round((size - left) / h), round(size / h) + 1)
        grid = tawami.Grid(MPI.COMM_WORLD, origin=(left, 0.0), h=h, cells=shape)
        x, top = np.linspace(size, left, 2 * shape[0] + 1), size - 0.43 * h  # cuts the cells
        corners = [(left, 0.0), (size, 0.0), *zip(x, top - x**2 / (2 * RADIUS), strict=True)]
        body = tawami.polygon(grid, corners, per_axis=2)
        self.scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=nu), **options)
        for component in ("x", "y"):
            self.scene.fix(lambda x, y: y < 1e-9, component)
        if half:
            self.scene.fix(lambda x, y: x < 1e-9, "x")
        self.force = -self.load / 2 if half else -self.load
        self.plane = self.scene.obstacle(
            tawami.half_plane((0.0, top), (0.0, -1.0)), force=(0.0, self.force), free="y"
        )
        self.solution = self.scene.solve()
        self.contact = self.solution.contact(self.plane)

    def pressure_error(self):
        """Largest error of the mean pressure of a patch, where |x| < .8 a, relative to the exact one."""
        groups, weight = self.plane.groups, self.plane.place.weight
        x = self.contact.x[:, 0]
        profile = np.sqrt(np.maximum(1 - (x / HALF) ** 2, 0.0))
        exact = groups.means(weight, 2 * self.load / (np.pi * HALF) * profile)
        inside = groups.means(weight, np.abs(x)) < 0.8 * HALF
        inside &= groups.means(weight, self.contact.pressure) > 0
        error = groups.means(weight, self.contact.pressure)[inside] / exact[inside] - 1
        assert np.count_nonzero(inside) > 2
        return float(np.abs(error).max())

    def pulled(self, friction, distance):
        """Let the plane rub and pull it aside; share of the friction, and half the sticking width."""
        self.plane.change(friction=friction)
        self.plane.change((distance, self.force))
        self.solution = self.scene.solve()
        contact = self.solution.contact(self.plane)
        sticks = np.abs(contact.friction[:, 0]) < friction * contact.pressure * (1 - 1e-6)
        width = self.plane.place.weight[sticks].sum() / 2
        return abs(contact.force[0]) / (friction * self.load), width
