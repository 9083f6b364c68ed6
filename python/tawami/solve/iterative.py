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
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from tawami.base.errors import SingularError
from tawami.base.timing import Stopwatch
from tawami.solve.linear_solver import Blocks, Solver

Array = npt.NDArray[np.float64]

#: Iterations after which a system is given up, and after which FGMRES starts anew.
LIMIT, RESTART = 500, 100
#: How well the random vector is to be reached.
ROUGHLY = 1e-2
ADVICE = (
    "Likely causes: particles that do not stiffen every function of the grid, cells with little of the "
    "body, or K much larger than mu in a form without a field for the volume; linear_solver='direct' "
    "says where"
)


class KrylovSolver(Solver):
    """Solves the tangents of one scene iteratively, always to the tolerance; see `Solver`.

    Its `condition` is that of the first tangent, and a singular one is refused at once.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch) -> None:
        super().__init__(comm, stopwatch)
        self.symmetric, self._tried = False, False  # symmetry is of no use here

    def solve(
        self,
        matrix: Any,
        scale: Callable[[], Array],
        right: Array,
        tolerance: float,
        blocks: Callable[[], Blocks],
    ) -> Array:
        """As `Solver.solve`.

        Raises:
            SingularError: FGMRES did not get there, or the tangent is singular.
        """
        self._begin(matrix, scale)
        with self._stopwatch("factorise"):
            self._precondition(matrix, blocks())
        with self._stopwatch("solve"):
            if not self._tried:
                self._try(matrix)
            self._reach(self._scale * right, tolerance)
        return np.asarray(self._scale * self._handles["x"].array)

    def _try(self, matrix: Any) -> None:
        """A random right-hand side: condition number, or a refusal."""
        begin, end = matrix.getOwnershipRange()
        size = matrix.getSize()[0]
        self._reach(np.random.default_rng(0).standard_normal(size)[begin:end], ROUGHLY)
        norm = matrix.norm(PETSc.NormType.FROBENIUS)
        self.condition = float(norm / np.sqrt(size) * self._handles["x"].norm())
        self._tried = True
        if self.singular:
            raise SingularError(
                f"the tangent is singular (condition number of the scaled matrix: about "
                f"{self.condition:.1e}, from a random vector). {ADVICE}"
            )

    def _reach(self, right: Array, tolerance: float) -> None:
        if not self._fgmres(right, tolerance, LIMIT):
            reached = self._handles["ksp"].getResidualNorm() / self._handles["b"].norm()
            raise SingularError(
                f"FGMRES reached {reached:.1e} of the right-hand side in {self.iterations} iterations: "
                f"expected {tolerance:.1e}. {ADVICE}"
            )

    def _precondition(self, matrix: Any, blocks: Blocks) -> None:
        ksp = self._handles["ksp"] = PETSc.KSP().create(matrix.comm)
        ksp.setOperators(matrix)
        ksp.setType("fgmres")
        ksp.setGMRESRestart(RESTART)
        pc = self._handles["pc"] = ksp.getPC()
        rigid = blocks.rigid / self._scale[blocks.displacement, None]
        if blocks.displacement.all():
            matrix.setNearNullSpace(self._near_null_space(rigid, matrix.comm))
            pc.setType("gamg")
            return
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

    def _near_null_space(self, rigid: Array, comm: Any) -> Any:
        basis, _ = np.linalg.qr(rigid)
        vectors = [PETSc.Vec().createWithArray(np.ascontiguousarray(c), comm=comm) for c in basis.T]
        space = self._handles["near null space"] = PETSc.NullSpace().create(
            vectors=vectors, comm=comm
        )
        for vector in vectors:
            vector.destroy()
        return space
