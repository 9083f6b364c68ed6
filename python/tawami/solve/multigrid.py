"""The scaled linear systems of a step by GMRES with multigrid.

GMRES takes the fields one after the other, with the coupling to those before: a block-triangular
preconditioner (Elman, Silvester, Wathen 2014, chapter 4).

displacement   a V-cycle for the elastic operator F of `operators`. The grids have cells of side h, 2h,
               4h, ...; functions of each are sums of those of the next finer one (two-scale relation),
               and their matrices are P^T F P. A sweep of Gauss and Seidel, forwards and backwards,
               smooths after the coarser grids: it needs no residual, and as few iterations as sweeps
               before and after
volume         steps of Chebyshev's iteration for S = M/2 + (mu/K) M + alpha h^2 L. M/2 is B F^-1 B^T of
               most fields: u = grad phi has (div u)^2 = eps : eps
other fields   a V-cycle for their part of the tangent, and what the displacement adds once it is
               eliminated, -K_fu F^-1 K_uf: a mass matrix with the diagonal of -K_fu K_uf, where the
               body is stiffer by its bulk modulus (the fixed-stress split of a pore pressure)
multipliers    of constraints: division by their diagonal. The operators of the fields have the
               constraints as a penalty (augmented Lagrangian preconditioner)

The operators are those of the elastic body. They serve later tangents of the same unknowns until the
number of iterations grows. GMRES takes 2/3 of the iterations of MINRES with one preconditioner for each
field, for symmetric tangents too, and its vectors little memory beside the matrices.
"""

from __future__ import annotations

import math
from itertools import zip_longest
from typing import Any

import numpy as np
from petsc4py import PETSc

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.petsc import Handles, diagonal_of
from tawami.base.timing import Stopwatch
from tawami.field.prolongation import coarser
from tawami.solve import memory
from tawami.solve.blocks import add, constrained, coupling_of, row_sum, scale, set_options
from tawami.solve.linear_solver import LinearSolver, System
from tawami.solve.numerics import SMALL
from tawami.solve.operators import Part

#: Iterations at which GMRES stops, and after which it restarts.
LIMIT, RESTART = 200, 100
#: Steps of Chebyshev's iteration, and the ratio of the eigenvalues that it damps.
STEPS, RATIO = 5, 12.0
#: Growth of the number of iterations from which the operators are made again.
GROWTH, MORE = 1.5, 5
#: Name of unknowns that belong to no field.
MULTIPLIERS = "multipliers"
#: Tolerance for a second right-hand side, relative to that of the first.
AGAIN = 1e-4
#: Tolerance of the solve for a random vector, by which a singular tangent is noticed: less than the
#: share of one mode in a random vector of `SMALL` unknowns.
LOW_TOLERANCE = 1e-3


class StalledError(Exception):
    """GMRES does not converge."""


