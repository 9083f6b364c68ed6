"""The scaled linear systems of a step, solved by MUMPS, whose factorisation is kept and reused.

A tangent is factorised (LDL^T where it is symmetric, LU otherwise) and solved directly; the ones
that follow are solved by FGMRES with that factorisation as preconditioner, to the tolerance asked
for. A tangent is factorised again

- if it is another matrix: other unknowns, another pattern;
- if the last solve took more than `PAYS` iterations: from there a new factorisation is cheaper;
- if FGMRES does not get there within `LIMIT` iterations.

With the right-hand side, random vectors are solved for at each factorisation: the rms of `||A^-1 p||`
over vectors p of standard normal numbers estimates the Frobenius norm of A^-1 (Kenney and Laub 1994),
and the large entries of `A^-1 p` say where a singular system is weak. Whether a tangent is singular is
judged where it is factorised.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from tawami.base.errors import SingularError
from tawami.base.timing import Stopwatch
from tawami.solve.linear_solver import Blocks, Solver

Array = npt.NDArray[np.float64]

#: Iterations of FGMRES that are worth less than a factorisation, and the most there may be.
PAYS, LIMIT = 8, 15
#: Percent of memory more than MUMPS foresees, for delayed pivots; a singular matrix delays many.
ROOM = (50, 1000)
#: Random vectors; the factors are read once for all right-hand sides, so they cost little.
PROBES = 3


class LinearSolver(Solver):
    """Solves the tangents of one scene by factorisations that are kept; see `Solver`.

    `symmetric`, `condition` and `weak` are of the tangent last factorised: whether it is symmetric was
    probed by one product with a random vector; the condition is infinite where it met a zero pivot.

    Args:
        comm: Communicator.
        stopwatch: Where the time goes.
        always: Whether every tangent is factorised.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch, *, always: bool = False) -> None:
        super().__init__(comm, stopwatch)
        self._always, self._keeps = always, False
        self._matrix: Any = None
        self._factorised: Array | None = None

    def forget(self) -> None:
        """Free the factorisation; the next solve makes a new one."""
        super().forget()
        self._matrix, self._factorised = None, None

    def keep(self) -> None:
        """Keep a copy of each matrix that is factorised from now on, for :meth:`state`; so that none is
        missing, the next solve makes a new one.
        """
        self._keeps = True
        self.forget()

    def state(self) -> dict[str, Any] | None:
        """What makes the factorisation again, to the bit; None where there is none, or several ranks
        have it.
        """
        if self._factorised is None:
            return None
        scalars = {name: getattr(self, name) for name in ("iterations", "condition", "symmetric")}
        return {"matrix": self._factorised, "scale": self._scale, "weak": self.weak, **scalars}

    def restore(self, state: Mapping[str, Any], matrix: Any) -> None:
        """The reverse of :meth:`state`.

        Args:
            state: What it gave.
            matrix: Of the same pattern; it keeps its values.
        """
        start, columns, values = (np.array(part) for part in matrix.getValuesCSR())
        self._begin(matrix, lambda: np.asarray(state["scale"]))
        self.symmetric, self.weak = state["symmetric"], state["weak"]
        self._set(matrix, start, columns, state["matrix"])
        if self._factorise(matrix):
            self.condition, self.iterations = state["condition"], state["iterations"]
            self._matrix, self._factorised = matrix, state["matrix"]
        self._set(matrix, start, columns, values)

    @staticmethod
    def _set(matrix: Any, start: Array, columns: Array, values: Array) -> None:
        matrix.setValuesCSR(start, columns, values)
        matrix.assemble()

    def solve(
        self,
        matrix: Any,
        scale: Callable[[], Array],
        right: Array,
        tolerance: float,
        blocks: Callable[[], Blocks],
    ) -> Array:
        """As `Solver.solve`; direct where the tangent is factorised.

        Raises:
            SingularError: The factorisation ran out of memory or failed for another reason than a
                singular matrix.
        """
        if not self._always and self._matrix is matrix and self.iterations <= PAYS:
            self._multiply(matrix, self._scale)
            solution = self._iterate(right, tolerance)
            if solution is not None:
                return solution
            self._multiply(matrix, 1 / self._scale)
        self._begin(matrix, scale)
        return self._direct(matrix, right)

    def _iterate(self, right: Array, tolerance: float) -> Array | None:
        """By FGMRES with the factorisation that is there; None if it takes too long."""
        with self._stopwatch("solve"):
            if not self._fgmres(self._scale * right, tolerance, LIMIT):
                return None
            return np.asarray(self._scale * self._handles["x"].array)

    def _direct(self, matrix: Any, right: Array) -> Array:
        """By a new factorisation; the condition number and its direction with it."""
        begin, end = matrix.getOwnershipRange()
        size = matrix.getSize()[0]
        probes = np.random.default_rng(0).standard_normal((PROBES, size))[:, begin:end]
        with self._stopwatch("scale"):
            self.symmetric = self._is_symmetric(matrix, probes[0])
        with self._stopwatch("factorise"):
            norm = matrix.norm(PETSc.NormType.FROBENIUS)
            if self._keeps and matrix.comm.size == 1:
                self._factorised = np.array(matrix.getValuesCSR()[2])
            if not np.isfinite(norm):
                raise SingularError(
                    "the tangent holds NaN or infinity where the residual does not: a derivative that "
                    "does not exist at this point, such as that of sqrt or abs at zero?"
                )
            failed = not self._factorise(matrix)
            if failed:
                matrix.shift(1e-12)
                if not self._factorise(matrix):
                    raise SingularError(
                        "the tangent is singular, and so is its neighbour (shift 1e-12)"
                    )
        with self._stopwatch("solve"):
            y, *weak = self._solve_all(np.vstack([self._scale * right, probes]))
            norms = [self._norm(direction) for direction in weak]
            self.weak = weak[int(np.argmax(norms))]
            # rms of the row norms, which the scaling makes alike
            estimate = float(norm / np.sqrt(size) * np.sqrt(np.mean(np.square(norms))))
            self.condition = np.inf if failed else estimate
        self._matrix, self.iterations = matrix, 0
        return np.asarray(self._scale * y)

    def _factorise(self, matrix: Any) -> bool:
        """False if a pivot was zero."""
        for room in ROOM:
            code, detail = self._mumps(matrix, room)
            if code != -9:
                break
        if code < 0 and code not in (-10, -6):
            raise SingularError(
                f"MUMPS could not factorise the tangent (INFOG(1) = {code}, INFOG(2) = {detail}): see "
                "the MUMPS users' guide; -9 and -13 mean that memory is short"
            )
        return code >= 0

    def _mumps(self, matrix: Any, room: int) -> tuple[int, int]:
        """Factorise with so many percent of memory more than foreseen; what MUMPS says of it."""
        self._handles.free("factor", "pc", "ksp")
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
        ksp = self._handles["ksp"] = PETSc.KSP().create(matrix.comm)
        ksp.setOperators(matrix)
        ksp.setType("fgmres")
        ksp.setGMRESRestart(LIMIT)
        pc = self._handles["pc"] = ksp.getPC()
        pc.setType("cholesky" if self.symmetric else "lu")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        factor = self._handles["factor"] = pc.getFactorMatrix()
        factor.setMumpsIcntl(7, 0)  # AMD: the cheapest first factorisation
        factor.setMumpsIcntl(14, room)
        ksp.setUp()
        pc.setReusePreconditioner(True)
        return int(factor.getMumpsInfog(1)), int(factor.getMumpsInfog(2))

    def _solve_all(self, right: Array) -> Array:
        """Solutions for several right-hand sides, each a row."""
        factor = self._handles["factor"]
        count, n = right.shape
        size = ((n, PETSc.DETERMINE), (PETSc.DECIDE, count))
        b = PETSc.Mat().createDense(size, array=right.ravel(), comm=factor.comm)
        x = b.duplicate()
        factor.matSolve(b, x)
        solutions = np.array(x.getDenseArray()).T
        b.destroy(), x.destroy()
        return solutions

    def _norm(self, vector: Array) -> float:
        x = self._handles["x"]
        x.setArray(vector)
        return float(x.norm())

    def _is_symmetric(self, matrix: Any, probe: Array) -> bool:
        x, y = (self._handles[name] for name in ("x", "b"))
        x.setArray(probe)
        matrix.mult(x, y)
        forward = y.copy()
        matrix.multTranspose(x, y)
        size = forward.norm()
        y.axpy(-1.0, forward)
        forward.destroy()
        return bool(y.norm() <= 1e-12 * size)
