"""What the solvers of the scaled linear systems of a step share: `S K S y = S r`, `x = S y`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base.petsc import Handles
from tawami.base.timing import Stopwatch

Array = npt.NDArray[np.float64]

#: A scaled system beyond this condition number has no digit left to trust.
SINGULAR = 1e14


@dataclass(frozen=True)
class Blocks:
    """What this rank's unknowns are.

    Attributes:
        displacement: Which of them belong to the displacement.
        rigid: Values of the three rigid motions for these, n x 3.
    """

    displacement: npt.NDArray[np.bool_]
    rigid: Array


class Solver:
    """Solves the tangents of one scene; each rank passes and gets its own rows.

    Args:
        comm: Communicator.
        stopwatch: Where the time goes.

    Attributes:
        symmetric: Whether the solver knows the tangent to be symmetric.
        condition: Estimate of the condition number of a tangent, scaled.
        weak: This rank's entries of the direction that it is weakest in, so far as known.
        iterations: FGMRES iterations of the last solve; 0 where the tangent was factorised.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch) -> None:
        self._stopwatch = stopwatch
        self._handles = Handles(self, comm)
        self._scale = np.empty(0)
        self.condition, self.symmetric, self.iterations = 1.0, True, 0
        self.weak = np.empty(0)

    def forget(self) -> None:
        """Free what was made for a tangent; the next solve makes it anew."""
        self._handles.free()

    def keep(self) -> None:
        """Keep what :meth:`state` gives from now on; nothing is taken over from earlier solves."""

    def state(self) -> dict[str, Any] | None:
        """What later solves take from earlier ones; None if that is nothing."""
        return None

    def restore(self, state: Mapping[str, Any], matrix: Any) -> None:
        """The reverse of :meth:`state`, for a tangent of the same unknowns."""
        raise NotImplementedError

    @property
    def singular(self) -> bool:
        """Whether that tangent cannot be solved to any accuracy."""
        return not self.condition < SINGULAR

    def solve(
        self,
        matrix: Any,
        scale: Callable[[], Array],
        right: Array,
        tolerance: float,
        blocks: Callable[[], Blocks],
    ) -> Array:
        """Solution of `K x = r`.

        Args:
            matrix: Reduced tangent K; scaled in place.
            scale: Gives the factors S of the unknowns, where those of an older tangent do not serve.
            right: r.
            tolerance: Of `|S (r - K x)| / |S r|` where the solve is not direct.
            blocks: Says what the unknowns are.

        Raises:
            SingularError: It cannot be solved, and the solver knows no more than that; `singular` is
                for the caller to ask.
        """
        raise NotImplementedError

    def _begin(self, matrix: Any, scale: Callable[[], Array]) -> None:
        """Vectors and factors for another tangent, which is scaled."""
        self.forget()
        self._handles["x"], self._handles["b"] = matrix.createVecs()
        self._scale = scale()
        self._multiply(matrix, self._scale)

    def _multiply(self, matrix: Any, factors: Array) -> None:
        """Rows and columns of a matrix with factors."""
        with self._stopwatch("scale"):
            vector = self._handles["x"]
            vector.setArray(factors)
            matrix.diagonalScale(vector, vector)

    def _fgmres(self, right: Array, tolerance: float, limit: int) -> bool:
        """The scaled system by FGMRES, into the vector x; False if it takes more than the limit."""
        ksp, x, b = (self._handles[name] for name in ("ksp", "x", "b"))
        ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=limit)
        b.setArray(right)
        ksp.solve(b, x)
        self.iterations = ksp.getIterationNumber()
        return bool(ksp.getConvergedReason() > 0)
