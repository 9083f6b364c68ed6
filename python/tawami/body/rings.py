"""Volumes of the particles of a body in the geometry of a grid."""

from __future__ import annotations

import numpy as np

from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.grid.grid import Grid


def volumes(grid: Grid, x: Array, area: Array) -> Array:
    """Volumes of particles: their areas, in axisymmetry times 2 pi r (Pappus).

    That is the exact volume of the ring of which the particle is the centroid.

    Args:
        grid: The grid.
        x: Positions [m], n x dim.
        area: Areas in the plane [m2], n.

    Raises:
        InputError: In axisymmetry, a particle lies on the axis or left of it.
    """
    if not grid.space.hoop or x.shape != (len(area), grid.space.dim):
        return area
    left = np.flatnonzero(x[:, 0] <= 0)
    if len(left):
        p = left[0]
        raise InputError(
            f"geometry='axisymmetric': {len(left)} of {len(x)} particles are on the axis or left of it, "
            f"the first is {p} at ({x[p, 0]:g}, {x[p, 1]:g}) m: expected x > 0, the distance from the "
            "axis; keep the right half of the body"
        )
    return np.asarray(area * grid.space.thickness(x))
