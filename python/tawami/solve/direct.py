"""The scaled linear systems of a step by MUMPS, whose factorisation serves later tangents too.

A tangent is factorised (LDL^T if it is symmetric, LU otherwise) and solved directly. FGMRES solves the
following tangents to the given tolerance, with this factorisation as preconditioner. A tangent is
factorised again

- if it is another matrix, with other unknowns or another pattern;
- if the last solve took more than `PAYS` iterations, because a new factorisation is cheaper then;
- if FGMRES converges so slowly that a factorisation costs less than the iterations that are left.

The analysis of a matrix (ordering and symbolic factorisation) depends on its pattern alone. It serves
every factorisation of the same matrix.

Each factorisation also solves for random vectors p of standard normal numbers. The root mean square of
|A^-1 p| estimates the Frobenius norm of A^-1 (Kenney and Laub 1994), and the large entries of A^-1 p
show where a singular system is weak. So a singular tangent is noticed when it is factorised.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from petsc4py import PETSc

from tawami.base.arrays import Array
from tawami.base.errors import SingularError
from tawami.base.timing import Stopwatch
from tawami.solve import failures, memory
from tawami.solve.linear_solver import LinearSolver, System

#: Iterations of FGMRES up to which the factorisation is kept for the next tangent.
PAYS = 8
#: Iterations of FGMRES that cost as much as a factorisation, and those before the first comparison.
COST, TRIAL = 15, 3
#: Iterations at which FGMRES stops.
LIMIT = 25
#: Options of MUMPS (users' guide, ICNTL), by number. PETSc 3.18 takes them from its options only: of
#: calls before the analysis it keeps few. QAMD (7: 6) is the cheapest ordering for a first
#: factorisation (`cases.costs.ordering`). The system is scaled already (8: 0), and without a column
#: permutation (6: 0) the analysis reads no values.
PREFIX, OPTIONS = "tawami_direct_", {6: 0, 7: 6, 8: 0}
#: Memory above the estimate of MUMPS [percent], for delayed pivots; a singular matrix delays many.
ROOM = (50, 1000)
#: Number of random vectors. They cost little: the factors are read once for all right-hand sides.
PROBES = 3


class DirectSolver(LinearSolver):
    """Solver of the tangents of one scene by factorisations that serve several tangents.

    `symmetric`, `condition` and `weak` belong to the last factorised tangent. Its symmetry is tested by
    one product with a random vector. Its condition is infinite if MUMPS met a zero pivot.

    Args:
        comm: Communicator.
        stopwatch: Measures the time of each stage.
        always: Whether every tangent is factorised.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch, *, always: bool = False) -> None:
        super().__init__(comm, stopwatch)
        self._always, self._records = always, False
        self._matrix: Any = None
        #: The matrix whose analysis the factor holds, and whether it was analysed as a symmetric one.
        self._analysed: tuple[Any, bool] | None = None
        self._factorised: Array | None = None

    def forget(self) -> None:
        """Free the factorisation; the next solve makes a new one."""
        super().forget()
        self._analysed = None
        self._matrix, self._factorised = None, None

    def _begin(self, matrix: Any, scale: Callable[[], Array]) -> None:
        """See `LinearSolver._begin`; the analysis of the same matrix is kept."""
        if self._analysed is None or self._analysed[0] is not matrix:
            super()._begin(matrix, scale)
            return
        self._matrix, self._factorised = None, None
        self._rescale(matrix, scale)

    def successor(self) -> LinearSolver:
        """This solver without its factorisation. The analysis serves as long as the matrix is used."""
        self._matrix, self._factorised, self._records = None, None, False
        self.condition, self.symmetric, self.iterations = 1.0, True, 0
        return self

    def method(self, unknowns: int) -> str:
        """See `LinearSolver.method`."""
        when = "always" if self._always else "when it pays"
        return f"direct (LDL^T of symmetric tangents), factorised {when}"

    def record(self) -> None:
        """Copy each matrix that is factorised from now on, for :meth:`state`.

        The next tangent is factorised, so that no copy is missing.
        """
        self._records = True
        self.forget()

    def state(self) -> dict[str, Any] | None:
        """The factorised matrix, from which the same factorisation is made again, to the bit.

        None without a factorisation, and on several ranks.
        """
        if self._factorised is None:
            return None
        scalars = {name: getattr(self, name) for name in ("iterations", "condition", "symmetric")}
        return {"matrix": self._factorised, "scale": self._scale, "weak": self.weak, **scalars}

    def restore(self, state: Mapping[str, Any], matrix: Any) -> None:
        """Factorise the matrix of a :meth:`state` again.

        Args:
            state: The state.
            matrix: A matrix of the same pattern, whose values do not change.
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

    def solve(self, system: System) -> Array:
        """See `LinearSolver.solve`; direct if the tangent is factorised.

        Raises:
            SingularError: The tangent is singular, and so is its neighbour, or it holds NaN.
            SolverError: Memory ran out, or MUMPS failed for a reason other than a singular matrix.
        """
        matrix, right = system.matrix, system.right
        if not self._always and self._matrix is matrix and self.iterations <= PAYS:
            self._multiply(matrix, self._scale)
            solution = self._iterate(right, system.tolerance)
            if solution is not None:
                return solution
            self._multiply(matrix, 1 / self._scale)
        self._begin(matrix, system.scale)
        return self._direct(matrix, right)

    def _iterate(self, right: Array, tolerance: float) -> Array | None:
        """Solve by FGMRES with the present factorisation; None if it takes too many iterations."""
        with self._stopwatch("solve"):
            self._handles["ksp"].setConvergenceTest(_Pays(tolerance))
            converged = self._krylov(self._scale * right, tolerance, LIMIT)
            self._handles["ksp"].setConvergenceTest(None)
            if not converged:
                return None
            return np.asarray(self._scale * self._handles["x"].array)

    def _direct(self, matrix: Any, right: Array) -> Array:
        """Factorise and solve; estimate the condition number and its direction."""
        begin, end = matrix.getOwnershipRange()
        size = matrix.getSize()[0]
        probes = _probes(size)[:, begin:end]
        with self._stopwatch("scale"):
            self.symmetric = self._is_symmetric(matrix, probes[0])
        with self._stopwatch("factorise"):
            norm = matrix.norm(PETSc.NormType.FROBENIUS)
            if self._records and matrix.comm.size == 1:
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
                    self.condition = np.inf
                    raise SingularError(
                        "the tangent is singular, and so is its neighbour (shift 1e-12)"
                    )
        with self._stopwatch("solve"):
            y, *weak = self._solve_all(np.vstack([self._scale * right, probes]))
            norms = [self._norm(direction) for direction in weak]
            self.weak = weak[int(np.argmax(norms))]
            # root mean square of the row norms, which the scaling makes alike
            estimate = float(norm / np.sqrt(size) * np.sqrt(np.mean(np.square(norms))))
            self.condition = np.inf if failed else estimate
        self._matrix, self.iterations = matrix, 0
        return np.asarray(self._scale * y)

    def _factorise(self, matrix: Any) -> bool:
        """Factorise a matrix; False if a pivot is zero."""
        for room in ROOM:
            code, detail = self._mumps(matrix, room)
            if code < 0:
                self._analysed = None
            if code != -9:
                break
        if code < 0 and code not in failures.SINGULAR:
            raise failures.of_mumps(code, detail, "factorise", matrix.getSize()[0])
        return code >= 0

    def _mumps(self, matrix: Any, room: int) -> tuple[int, int]:
        """Factorise with memory above the estimate [percent]; error code of MUMPS and its detail."""
        analysed, symmetric = self._analysed or (None, False)
        if analysed is not matrix or symmetric != self.symmetric:
            self._analyse_next(matrix, room)
        ksp, pc, factor = (self._handles[name] for name in ("ksp", "pc", "factor"))
        pc.setReusePreconditioner(False)
        ksp.setOperators(matrix)
        ksp.setUp()
        pc.setReusePreconditioner(True)
        return int(factor.getMumpsInfog(1)), int(factor.getMumpsInfog(2))

    def _analyse_next(self, matrix: Any, room: int) -> None:
        """Make a factor that the next factorisation analyses."""
        size = matrix.getSize()[0]
        need = memory.of_factors(size, symmetric=self.symmetric)
        memory.check(matrix.comm.tompi4py(), "a factorisation", size, need, failures.ADVICE)
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
        factor.setOptionsPrefix(PREFIX)
        options = PETSc.Options(PREFIX)
        for number, value in OPTIONS.items():
            options[f"mat_mumps_icntl_{number}"] = value
        factor.setMumpsIcntl(14, room)
        self._analysed = matrix, self.symmetric

    def _solve_all(self, right: Array) -> Array:
        """Solve for several right-hand sides, one per row."""
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


class _Pays:
    """Test of convergence that also stops FGMRES when a factorisation costs less than the rest.

    Args:
        tolerance: Of the residual, relative to the first one.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance, self._first = tolerance, 0.0

    def __call__(self, ksp: Any, iteration: int, norm: float) -> int:
        """Reason to stop, as PETSc numbers them; 0 to continue."""
        if iteration == 0:
            self._first = norm
        target = self._tolerance * self._first
        if norm <= target:
            return int(PETSc.KSP.ConvergedReason.CONVERGED_RTOL)
        if not norm < self._first:  # NaN as well
            return int(PETSc.KSP.ConvergedReason.DIVERGED_DTOL) if iteration >= TRIAL else 0
        if iteration >= TRIAL:
            rate = np.log(self._first / norm) / iteration
            if np.log(norm / target) > COST * rate or iteration >= LIMIT:
                return int(PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT)
        return 0


@functools.lru_cache(maxsize=1)
def _probes(size: int) -> Array:
    """Random vectors for the condition number, the same in every factorisation."""
    return np.random.default_rng(0).standard_normal((PROBES, size))
