"""The check that a closed border encloses the particles of its body."""

from __future__ import annotations

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.border.points import BorderPoints
from tawami.grid.grid import Grid

#: Sum of n dA of a closed border relative to its length, and differences of areas and centroids, that
#: are ignored.
CLOSED, FITS = 1e-6, 0.02


def check_fits(grid: Grid, points: BorderPoints, x: Array, area: Array) -> None:
    """Check that a closed border encloses the particles: area and centroid by the divergence theorem.

    A call for all ranks.

    Args:
        grid: The grid.
        points: Points of the border.
        x: Positions of the particles of this rank [m], particles x dim.
        area: Their areas in the plane [m2].

    Raises:
        InputError: It does not.
    """
    flux = points.length[:, None] * points.normal
    axis = 1 if grid.space.hoop else 0  # the axis of rotation closes the border
    if np.abs(flux.sum(axis=0)[axis:]).max() > CLOSED * points.length.sum():
        return
    # positions relative to the middle: round-off far from the origin cancels
    middle = points.x.mean(axis=0)
    middle[:axis] = 0.0
    enclosed = ((points.x - middle) * flux).sum() / grid.space.dim
    centroid = ((points.x - middle) ** 2 * flux).sum(axis=0) / 2 / enclosed
    total, *moments = ranks.sum_of(grid.comm, np.array([area.sum(), *(area @ (x - middle))]))
    away = float(np.linalg.norm(centroid - np.array(moments) / total))
    if abs(enclosed - total) > FITS * total or away > FITS * max(grid.h, np.sqrt(total)):
        raise InputError(
            f"the border of the body encloses {enclosed:.6g} m2 and its particles have {total:.6g} m2, "
            f"with centroids {away:.2g} m apart: expected a border that fits the particles; "
            "Body(x, volume, border=tawami.polyline(corners)) gives another one, border=None none"
        )
