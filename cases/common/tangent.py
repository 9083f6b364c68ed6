"""The tangent of a step as a dense matrix, for cases on condition numbers and inf-sup constants."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import tawami

Array = npt.NDArray[np.float64]


def reduced_tangent(scene: tawami.Scene) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Tangent of a scene at rest, on the free unknowns and without scaling.

    Driver scripts do not need the matrix, so this uses internals of `Scene`.

    Returns:
        The matrix, unknowns x unknowns, and the mask of the unknowns that belong to u.
    """
    reduction = scene.reduction()
    tangent = scene.tangent(np.zeros(scene.num_coefficients))
    matrix = (reduction.selection.T @ tangent @ reduction.selection).toarray()
    return matrix, reduction.coefficients < scene.configuration.domain.layout.num_displacement
