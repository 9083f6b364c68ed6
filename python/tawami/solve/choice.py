"""The choice of a linear solver for each tangent, by size and by what the last solves cost.

Costs are counted in iterations of multigrid, not in seconds, so that a run repeats to the bit:

- below `SMALL` unknowns, and where multigrid does not suit the form, the tangent is factorised. A scene
  that names multigrid has it for every size, and a warning where it does not suit;
- otherwise multigrid solves. Once its iterations for the same unknowns have cost as much as three
  factorisations, some tangents are solved with a factorisation, which later ones use. Then the method
  whose last solves cost less is taken, and multigrid at once where it costs less than a solve with an
  old factorisation;
- where multigrid stalls, the direct solver takes over, with a warning.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami.base.arrays import Array
from tawami.base.errors import SolverWarning
from tawami.base.timing import Stopwatch
from tawami.base.warn import warn
from tawami.solve import memory
from tawami.solve.direct import DirectSolver
from tawami.solve.linear_solver import LinearSolver, System
from tawami.solve.multigrid import MultigridSolver, StalledError
from tawami.solve.numerics import SMALL, Numerics
from tawami.solve.operators import LOCKING

#: Iterations of multigrid that cost as much as a factorisation of 1e5 unknowns, and the exponent with
#: which this number grows with the unknowns (`cases.costs.solvers`).
FACTORISATION, EXPONENT = 36.0, 0.16
#: Factor of this number without symmetry.
UNSYMMETRIC = 1.3
#: Iterations of multigrid that cost as much as one with an old factorisation.
KEPT = 2.3
#: Iterations with an old factorisation that is a good one.
GOOD = 4
#: Solves with a factorisation before its mean cost counts, and solves after which older ones count half.
TRIAL, MEMORY = 4, 32
#: Iterations that the operators of multigrid cost.
SET_UP = 18
#: Factorisations that the iterations for the same unknowns may cost before one is tried: the functions
#: of a moving body change after a few steps, and its factorisation would not be kept for long.
PATIENCE = 3
#: Attributes that a checkpoint stores.
STATE = ("spent", "stalled", "stalls", "kept_cost")


def price(unknowns: int) -> float:
    """Iterations of multigrid that cost as much as a factorisation of a symmetric tangent."""
    return float(FACTORISATION * (unknowns / 1e5) ** EXPONENT)


class ChosenSolver(LinearSolver):
    """Solver of the tangents of one scene: multigrid, a factorisation, or one that is kept.

    Args:
        comm: Communicator.
        stopwatch: Measures the time of each stage.
        numerics: Numerical settings: 'auto', or 'multigrid' for tangents of every size.
        cells: Number of cells along each axis of the grid.
        unsuited: Reason for which multigrid does not suit the form; empty if it does.
    """

    def __init__(
        self,
        comm: Any,
        stopwatch: Stopwatch,
        numerics: Numerics,
        cells: tuple[int, ...],
        unsuited: str = "",
    ) -> None:
        super().__init__(comm, stopwatch)
        self._comm, self._unsuited, self._warned = comm, unsuited, False
        self._auto = numerics.linear_solver == "auto"
        always = numerics.factorise == "always"
        self._direct = DirectSolver(comm, stopwatch, always=always)
        self._multigrid = MultigridSolver(comm, stopwatch, cells)
        self._last: LinearSolver = self._direct
        #: The matrix of the last solves, iterations of multigrid for it, and whether it stalled.
        self._matrix: Any = None
        self._spent, self._stalled, self._stalls = 0, False, 0
        #: Cost of the last solve with an old factorisation; before the first, that of a good one.
        self._kept_cost = KEPT * GOOD
        #: Cost and number of the last solves of each solver.
        self._costs = np.zeros((2, 2))

    @property
    def _solvers(self) -> tuple[DirectSolver, MultigridSolver]:
        return self._direct, self._multigrid

    def forget(self) -> None:
        """See `LinearSolver.forget`."""
        for solver in self._solvers:
            solver.forget()

    def successor(self) -> LinearSolver:
        """This solver; see those that it chooses from."""
        for solver in self._solvers:
            solver.successor()
        self._stalled = self._stalls > 1
        return self

    def begin(self) -> None:
        """See `LinearSolver.begin`."""
        self._multigrid.begin()

    def method(self, unknowns: int) -> str:
        """See `LinearSolver.method`."""
        direct, multigrid = (solver.method(unknowns) for solver in self._solvers)
        if self._unsuited:
            return f"{direct} ({'auto' if self._auto else 'multigrid'}: {self._unsuited})"
        if not self._auto:
            return multigrid
        if unknowns < SMALL:
            return f"{direct} (auto: {unknowns} unknowns, fewer than {SMALL})"
        return f"{multigrid} while it costs less than a factorisation (auto: {unknowns} unknowns)"

    def record(self) -> None:
        """See `LinearSolver.record`."""
        for solver in self._solvers:
            solver.record()
        self._matrix = None

    def state(self) -> dict[str, Any] | None:
        """See `LinearSolver.state`. Multigrid has none, since each step makes its own operators."""
        kept = self._direct.state() if self._last is self._direct else {}
        if kept is None:
            return None
        mine = {name: getattr(self, f"_{name}") for name in STATE}
        return mine | {"costs": self._costs.copy(), "kept": kept}

    def restore(self, state: Mapping[str, Any], matrix: Any) -> None:
        """See `LinearSolver.restore`."""
        for name in STATE:
            setattr(self, f"_{name}", state[name])
        self._matrix, self._costs = matrix, np.array(state["costs"])
        if state["kept"]:
            self._direct.restore(state["kept"], matrix)
        else:
            self._last = self._multigrid

    def solve(self, system: System) -> Array:
        """See `LinearSolver.solve`."""
        matrix, found = system.matrix, None
        if matrix is not self._matrix:
            self._matrix, self._spent = matrix, SET_UP
        if self._suits(matrix):
            self._switch(self._multigrid)
            try:
                found = self._multigrid.solve(system)
            except StalledError as stalled:
                self._stalled, self._stalls = True, self._stalls + 1
                warn(
                    f"{stalled}. A factorisation by MUMPS takes over: expected a body whose cells hold "
                    "enough particles, a stabilisation alpha > 0, and K/mu below 50 in a form without a "
                    "field for the volume; linear_solver='direct' starts with the factorisation",
                    SolverWarning,
                )
            self._spent += self._multigrid.iterations
            self._count(self._multigrid, SET_UP * self._multigrid.made + self._multigrid.iterations)
        if found is None:
            self._switch(self._direct)
            found = self._direct.solve(system)
            again = KEPT * self._direct.iterations
            self._kept_cost = again or self._kept_cost
            factor = 1.0 if self._direct.symmetric else UNSYMMETRIC
            self._count(self._direct, again or factor * price(matrix.getSize()[0]))
        for name in ("symmetric", "condition", "weak", "iterations"):
            setattr(self, name, getattr(self._last, name))
        return found

    def again(self, right: Array, tolerance: float) -> Array:
        """See `LinearSolver.again`."""
        return self._last.again(right, tolerance)

    @property
    def ready(self) -> bool:
        """See `LinearSolver.ready`."""
        return self._last.ready

    @property
    def singular(self) -> bool:
        """See `LinearSolver.singular`."""
        return self._last.singular

    def _switch(self, solver: LinearSolver) -> None:
        """Free what the other solver keeps, before this one needs memory."""
        if solver is not self._last:
            self._last.forget()
        self._last = solver

    def _warn(self) -> None:
        """Warn once if multigrid was asked for and does not suit the form."""
        if not (self._auto or self._warned):
            warn(
                f"multigrid does not suit this form ({self._unsuited}); a factorisation by MUMPS solves "
                "it. Expected: a form with a field for the volume and alpha > 0, or K/mu up to "
                f"{LOCKING:g}. linear_solver='direct' gives no warning",
                SolverWarning,
            )
        self._warned = True

    def _count(self, solver: LinearSolver, cost: float) -> None:
        """Count a solve."""
        mine = self._costs[self._solvers.index(solver)]
        mine += cost, 1
        if mine[1] > MEMORY:
            mine /= 2

    def _suits(self, matrix: Any) -> bool:
        """Whether multigrid solves the next tangent; the same on all ranks."""
        if self._unsuited:
            self._warn()
            return False
        if self._stalled:
            return False
        if not self._auto:
            return True
        unknowns = matrix.getSize()[0]
        if unknowns < SMALL:
            return False
        (_, tried), (cost, solves) = self._costs
        cheaper = self._spent <= PATIENCE * price(unknowns)
        mine = cost / max(solves, 1)
        if tried >= TRIAL:
            cheaper = mine <= self._costs[0, 0] / tried
        if cheaper or (solves and mine <= self._kept_cost):
            return True
        need = memory.of_factors(unknowns, symmetric=self._direct.symmetric)
        return need > memory.available(self._comm)
