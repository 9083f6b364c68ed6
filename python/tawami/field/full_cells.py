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
from tawami.base.arrays import Array, Indices
from tawami.field.cut_cells import full_cells
from tawami.grid.grid import ON_LINE, Grid

Numbers = npt.NDArray[np.unsignedinteger[Any]]
#: Degree along each axis of the functions that are integrated exactly.
DEGREE = 2
#: Smallest factor of a volume, and largest error of a moment, relative to the volume of the cell.
LEAST, EXACT = 0.1, 1e-9
#: Difference of positions, relative to h, and of volumes, below which cells are alike.
SAME = 1e-9


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
        of = of[np.abs(size[of].sum(axis=1) - 1) < ON_LINE]  # particles do not overlap
        first, same = _different(np.concatenate([xi[of], size[of][..., None]], axis=2))
        found[of] = _of_cells(xi[of[first]], size[of[first]])[same]
    return found


def _different(cells: Array) -> tuple[Indices, Indices]:
    """Numbers of cells that differ by more than `SAME`, and the place of each cell among them.

    Most cells of a body are alike, and one factorisation serves all of them.
    """
    if not len(cells):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    rows = np.rint(cells.reshape(len(cells), -1) / SAME).astype(np.int64)
    bits = rows.view(np.dtype((np.void, rows.itemsize * rows.shape[1]))).ravel()
    return np.unique(bits, return_index=True, return_inverse=True)[1:]


def _of_cells(xi: Array, size: Array) -> Array:
    """Factors of the particles of cells, of which positions (cells x particles x axes) and shares of the
    volume of the cell are given; 1 where there are none.
    """
    a, root = _monomials(xi), np.sqrt(size)[..., None]
    exact = np.eye(1, a.shape[1])[
        0
    ]  # of Legendre polynomials only that of degree 0 has an integral
    missing = exact - np.einsum("cmp,cp->cm", a, size)
    inverse = np.linalg.pinv(a * root.transpose(0, 2, 1), rcond=1e-9)
    found = 1 + np.einsum("cpm,cm->cp", inverse, missing) / root[..., 0]
    error = np.abs(np.einsum("cmp,cp->cm", a, size * found) - exact).max(axis=1, initial=0.0)
    good = (found.min(axis=1, initial=1.0) > LEAST) & (error < EXACT)
    return np.where(good[:, None], found, 1.0)


def _monomials(xi: Array) -> Array:
    """Products of shifted Legendre polynomials at positions in cells (cells x particles x axes), cells x
    functions x particles.
    """
    t = 2 * xi - 1
    along = np.stack([np.ones_like(t), t, 1.5 * t**2 - 0.5], axis=3)
    product = along[:, :, 0]
    for axis in range(1, xi.shape[2]):
        number = product.shape[2] * along.shape[3]
        product = (product[..., None] * along[:, :, axis, None]).reshape(*xi.shape[:2], number)
    return np.asarray(product.transpose(0, 2, 1))
