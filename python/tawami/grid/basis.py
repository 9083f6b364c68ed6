"""One-dimensional bases on a row of cells, and the extraction matrix of the grid.

Quadratic splines, bilinear and biquadratic Lagrange functions are all biquadratic on a cell. The field
problem is therefore assembled on the nodes of a continuous Lagrange element: nodal values = E
coefficients. The rows of the extraction matrix E sum to 1.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array, Indices
from tawami.base.space import Counts, Position, lattice

Basis = Literal["quadratic_spline", "bilinear", "biquadratic"]
BASES: tuple[Basis, ...] = get_args(Basis)


def values_1d(basis: Basis, n: int, cell: npt.ArrayLike, t: npt.ArrayLike) -> sp.csr_matrix:
    """Values of the functions on a row of `n` cells, positions x functions.

    Args:
        basis: Name of the basis.
        n: Number of cells.
        cell: Cell of each position.
        t: Position in the cell, 0 to 1.
    """
    cells = np.atleast_1d(np.asarray(cell, dtype=np.int64))
    first, values = _rust.basis_1d(basis, n, cells, np.atleast_1d(np.asarray(t, dtype=float)))
    width = _per_cell(basis)
    rows = np.repeat(np.arange(len(cells)), width)
    columns = (first[:, None] + np.arange(width)).ravel()
    shape = (len(cells), _rust.basis_len(basis, n))
    matrix = sp.csr_matrix((values[:, :width].ravel(), (rows, columns)), shape=shape)
    matrix.eliminate_zeros()
    return matrix


def _per_cell(basis: Basis) -> int:
    """Functions that do not vanish on a cell of a row."""
    return 2 if basis == "bilinear" else 3


def functions_on(basis: Basis, n: int, cells: npt.ArrayLike) -> Indices:
    """Functions on a row of `n` cells that do not vanish on all of these cells, ascending."""
    chosen = np.atleast_1d(np.asarray(cells, dtype=np.int64))
    first, _ = _rust.basis_1d(basis, n, chosen, np.full(len(chosen), 0.5))
    used = np.zeros(_rust.basis_len(basis, n), dtype=bool)
    for k in range(_per_cell(basis)):
        used[first + k] = True
    return np.flatnonzero(used)


def extraction(basis: Basis, cells: Sequence[int], degree: int) -> sp.csr_matrix:
    """The extraction matrix E of a scalar field on Lagrange nodes (`degree` per cell along each axis).

    Its shape is nodes x functions, x fastest in both.
    """
    nodes = lattice([np.arange(degree + 1)] * len(cells))
    number = np.arange(int(np.prod(cells)))
    functions, values = _rust.extraction(basis, cells, number, nodes / degree)
    first = degree * lattice([np.arange(n) for n in cells])
    shape = [degree * n + 1 for n in cells]
    row = (first[:, None] + nodes) @ np.cumprod((1, *shape[:-1]))
    rows, once = np.unique(row, return_index=True)  # a node belongs to several cells
    columns = functions[once // len(nodes)]
    entries = values.reshape(-1, values.shape[2])[once]
    index = (np.repeat(rows, columns.shape[1]), columns.ravel())
    count = [_rust.basis_len(basis, n) for n in cells]
    matrix = sp.csr_matrix((entries.ravel(), index), shape=(len(rows), int(np.prod(count))))
    matrix.eliminate_zeros()
    return matrix


@functools.lru_cache(maxsize=64)
def refinement(basis: Basis, n: int) -> sp.csr_matrix:
    """Functions on a row of cells twice as long, in those on `n` cells (two-scale relation).

    Its shape is fine functions x coarse functions. If n is odd, the last coarse cell reaches beyond the
    row. A fine coefficient is the value at its Greville point; that of a spline inside the row is
    2 f(x) - (f(x - 1/2) + f(x + 1/2)) / 2, the polar form of f on its cell (Ramshaw 1989).
    """
    points, coarse = greville_1d(basis, n), (n + 1) // 2

    def at(x: Array) -> sp.csr_matrix:
        cell = np.minimum((x / 2).astype(np.int64), coarse - 1)
        return values_1d(basis, coarse, cell, x / 2 - cell)

    matrix = at(points)
    if basis == "quadratic_spline":
        half = np.full(len(points), 0.5)
        half[[0, -1]] = 0.0
        matrix = sp.csr_matrix(2 * matrix - (at(points - half) + at(points + half)) / 2)
    matrix.data[np.abs(matrix.data) < 1e-12] = 0.0
    matrix.eliminate_zeros()
    return matrix


@functools.lru_cache(maxsize=2)
def greville(basis: Basis, origin: Position, h: float, cells: Counts) -> Array:
    """Greville points [m] of the functions of a grid, functions x axes; read only."""
    axes = zip(origin, cells, strict=True)
    points = lattice([x + h * greville_1d(basis, n) for x, n in axes])
    points.flags.writeable = False
    return points


def greville_1d(basis: Basis, n: int) -> Array:
    """Greville points [cells]: the coefficients that reproduce the function x."""
    if basis == "quadratic_spline":
        return np.concatenate([[0.0], np.arange(n) + 0.5, [float(n)]])
    return np.linspace(0.0, n, _rust.basis_len(basis, n))
