"""The scaled linear systems of a step by FGMRES with a preconditioner for each field.

Smoothed-aggregation multigrid with the rigid modes preconditions the displacement. eps_v or p, scaled
as p/mu (docs: theory), need no preconditioner: their Schur complement is near the identity. It is
farther from the identity for small alpha: 20 to 50 iterations with alpha = 0.1, up to 130 with 0.01, for
any Poisson's ratio. Multigrid preconditions each field without a role.

FGMRES also solves a singular system whose right-hand side is in its range. So the first system is also
solved, to a low tolerance, for a random vector, which is in the range of no singular matrix. That
solution estimates the condition number as in `direct`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import SingularError
from tawami.base.timing import Stopwatch
from tawami.solve.linear_solver import Blocks, LinearSolver

#: Iterations at which FGMRES stops, and after which it restarts.
LIMIT, RESTART = 500, 100
#: Tolerance of the solve for the random vector.
LOW_TOLERANCE = 1e-2
ADVICE = (
    "Likely causes: functions of the grid that get no stiffness from the particles, cells with little "
    "of the body, or K much larger than mu in a form without a field for the volume; "
    "linear_solver='direct' names the cells"
)


class IterativeSolver(LinearSolver):
    """Solver of the tangents of one scene by FGMRES, always to the tolerance.

    Its `condition` belongs to the first tangent; if this is singular, the solver raises an error.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch) -> None:
        super().__init__(comm, stopwatch)
        self.symmetric, self._tested = False, False  # FGMRES makes no use of symmetry

    def solve(
        self,
        matrix: Any,
        scale: Callable[[], Array],
        right: Array,
        tolerance: float,
        blocks: Callable[[], Blocks],
    ) -> Array:
        """See `LinearSolver.solve`.

        Raises:
            SingularError: FGMRES did not converge, or the tangent is singular.
        """
        self._begin(matrix, scale)
        with self._stopwatch("factorise"):
            self._precondition(matrix, blocks())
        with self._stopwatch("solve"):
            if not self._tested:
                self._test(matrix)
            self._converge(self._scale * right, tolerance)
        return np.asarray(self._scale * self._handles["x"].array)

    def _test(self, matrix: Any) -> None:
        """Estimate the condition number from a random right-hand side; raise an error if singular."""
        begin, end = matrix.getOwnershipRange()
        size = matrix.getSize()[0]
        random = np.random.default_rng(0).standard_normal(size)[begin:end]
        self._converge(random, LOW_TOLERANCE)
        norm = matrix.norm(PETSc.NormType.FROBENIUS)
        self.condition = float(norm / np.sqrt(size) * self._handles["x"].norm())
        self._tested = True
        if self.singular:
            raise SingularError(
                f"the tangent is singular (condition number of the scaled matrix: about "
                f"{self.condition:.1e}, from a random vector). {ADVICE}"
            )

    def _converge(self, right: Array, tolerance: float) -> None:
        if not self._fgmres(right, tolerance, LIMIT):
            self.condition = np.inf
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
        # a rank may be without unknowns
        if matrix.comm.tompi4py().allreduce(bool(blocks.displacement.all()), op=MPI.LAND):
            matrix.setNearNullSpace(self._near_null_space(rigid, matrix.comm))
            pc.setType("gamg")
            return
        start = matrix.getOwnershipRange()[0]
        volume = ~np.logical_or.reduce([blocks.displacement, *blocks.own])
        splits = [("u", blocks.displacement, "gamg"), ("p", volume, "none")]
        splits += [(f"field {k}", mine, "gamg") for k, mine in enumerate(blocks.own)]
        fields, kinds = [], []
        for name, where, kind in splits:
            if not matrix.comm.tompi4py().allreduce(bool(where.any()), op=MPI.LOR):
                continue
            numbers = (start + np.flatnonzero(where)).astype(PETSc.IntType)
            rows = self._handles[name] = PETSc.IS().createGeneral(numbers, comm=matrix.comm)
            fields.append((name, rows))
            kinds.append(kind)
        self._handles["u"].compose("nearnullspace", self._near_null_space(rigid, matrix.comm))
        pc.setType("fieldsplit")
        pc.setFieldSplitIS(*fields)
        pc.setFieldSplitType(PETSc.PC.CompositeType.MULTIPLICATIVE)
        pc.setUp()
        for solver, kind in zip(pc.getFieldSplitSubKSP(), kinds, strict=True):
            solver.setType("preonly")
            inner = solver.getPC()
            inner.setType(kind)
            inner.destroy()
            solver.destroy()

    def _near_null_space(self, rigid: Array, comm: Any) -> Any:
        basis = _orthonormal(comm.tompi4py(), rigid)
        vectors = [PETSc.Vec().createWithArray(np.ascontiguousarray(c), comm=comm) for c in basis.T]
        space = self._handles["near null space"] = PETSc.NullSpace().create(
            vectors=vectors, comm=comm
        )
        for vector in vectors:
            vector.destroy()
        return space


def _orthonormal(comm: Any, rows: Array) -> Array:
    """Orthonormal basis of the columns that the rows of all ranks form; the rows of this rank."""
    mine, factor = np.linalg.qr(rows)
    others = comm.allgather(len(factor))
    joint, _ = np.linalg.qr(ranks.allgathered(comm, factor))
    start = sum(others[: comm.rank])
    return np.asarray(mine @ joint[start : start + len(factor)])
