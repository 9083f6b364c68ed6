"""The scaled linear system of one Newton iteration, solved by MUMPS.

LDL^T where the tangent is symmetric, LU otherwise. Two steps of inverse iteration from a fixed random
vector follow each factorisation: their growth estimates the condition number from below, and the
large entries of the vector they end with say where a singular system is weak.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from tawami.errors import SingularError
from tawami.stopwatch import Stopwatch

Array = npt.NDArray[np.float64]

#: A scaled system beyond this condition number has no digit left to trust.
SINGULAR = 1e14


class LinearSystem:
    """A factorised tangent.

    Args:
        matrix: Reduced tangent; scaled in place.
        scale: Factor of each unknown: the system solved is `S K S y = S r`, `x = S y`.
        stopwatch: Where the time goes.

    Attributes:
        symmetric: Whether the tangent is symmetric (probed by one product with a random vector).
        condition: Lower estimate of the condition number of the scaled matrix; infinite where the
            factorisation met a zero pivot.
        suspects: Unknowns that dominate the weakest direction found, most suspect first.

    Raises:
        SingularError: The factorisation ran out of memory or failed for another reason than a
            singular matrix.
    """

    def __init__(self, matrix: Any, scale: Array, stopwatch: Stopwatch) -> None:
        self._stopwatch = stopwatch
        self._left, self._right = matrix.createVecs()
        with stopwatch("scale"):
            self._scale = scale
            self._left.setArray(scale)
            matrix.diagonalScale(self._left, self._left)
            probe = np.random.default_rng(0).standard_normal(len(scale))
            self.symmetric = _is_symmetric(matrix, probe)
        with stopwatch("factorise"):
            self._factorise(matrix)
        with stopwatch("solve"):
            self._estimate(matrix, probe)

    def _factorise(self, matrix: Any) -> None:
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOperators(matrix)
        self._ksp.setType("preonly")
        self._pc = self._ksp.getPC()
        self._pc.setType("cholesky" if self.symmetric else "lu")
        self._pc.setFactorSolverType("mumps")
        self._pc.setFactorSetUpSolverType()
        self._factor = self._pc.getFactorMatrix()
        self._factor.setMumpsIcntl(7, 0)  # AMD: the cheapest first factorisation
        self._factor.setMumpsIcntl(14, 50)  # room for delayed pivots
        self._ksp.setUp()
        code = self._factor.getMumpsInfog(1)
        if code < 0 and code not in (-10, -6):
            raise SingularError(
                f"MUMPS could not factorise the tangent (INFOG(1) = {code}, INFOG(2) = "
                f"{self._factor.getMumpsInfog(2)}): see the MUMPS users' guide; -9 and -13 mean "
                "that memory is short"
            )
        self._failed = code < 0

    def _estimate(self, matrix: Any, probe: Array) -> None:
        failed = self._failed
        if failed:
            matrix.shift(1e-12)
            self._free(self._factor, self._pc, self._ksp)
            self._factorise(matrix)
        weak = self._apply(probe)
        weak = self._apply(weak / np.linalg.norm(weak))
        # rms of the row norms, which the scaling makes alike
        norm = matrix.norm(PETSc.NormType.FROBENIUS) / np.sqrt(len(probe))
        self.condition = np.inf if failed else float(norm * np.linalg.norm(weak))
        self.suspects = np.argsort(-np.abs(weak))

    def __enter__(self) -> LinearSystem:
        return self

    def __exit__(self, *_: object) -> None:
        self._free(self._factor, self._pc, self._ksp, self._left, self._right)

    @staticmethod
    def _free(*objects: Any) -> None:
        """petsc4py frees late or never, and each of its handles keeps the object: free them all."""
        for item in objects:
            item.destroy()

    def _apply(self, right: Array) -> Array:
        self._right.setArray(right)
        self._ksp.solve(self._right, self._left)
        return np.array(self._left.array)

    @property
    def singular(self) -> bool:
        """Whether the system cannot be solved to any accuracy."""
        return not self.condition < SINGULAR

    def solve(self, right: Array) -> Array:
        """Solution for a right-hand side."""
        with self._stopwatch("solve"):
            return self._scale * self._apply(self._scale * right)


def _is_symmetric(matrix: Any, probe: Array) -> bool:
    x, y = matrix.createVecs()
    x.setArray(probe)
    matrix.mult(x, y)
    forward = y.array.copy()
    matrix.multTranspose(x, y)
    change = np.linalg.norm(forward - y.array)
    x.destroy(), y.destroy()
    return bool(change <= 1e-12 * np.linalg.norm(forward))
