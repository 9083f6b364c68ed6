"""The scaled linear systems of a step by FGMRES, without a factorisation of the whole.

The preconditioner takes the fields one after the other: displacement by smoothed-aggregation
multigrid, which is told the rigid modes, and eps_v or p by nothing at all: scaled as p/mu (README, The
method) their Schur complement is near the identity, the less so the smaller alpha is: 20 to 50
iterations with 0.1, up to 130 with 0.01, whatever Poisson's ratio.

FGMRES finds a solution of a singular system too, if its right-hand side allows one. So the first system
is also solved, roughly, for a random vector, which no singular system allows; that solution estimates
the condition number as in `linear`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from tawami.errors import SingularError
from tawami.petsc import Handles
from tawami.stopwatch import Stopwatch

Array = npt.NDArray[np.float64]

#: Iterations after which a system is given up, and after which FGMRES starts anew.
LIMIT, RESTART = 500, 100
#: How well the random vector is to be reached.
ROUGHLY = 1e-2
#: A scaled system beyond this condition number has no digit left to trust.
SINGULAR = 1e14
ADVICE = (
    "Likely causes: particles that do not stiffen every function of the grid, cells with little of the "
    "body, or K much larger than mu in a form without a field for the volume; linear_solver='direct' "
    "says where"
)


@dataclass(frozen=True)
class Blocks:
    """What this rank's unknowns are.

    Attributes:
        displacement: Which of them belong to the displacement.
        rigid: Values of the three rigid motions for these, n x 3.
    """

    displacement: npt.NDArray[np.bool_]
    rigid: Array


class KrylovSolver:
    """Solves the tangents of one scene iteratively, with the interface of `linear.LinearSolver`.

    Args:
        comm: Communicator.
        stopwatch: Where the time goes.

    Attributes:
        symmetric: False; the symmetry of the tangent is of no use here.
        condition: Estimate of the condition number of the first tangent, scaled.
        weak: Empty.
        singular: False: a singular tangent is refused.
        iterations: FGMRES iterations of the last solve.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch) -> None:
        self._stopwatch = stopwatch
        self._handles = Handles(self, comm)
        self.condition, self.symmetric, self.iterations = 1.0, False, 0
        self.weak, self.singular, self._tried = np.empty(0), False, False

    def forget(self) -> None:
        """Free the preconditioner; the next solve makes a new one anyway."""
        self._handles.free()

    def solve(
        self,
        matrix: Any,
        scale: Callable[[], Array],
        right: Array,
        tolerance: float,
        blocks: Callable[[], Blocks],
    ) -> Array:
        """As `LinearSolver.solve`, always to the tolerance.

        Raises:
            SingularError: FGMRES did not get there.
        """
        self.forget()
        x, b = self._handles["x"], self._handles["b"] = matrix.createVecs()
        factors = scale()
        with self._stopwatch("scale"):
            x.setArray(factors)
            matrix.diagonalScale(x, x)
        with self._stopwatch("factorise"):
            ksp = self._preconditioned(matrix, factors, blocks())
        with self._stopwatch("solve"):
            if not self._tried:
                begin, end = matrix.getOwnershipRange()
                size = matrix.getSize()[0]
                b.setArray(np.random.default_rng(0).standard_normal(size)[begin:end])
                self._reach(ksp, b, x, ROUGHLY)
                norm = matrix.norm(PETSc.NormType.FROBENIUS)
                self.condition, self._tried = float(norm / np.sqrt(size) * x.norm()), True
                if not self.condition < SINGULAR:
                    raise SingularError(
                        f"the tangent is singular (condition number of the scaled matrix: about "
                        f"{self.condition:.1e}, from a random vector). {ADVICE}"
                    )
            b.setArray(factors * right)
            self._reach(ksp, b, x, tolerance)
        return np.asarray(factors * x.array)

    def _reach(self, ksp: Any, b: Any, x: Any, tolerance: float) -> None:
        ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=LIMIT)
        ksp.solve(b, x)
        self.iterations = ksp.getIterationNumber()
        if ksp.getConvergedReason() <= 0:
            reached = ksp.getResidualNorm() / b.norm()
            raise SingularError(
                f"FGMRES reached {reached:.1e} of the right-hand side in {self.iterations} iterations: "
                f"expected {tolerance:.1e}. {ADVICE}"
            )

    def _preconditioned(self, matrix: Any, factors: Array, blocks: Blocks) -> Any:
        ksp = self._handles["ksp"] = PETSc.KSP().create(matrix.comm)
        ksp.setOperators(matrix)
        ksp.setType("fgmres")
        ksp.setGMRESRestart(RESTART)
        pc = self._handles["pc"] = ksp.getPC()
        rigid = blocks.rigid / factors[blocks.displacement, None]
        if blocks.displacement.all():
            matrix.setNearNullSpace(self._near_null_space(rigid, matrix.comm))
            pc.setType("gamg")
            return ksp
        start = matrix.getOwnershipRange()[0]
        fields = []
        for name, where in (("u", blocks.displacement), ("p", ~blocks.displacement)):
            numbers = (start + np.flatnonzero(where)).astype(PETSc.IntType)
            rows = self._handles[name] = PETSc.IS().createGeneral(numbers, comm=matrix.comm)
            fields.append((name, rows))
        self._handles["u"].compose("nearnullspace", self._near_null_space(rigid, matrix.comm))
        pc.setType("fieldsplit")
        pc.setFieldSplitIS(*fields)
        pc.setFieldSplitType(PETSc.PC.CompositeType.MULTIPLICATIVE)
        pc.setUp()
        for solver, kind in zip(pc.getFieldSplitSubKSP(), ("gamg", "none"), strict=True):
            solver.setType("preonly")
            inner = solver.getPC()
            inner.setType(kind)
            inner.destroy()
            solver.destroy()
        return ksp

    def _near_null_space(self, rigid: Array, comm: Any) -> Any:
        basis, _ = np.linalg.qr(rigid)
        vectors = [PETSc.Vec().createWithArray(np.ascontiguousarray(c), comm=comm) for c in basis.T]
        space = self._handles["near null space"] = PETSc.NullSpace().create(
            vectors=vectors, comm=comm
        )
        for vector in vectors:
            vector.destroy()
        return space