class MultigridSolver(LinearSolver):
    """Solver of the tangents of one scene by GMRES, always to the tolerance.

    Its `condition` belongs to the first tangent.

    Args:
        comm: Communicator.
        stopwatch: Measures the time of each stage.
        cells: Number of cells along each axis of the grid.

    Attributes:
        first: Iterations of the first solve with the present operators, for each digit.
        made: Whether the last solve made them.
    """

    def __init__(self, comm: Any, stopwatch: Stopwatch, cells: tuple[int, ...]) -> None:
        super().__init__(comm, stopwatch)
        self._cells = cells
        self._tested, self._matrix = False, None
        self.first = self._digits = 0.0
        self.made = False
        self._grids: list[Handles] = []
        self._parts: list[Part] = []
        self._records = False

    def forget(self) -> None:
        """See `LinearSolver.forget`."""
        super().forget()
        for handles in self._grids:
            handles.free()
        self._grids, self._parts, self._matrix = [], [], None

    def successor(self) -> LinearSolver:
        """This solver: its operators serve as long as the matrix is used."""
        return self

    def record(self) -> None:
        """See `LinearSolver.record`: each step then makes its own operators."""
        self._records = True
        self.forget()

    def begin(self) -> None:
        """See `LinearSolver.begin`."""
        if self._records:
            self.forget()

    def method(self, unknowns: int) -> str:
        """See `LinearSolver.method`."""
        sizes = [self._cells, coarser(self._cells), coarser(coarser(self._cells))]
        grids = ", ".join(" x ".join(map(str, size)) for size in dict.fromkeys(sizes))
        return f"multigrid (GMRES, grids of {grids} cells and coarser)"

    def solve(self, system: System) -> Array:
        """See `LinearSolver.solve`.

        Raises:
            StalledError: GMRES did not converge, or the tangent is singular. The matrix
                is as it was.
        """
        matrix = system.matrix
        pays = self.iterations <= GROWTH * self.first * self._digits + MORE
        if self._matrix is matrix and pays:
            self._multiply(matrix, self._scale)
        else:
            self._begin(matrix, system.scale)
            self._matrix, self.first = matrix, 0.0
        with self._stopwatch("factorise"):
            self.made = "ksp" not in self._handles
            if self.made:
                size = matrix.getSize()[0]
                memory.check(
                    matrix.comm.tompi4py(), "multigrid", size, memory.of_multigrid(matrix),
                    "Use fewer cells, or more ranks on computers with more memory",
                )  # fmt: skip
                self._precondition(matrix, system.parts())
            else:
                self._refresh(matrix)
            self._handles["ksp"].setOperators(matrix, self._handles["parts"])
            if self.made:
                self.symmetric = self._is_symmetric(matrix, self._probe(matrix))
        try:
            with self._stopwatch("solve"):
                if not self._tested:
                    self._test(matrix)
                self._converge(self._scale * system.right, system.tolerance)
        except StalledError:
            self._multiply(matrix, 1 / self._scale)
            if self.made:
                raise
            self._matrix = None  # contact or inertia may have changed since the operators were made
            return self.solve(system)
        self._digits = -math.log10(system.tolerance)
        self.first = self.first or self.iterations / self._digits
        return np.asarray(self._scale * self._handles["x"].array)

    def again(self, right: Array, tolerance: float) -> Array:
        """See `LinearSolver.again`; more digits, because the equations of a border cancel."""
        return super().again(right, AGAIN * tolerance)

    def _probe(self, matrix: Any) -> Array:
        begin, end = matrix.getOwnershipRange()
        size = matrix.getSize()[0]
        return np.asarray(np.random.default_rng(0).standard_normal(size)[begin:end])

    def _test(self, matrix: Any) -> None:
        """Estimate the condition number from a random right-hand side; raise an error if singular.

        In a small system GMRES also meets modes that the preconditioner does not know, such as those of
        an hourglass. Their share of a random vector is too small to be seen in a large one.
        """
        ksp, x, b = (self._handles[name] for name in ("ksp", "x", "b"))
        norm, size = matrix.norm(PETSc.NormType.FROBENIUS), matrix.getSize()[0]
        if size < SMALL:
            self._converge(self._probe(matrix), LOW_TOLERANCE)
        else:
            b.setArray(self._probe(matrix))
            ksp.setUp()
            self._handles["pc"].apply(b, x)
        self.condition = float(norm / np.sqrt(size) * x.norm())
        self._tested = True
        if self.singular:
            raise StalledError(
                "the tangent is singular (condition number of the scaled matrix: about "
                f"{self.condition:.1e}, from a random vector)"
            )

    def _krylov(self, right: Array, tolerance: float, limit: int) -> bool:
        """See `LinearSolver._krylov`; the vectors of GMRES are freed if it converges."""
        ksp = self._handles["ksp"]
        ksp.setGMRESRestart(RESTART)
        converged = super()._krylov(right, tolerance, limit)
        ksp.setGMRESRestart(1 if converged else RESTART)
        return converged

    def _converge(self, right: Array, tolerance: float) -> None:
        if not self._krylov(right, tolerance, LIMIT):
            residual = self._handles["ksp"].buildResidual()
            reached = residual.norm() / self._handles["b"].norm()
            residual.destroy()
            raise StalledError(
                f"multigrid stalls: GMRES reached {reached:.1e} of the right-hand side in "
                f"{self.iterations} iterations where {tolerance:.1e} was expected"
            )

    def _precondition(self, matrix: Any, parts: list[Part]) -> None:
        """Make the operators of all fields, and GMRES."""
        handles, comm, self._parts = self._handles, matrix.comm, parts
        handles.free("ksp", "pc", "parts")
        own = np.arange(*matrix.getOwnershipRange())
        numbers = [own[: len(part.block.mine)][part.block.mine] for part in parts]
        names = [part.name for part in parts]
        if matrix.getSize()[0] > sum(part.block.size for part in parts):
            numbers.append(np.setdiff1d(own, np.concatenate(numbers)))
            names.append(MULTIPLIERS)
        places = [PETSc.IS().createGeneral(mine.astype(PETSc.IntType), comm) for mine in numbers]
        handles.update(
            {f"place of {name}": place for name, place in zip(names, places, strict=True)}
        )
        operators = [
            self._operator(matrix, part, place, places[0])
            for part, place in zip(parts, places, strict=False)
        ]
        if len(places) > len(parts):
            operators.append(constrained(matrix, operators, places))
        handles["parts"] = operators[0]
        if len(places) > 1:
            rows: list[list[Any]] = [[None] * len(places) for _ in places]
            for k, operator in enumerate(operators):
                rows[k][k] = operator
                for j in range(k):
                    rows[k][j] = matrix.createSubMatrix(places[k], places[j])
                    handles[f"{names[k]} by {names[j]}"] = rows[k][j]
            handles["parts"] = PETSc.Mat().createNest(rows, comm=comm)
        ksp = handles["ksp"] = PETSc.KSP().create(comm)
        ksp.setOperators(matrix, handles["parts"])
        ksp.setType("gmres")
        ksp.setPCSide(PETSc.PC.Side.RIGHT)
        # near a singular tangent, vectors that are not orthogonal let the residual grow; the modified
        # process of Gram and Schmidt takes less time, but does not suffice there
        set_options(ksp, {"ksp_gmres_cgs_refinement_type": "refine_ifneeded"})
        pc = handles["pc"] = ksp.getPC()
        if len(places) == 1:
            self._cycle(pc, operators[0], parts[0])
        else:
            pc.setType("fieldsplit")
            pc.setFieldSplitType(PETSc.PC.CompositeType.MULTIPLICATIVE)
            pc.setFieldSplitIS(*zip(names, places, strict=True))
            pc.setUp()
            for solver, operator, part in zip_longest(pc.getFieldSplitSubKSP(), operators, parts):
                if part is not None and part.volume:
                    handles["chebyshev"] = solver
                    self._chebyshev(operator)
                    continue
                solver.setType("preonly")
                inner = solver.getPC()
                if part is None:
                    inner.setType("jacobi")
                else:
                    self._cycle(inner, operator, part)
                inner.destroy()
                solver.destroy()
        pc.setReusePreconditioner(True)

    def _refresh(self, matrix: Any) -> None:
        """Take the parts of another tangent, without the V-cycles. They cost little and change much."""
        handles = self._handles
        names = [*(part.name for part in self._parts), MULTIPLIERS]
        for k, name in enumerate(names):
            for other in names[:k] if f"place of {name}" in handles else ():
                places = [handles[f"place of {each}"] for each in (name, other)]
                matrix.createSubMatrix(*places, handles[f"{name} by {other}"])
        for part in self._parts:
            place = handles[f"place of {part.name}"]
            if part.mass is not None:
                own = handles[f"{part.name} by itself"]
                matrix.createSubMatrix(place, place, own)
                add(own, part.mass)
            if part.volume:
                self._chebyshev(own)

    def _operator(self, matrix: Any, part: Part, place: Any, of_u: Any) -> Any:
        """Scaled operator of a field; `of_u` are the places of the displacement."""
        if part.operator is not None:
            scale(part.operator, self._scale[: len(part.block.mine)][part.block.mine])
            return part.operator
        own = self._handles[f"{part.name} by itself"] = matrix.createSubMatrix(place, place)
        if part.mass is None:
            return own
        coupling: Any = -1.0  # of the volume, by its scaling
        if not part.volume:
            coupling = part.share * coupling_of(matrix, place, of_u)
        sign = float(np.sign(ranks.total(matrix.comm.tompi4py(), float(np.sum(coupling)))))
        size = np.maximum(diagonal_of(part.mass), np.finfo(float).tiny)
        scale(part.mass, np.sqrt(0.5 * np.abs(coupling) / size))
        part.mass.scale(sign)
        add(own, part.mass)
        return own

    def _chebyshev(self, operator: Any) -> None:
        """Set up Chebyshev's iteration with Jacobi's preconditioner for the volume."""
        solver = self._handles["chebyshev"]
        solver.setType("chebyshev")
        solver.setNormType(PETSc.KSP.NormType.NONE)
        solver.setTolerances(max_it=STEPS)
        inner = solver.getPC()
        inner.setType("jacobi")
        inner.destroy()
        largest = row_sum(operator)
        set_options(solver, {"ksp_chebyshev_eigenvalues": f"{largest / RATIO},{largest}"})
        solver.setUp()

    def _cycle(self, pc: Any, operator: Any, part: Part) -> None:
        """Make a V-cycle of a preconditioner."""
        handles = Handles(self, operator.comm.tompi4py())
        self._grids.append(handles)
        steps = part.block.prolongations()
        operators = [operator]
        for k, step in enumerate(steps):
            handles[f"prolongation {k}"] = step
            if k == 0:
                vector = operator.createVecLeft()
                vector.setArray(1 / self._scale[: len(part.block.mine)][part.block.mine])
                step.diagonalScale(vector, None)
                vector.destroy()
            operators.append(operators[-1].PtAP(step))
            handles[f"operator {k + 1}"] = operators[-1]
        pc.setType("mg")
        pc.setMGLevels(len(operators))
        pc.setMGType(PETSc.PC.MGType.KASKADE)
        for level, matrix in enumerate(reversed(operators)):
            if level == 0:
                coarse = pc.getMGCoarseSolve()
                coarse.setOperators(matrix)
                coarse.setType("preonly")
                set_options(coarse, {"pc_type": "redundant"})
                coarse.destroy()
                continue
            pc.setMGInterpolation(level, steps[len(operators) - 1 - level])
            smoother = pc.getMGSmoother(level)
            smoother.setOperators(matrix)
            smoother.setType("richardson")
            smoother.setNormType(PETSc.KSP.NormType.NONE)
            smoother.setTolerances(max_it=1)
            set_options(smoother, {"pc_type": "sor", "pc_sor_local_symmetric": None})
            smoother.destroy()
        pc.setUp()
