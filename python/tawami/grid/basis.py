"""One-dimensional bases on a row of cells, and the extraction matrix of the grid.

Quadratic splines, bilinear and biquadratic Lagrange functions are all biquadratic on a cell. The field
problem is therefore assembled on the nodes of a continuous Lagrange element: nodal values = E
coefficients. The extraction matrix E is the Kronecker product of one-dimensional matrices, whose rows
sum to 1.
"""

from __future__ import annotations

from functools import reduce
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array, Indices
from tawami.base.space import Counts

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
    return np.unique(first[:, None] + np.arange(_per_cell(basis)))


def extraction_1d(basis: Basis, n: int, degree: int) -> sp.csr_matrix:
    """Values at the Lagrange nodes (`degree` per cell) of a row of `n` cells, nodes x functions."""
    node = np.arange(degree * n + 1)
    cell = np.minimum(node // degree, n - 1)
    return values_1d(basis, n, cell, (node - degree * cell) / degree)


def extraction(basis: Basis, cells: Counts, degree: int) -> sp.csr_matrix:
    """The extraction matrix E of a scalar field, nodes x functions; x fastest in both."""
    along = [extraction_1d(basis, n, degree) for n in cells]
    return reduce(lambda inner, outer: sp.kron(outer, inner, format="csr"), along)


def greville_1d(basis: Basis, n: int) -> Array:
    """Greville points [cells]: the coefficients that reproduce the function x."""
    if basis == "quadratic_spline":
        return np.concatenate([[0.0], np.arange(n) + 0.5, [float(n)]])
    return np.linspace(0.0, n, _rust.basis_len(basis, n))
