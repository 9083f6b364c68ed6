"""Volumes of the particles of full cells that integrate polynomials exactly.

Evenly spaced particles integrate linear functions over a cell exactly, and squares with an error that is
most of that of the deflection of a beam. In a cell that its particles fill, volumes V_p w_p shall fulfil

    sum_p V_p w_p m(x_p) = int m dx      for each m of degree 2 along each axis,

with the smallest sum_p V_p (w_p - 1)^2. Symmetric particles are then exact up to degree 3, as 2 x 2
Gauss points. Cells with fewer particles than functions m, and those whose volumes would not stay
positive, keep theirs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base.arrays import Array
from tawami.field.cut_cells import full_cells
from tawami.grid.grid import Grid

Numbers = npt.NDArray[np.unsignedinteger[Any]]
#: Degree along each axis of the functions that are integrated exactly.
DEGREE = 2
#: Smallest factor of a volume, and largest error of a moment, relative to the volume of the cell.
LEAST, EXACT = 0.1, 1e-9


def factors(grid: Grid, location: _rust.Location, volume: Array, material: Numbers) -> Array:
    """Factors w of the volumes of this rank's particles; a call for all ranks.

    Args:
        grid: The grid.
        location: Cells of this rank's particles, and positions in them.
        volume: Their volumes [m2 per metre depth].
        material: Numbers of their materials; cells with several of them keep the volumes.
    """
    found, cell = np.ones(len(volume)), location.cell.astype(np.int64)
    full, xi = full_cells(grid, location, volume).ravel(), np.asarray(location.xi)
    size = volume / (grid.space.measure(grid.h) * grid.space.thickness(grid.positions(location)))
    order = np.argsort(cell, kind="stable")
    order = order[full[cell[order]]]
    start, count = np.unique(cell[order], return_index=True, return_counts=True)[1:]
    least = (DEGREE + 1) ** grid.space.dim
    for number in np.unique(count[count >= least]):
        of = order[start[count == number][:, None] + np.arange(number)]  # cells x particles
        of = of[(material[of] == material[of[:, :1]]).all(axis=1)]
        a = _monomials(xi[of])
        root = np.sqrt(size[of])[:, None]
        # of Legendre polynomials only that of degree 0 has an integral
        missing = np.eye(least)[0] - np.einsum("cmp,cp->cm", a, size[of])
        change = np.einsum("cpm,cm->cp", np.linalg.pinv(a * root, rcond=1e-9), missing)
        new = 1 + change / root[:, 0]
        error = np.abs(np.einsum("cmp,cp->cm", a, size[of] * new) - np.eye(least)[0]).max(axis=1)
        good = (new.min(axis=1) > LEAST) & (error < EXACT)
        found[of[good]] = new[good]
    return found


def _monomials(xi: Array) -> Array:
    """Products of shifted Legendre polynomials at positions in cells (cells x particles x axes), cells x
    functions x particles.
    """
    t = 2 * xi - 1
    along = np.stack([np.ones_like(t), t, 1.5 * t**2 - 0.5], axis=3)
    product = along[:, :, 0]
    for axis in range(1, xi.shape[2]):
        product = (product[..., None] * along[:, :, axis, None]).reshape(*xi.shape[:2], -1)
    return np.asarray(product.transpose(0, 2, 1))
