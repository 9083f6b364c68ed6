"""Two grids for a mixed system: smoothing on the fine one, solves on the coarse one.

A sweep of the smoother replaces the block of the displacement by D, twice its diagonal, and solves the
system of the volume that is left, B D^-1 B^T + C, by one step of steepest descent (Braess and Sarazin
1997). It takes the matrix for symmetric.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array

#: Factor on the diagonal in D.
DAMPING = 2.0
#: Change of the quantity in a cycle, relative to that since the start, at which the iteration stops,
#: and the largest number of cycles.
SETTLED, CYCLES = 0.05, 8


class Smoother:
    """Sweeps for a matrix.

    Args:
        matrix: Unknowns of the displacement first.
        num_displacement: Their number.
    """

    def __init__(self, matrix: sp.csc_matrix, num_displacement: int) -> None:
        self._n = n = num_displacement
        start, diagonal = matrix.indptr[n], matrix.diagonal()
        arrays = (matrix.data[start:], matrix.indices[start:], matrix.indptr[n:] - start)
        self._of_volume = sp.csc_matrix(arrays, (len(diagonal), len(diagonal) - n))  # no copies
        self._inverse = np.zeros(len(diagonal))
        self._inverse[:n] = 1 / (DAMPING * diagonal[:n])
        of = self._of_volume
        squares = sp.csc_matrix((of.data**2, of.indices, of.indptr), of.shape)
        self._diagonal = squares.T @ self._inverse - diagonal[n:]

    def __call__(self, residual: Array) -> Array:
        """Approximate solution of the system with a right-hand side."""
        n, of_volume = self._n, self._of_volume
        x = self._inverse * residual
        right = of_volume.T @ x - residual[n:]
        step = right / self._diagonal
        coupled = of_volume @ step
        u_of_step = self._inverse * coupled
        image = of_volume.T @ u_of_step - coupled[n:]
        length = (right @ step) / (step @ image)
        x -= length * u_of_step
        x[n:] = length * step
        return np.asarray(x)


def solve(
    matrix: sp.csc_matrix,
    num_displacement: int,
    onto_fine: Callable[[Array], Array],
    onto_coarse: Callable[[Array], Array],
    coarse: Callable[[Array], Array],
    right: Array,
    start: Array,
    quantity: Array,
) -> Array | None:
    """Solve a system until a linear quantity of the solution changes little; None if it diverges.

    Args:
        matrix: Matrix of the fine grid, unknowns of the displacement first.
        num_displacement: Their number.
        onto_fine, onto_coarse: Prolongation of coarse unknowns, and its transpose.
        coarse: Solves the system of the coarse grid approximately.
        right: Right-hand side.
        start: First approximation.
        quantity: Weights of the quantity.
    """
    smooth = Smoother(matrix, num_displacement)
    x, last = start, float(quantity @ start)
    first, residual = last, right - matrix @ start
    size = np.linalg.norm(residual)
    for _ in range(CYCLES):
        x = x + smooth(residual)
        x = x + onto_fine(coarse(onto_coarse(right - matrix @ x)))
        x = x + smooth(right - matrix @ x)
        residual = right - matrix @ x
        if not np.linalg.norm(residual) < 2 * size:
            return None
        value = float(quantity @ x)
        if abs(value - last) <= SETTLED * abs(value - first):
            break
        last = value
    return x
