"""Two grids for a mixed system: smoothing on the fine one, solves on the coarse one.

A sweep of the smoother replaces the block of the displacement by D, twice its diagonal, and solves the
system of the volume that is left, B D^-1 B^T + C, by one step of steepest descent (Braess and Sarazin
1997).
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
SETTLED, CYCLES = 0.02, 8


class Smoother:
    """Sweeps for a matrix.

    Args:
        matrix: Unknowns of the displacement first.
        num_displacement: Their number.
    """

    def __init__(self, matrix: sp.csc_matrix, num_displacement: int) -> None:
        self._n = n = num_displacement
        of_volume = matrix[:, n:]
        self._d = DAMPING * matrix.diagonal()[:n]
        self._into, self._out = of_volume[:n].tocsr(), matrix[n:, :n].tocsr()
        self._of_volume = of_volume[n:].tocsr()
        squares = self._into.power(2).T @ (1 / self._d)
        self._diagonal = squares - self._of_volume.diagonal()

    def __call__(self, residual: Array) -> Array:
        """Approximate solution of the system with a right-hand side."""
        n, d = self._n, self._d
        u = residual[:n] / d
        right = self._out @ u - residual[n:]
        step = right / self._diagonal
        u_of_step = (self._into @ step) / d
        image = self._out @ u_of_step - self._of_volume @ step
        length = (right @ step) / (step @ image)
        return np.concatenate([u - length * u_of_step, length * step])


def solve(
    matrix: sp.csc_matrix,
    num_displacement: int,
    prolongation: sp.csr_matrix,
    coarse: Callable[[Array], Array],
    right: Array,
    start: Array,
    quantity: Array,
) -> Array | None:
    """Solve a system until a linear quantity of the solution changes little; None if it diverges.

    Args:
        matrix: Matrix of the fine grid, unknowns of the displacement first.
        num_displacement: Their number.
        prolongation: Fine unknowns x coarse unknowns.
        coarse: Solves the system of the coarse grid approximately.
        right: Right-hand side.
        start: First approximation.
        quantity: Weights of the quantity.
    """
    smooth, back = Smoother(matrix, num_displacement), prolongation.T.tocsr()
    x, last = start, float(quantity @ start)
    first, residual = last, right - matrix @ start
    size = np.linalg.norm(residual)
    for _ in range(CYCLES):
        x = x + smooth(residual)
        x = x + prolongation @ coarse(back @ (right - matrix @ x))
        x = x + smooth(right - matrix @ x)
        residual = right - matrix @ x
        if not np.linalg.norm(residual) < 2 * size:
            return None
        value = float(quantity @ x)
        if abs(value - last) <= SETTLED * abs(value - first):
            break
        last = value
    return x
