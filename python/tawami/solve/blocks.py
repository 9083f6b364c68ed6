"""Parts of a scaled tangent, and solvers for them."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.petsc import diagonal_of, rows_of

PREFIX = "tawami_multigrid_"
#: Penalty of the constraints in the scaled operators.
AUGMENTED = 2.0


def row_sum(matrix: Any) -> float:
    """Bound of the eigenvalues of D^-1 A, D the diagonal of A: its largest row sum."""
    sums = np.asarray(abs(rows_of(matrix)).sum(axis=1)).ravel() / np.abs(diagonal_of(matrix))
    return ranks.largest(matrix.comm.tompi4py(), float(sums.max(initial=0.0)))


def scale(matrix: Any, factors: Array) -> None:
    """Multiply rows and columns of a matrix by factors."""
    vector = matrix.createVecLeft()
    vector.setArray(factors)
    matrix.diagonalScale(vector, vector)
    vector.destroy()


def add(part: Any, mass: Any) -> None:
    """Add a mass matrix to a field's part of a tangent, whose pattern contains it."""
    part.axpy(1.0, mass, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)


def coupling_of(matrix: Any, place: Any, of_u: Any) -> Array:
    """Diagonal of -K_fu K_uf: what the displacement adds to a field once it is eliminated."""
    forward, back = matrix.createSubMatrix(place, of_u), matrix.createSubMatrix(of_u, place)
    transposed = PETSc.Mat()
    back.transpose(transposed)
    products = rows_of(forward).multiply(rows_of(transposed))
    for used in (forward, back, transposed):
        used.destroy()
    return -np.asarray(products.sum(axis=1)).ravel()


_numbers = iter(range(1 << 60))


def set_options(solver: Any, options: dict[str, str | None]) -> None:
    """Set options that have no function in petsc4py."""
    prefix = f"{PREFIX}{next(_numbers)}_"
    database = PETSc.Options(prefix)
    for name, value in options.items():
        database[name] = value
    solver.setOptionsPrefix(prefix)
    solver.setFromOptions()
    for name in options:
        database.delValue(name)


def constrained(matrix: Any, operators: list[Any], places: list[Any]) -> Any:
    """Stiffen the operators of the fields by a penalty on the constraints.

    Args:
        matrix: Scaled matrix, whose rows of constraints B have the norm 1.
        operators: Scaled operators of the fields.
        places: Unknowns of the fields, then the multipliers.

    Returns:
        Approximate Schur complement of the multipliers with the penalty, -B (F + penalty)^-1 B^T.
    """
    last = places[-1]
    for operator, place in zip(operators, places, strict=False):
        columns, rows = (matrix.createSubMatrix(*two) for two in ((place, last), (last, place)))
        # a field without constraints keeps its matrix: on several ranks another cannot be refreshed
        if columns.norm() > 0:
            penalty = columns.matMult(rows)
            operator.axpy(AUGMENTED, penalty)
            penalty.destroy()
        for used in (columns, rows):
            used.destroy()
    schur = matrix.createSubMatrix(last, last)
    schur.zeroEntries()
    schur.shift(-1 / AUGMENTED)
    return schur
