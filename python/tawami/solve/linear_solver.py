"""The common part of the solvers of the scaled linear systems of a step: S K S y = S r, x = S y."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from tawami.base.arrays import Array
from tawami.base.errors import SingularError
from tawami.base.petsc import Handles
from tawami.base.timing import Stopwatch
from tawami.solve.operators import Part

#: Condition number from which the solution of a scaled system has no correct digit.
SINGULAR = 1e14
#: Krylov iterations for a second right-hand side.
MOST = 500


@dataclass(frozen=True)
class System:
    """A linear system K x = r.

    Attributes:
        matrix: Reduced tangent K; it is scaled in place.
        scale: Gives the factors S of the unknowns, if those of an older tangent do not serve.
        right: r.
        tolerance: Bound of |S (r - K x)| / |S r| if the solve is not direct.
        parts: Gives the operators of the fields for a preconditioner.
    """

    matrix: Any
    scale: Callable[[], Array]
    right: Array
    tolerance: float
    parts: Callable[[], list[Part]]


class LinearSolver:
    """Solver of the tangents of one scene; each rank passes and gets its own rows.

    Args:
        comm: Communicator.
        stopwatch: Measures the time of each stage.

    Attributes:
        symmetric: Whether the solver knows the tangent to be symmetric.
        condition: Estimated condition number of a tangent, scaled.
        weak: This rank's entries of the direction in which that tangent is weakest, if known.
        iterations: Krylov iterations of the last solve; 0 if the tangent was factorised.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch) -> None:
        self._stopwatch = stopwatch
        self._handles = Handles(self, comm)
        self._scale = np.empty(0)
        self.condition, self.symmetric, self.iterations = 1.0, True, 0
        self.weak = np.empty(0)

    def forget(self) -> None:
        """Free all objects of a tangent; the next solve makes new ones."""
        self._handles.free()

    def successor(self) -> LinearSolver | None:
        """The solver of the same scene in other cells; None if nothing can be kept for it."""
        return None

    def begin(self) -> None:
        """Begin a step."""

    def method(self, unknowns: int) -> str:
        """The method for a tangent of this number of unknowns, in words, and the reason for it."""
        raise NotImplementedError

    def record(self) -> None:
        """Record the state for :meth:`state` from now on, independently of earlier solves."""

    def state(self) -> dict[str, Any] | None:
        """State that later solves use from earlier ones; None if there is none."""
        return None

    def restore(self, state: Mapping[str, Any], matrix: Any) -> None:
        """Restore a :meth:`state`, for a tangent with the same unknowns."""
        raise NotImplementedError

    @property
    def ready(self) -> bool:
        """Whether :meth:`again` can solve."""
        return "ksp" in self._handles

    @property
    def singular(self) -> bool:
        """Whether the solution of that tangent has no correct digit."""
        return not self.condition < SINGULAR

    def solve(self, system: System) -> Array:
        """Solve a system.

        Raises:
            SingularError: The system cannot be solved, and nothing else is known. A caller asks
                :attr:`singular` as well.
        """
        raise NotImplementedError

    def again(self, right: Array, tolerance: float) -> Array:
        """Solve the last system of :meth:`solve` for another right-hand side.

        Raises:
            SingularError: FGMRES did not converge.
        """
        iterations = self.iterations
        with self._stopwatch("solve"):
            converged = self._krylov(self._scale * right, tolerance, MOST)
            solution = np.asarray(self._scale * self._handles["x"].array)
        if not converged:
            raise SingularError(
                f"FGMRES did not converge in {self.iterations} iterations for a second right-hand side "
                "of the same tangent; use factorise='always'"
            )
        self.iterations = iterations
        return solution

    def _begin(self, matrix: Any, scale: Callable[[], Array]) -> None:
        """Make vectors and factors for another tangent, and scale it."""
        self.forget()
        self._handles["x"], self._handles["b"] = matrix.createVecs()
        # products row by row take 2/3 of the time of those by rows with the same pattern
        matrix.setOption(PETSc.Mat.Option.USE_INODES, False)
        self._rescale(matrix, scale)

    def _rescale(self, matrix: Any, scale: Callable[[], Array]) -> None:
        self._scale = scale()
        self._multiply(matrix, self._scale)

    def _multiply(self, matrix: Any, factors: Array) -> None:
        """Multiply rows and columns of a matrix by factors."""
        with self._stopwatch("scale"):
            vector = self._handles["x"]
            vector.setArray(factors)
            matrix.diagonalScale(vector, vector)

    def _is_symmetric(self, matrix: Any, probe: Array) -> bool:
        """Whether a matrix is symmetric, by its products with a random vector."""
        x, y = (self._handles[name] for name in ("x", "b"))
        x.setArray(probe)
        matrix.mult(x, y)
        forward = y.copy()
        matrix.multTranspose(x, y)
        size = forward.norm()
        y.axpy(-1.0, forward)
        forward.destroy()
        return bool(y.norm() <= 1e-12 * size)

    def _krylov(self, right: Array, tolerance: float, limit: int) -> bool:
        """Solve the scaled system by `ksp`, into the vector x; False if it does not converge."""
        ksp, x, b = (self._handles[name] for name in ("ksp", "x", "b"))
        ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=limit)
        b.setArray(right)
        ksp.solve(b, x)
        self.iterations = ksp.getIterationNumber()
        return bool(ksp.getConvergedReason() > 0)
