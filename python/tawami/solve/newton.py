"""Newton's method for one step."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.errors import CheckpointError, SingularError
from tawami.base.files import reason
from tawami.base.petsc import clean_up
from tawami.base.timing import Stopwatch, tally
from tawami.field.assembly import Assembly
from tawami.field.reduction import Reduction
from tawami.particles.responses import Responses
from tawami.solve.bordered import GivesWayError
from tawami.solve.choice import ChosenSolver
from tawami.solve.diagnosis import Diagnosis
from tawami.solve.direct import DirectSolver
from tawami.solve.equations import Equations
from tawami.solve.failures import reported
from tawami.solve.inertia import Inertia
from tawami.solve.iterate import Forces, Friction, Iterate
from tawami.solve.line_search import LineSearch
from tawami.solve.linear_solver import LinearSolver
from tawami.solve.measures import History, Measured, Measures, forcing, worst
from tawami.solve.numerics import Numerics
from tawami.solve.operators import Operators
from tawami.solve.path import Path
from tawami.solve.scaling import Scaling
from tawami.solve.tangents import Tangents
from tawami.solve.terms import Terms
from tawami.solve.unknowns import complete

#: Tolerance of linear solves along a path, whose first residual may be zero.
ON_PATH = 1e-8


@dataclass(frozen=True)
class Converged:
    """A converged step.

    Attributes:
        coefficients: Increments of all fields.
        acceleration: Acceleration of each displacement coefficient at the end of a dynamic step [m/s2].
        forces: Forces of supports and walls on all coefficients [N per metre depth].
        history: Measures of every residual, the first before any solve.
        krylov: FGMRES iterations of every solve; 0 if the tangent was factorised.
        condition: Estimated condition number of the last factorised tangent, scaled; 1 if none was.
        symmetric: Whether that tangent was symmetric, and LDL^T was used.
        factor: Load factor of a step along a path; NaN for other steps.
    """

    coefficients: Array
    acceleration: Array | None
    forces: Array
    history: History
    krylov: list[int]
    condition: float
    symmetric: bool
    factor: float = np.nan

    @property
    def iterations(self) -> int:
        """Number of linear solves."""
        return len(self.history) - 1


class Newton:
    """Solver of the nonlinear problem of one step after another.

    Args:
        assembly: Residual and tangent of the form.
        responses: The particles.
        numerics: Numerical settings.
        stopwatch: Measures the time of each stage.
        elastic: Makes the responses of the same particles with elastic laws, for a diagnosis.
        linear: Whether the residual is linear in the increments.

    Attributes:
        numerics: Numerical settings; its tolerance may change between steps.
    """

    def __init__(
        self,
        assembly: Assembly,
        responses: Responses,
        numerics: Numerics,
        stopwatch: Stopwatch,
        elastic: Callable[[], Responses],
        *,
        linear: bool = False,
    ) -> None:
        self._linear = linear
        self._assembly, self._responses = assembly, responses
        self.numerics, self._stopwatch = numerics, stopwatch
        self._layout, self._comm = assembly.layout, assembly.layout.grid.comm
        self._measures = Measures(assembly, responses)
        self._scaling = Scaling(assembly.layout, responses)
        self._operators = Operators(assembly, responses)
        self._tangents = Tangents(self._comm, self._scaling, self._operators)
        self._diagnosis = Diagnosis(assembly, responses, self._scaling, elastic)
        self._solver: LinearSolver
        if numerics.linear_solver == "direct":
            always = numerics.factorise == "always"
            self._solver = DirectSolver(self._comm, stopwatch, always=always)
        else:
            cells, unsuited = assembly.layout.grid.cells, self._operators.unsuited
            self._solver = ChosenSolver(self._comm, stopwatch, numerics, cells, unsuited)
        self._stored: Mapping[str, Any] | None = None

    def follow(self, earlier: Newton) -> None:
        """Keep the objects of an earlier solver that do not depend on values of the problem."""
        self._solver = earlier._solver.successor() or self._solver
        self._tangents.follow(earlier._tangents)

    def method(self, unknowns: int) -> str:
        """The linear solver for a number of unknowns in words, and the reason for it."""
        return self._solver.method(unknowns)

    # -- checkpoints -------------------------------------------------------------

    def record(self) -> None:
        """Record the state for :meth:`state` from now on, independently of earlier steps."""
        self._stored = None
        self._solver.record()

    def state(self) -> dict[str, Any] | None:
        """The factorisation that the next steps use; None if there is none."""
        factorised = self._solver.state()
        if factorised is None or self._assembly.reduction is None:
            return None
        return {"unknowns": self._assembly.reduction.digest, "factorised": factorised}

    def restore(self, state: Mapping[str, Any] | None) -> None:
        """Restore a :meth:`state`; this takes effect with the first tangent."""
        self._stored = state

    def _restore(self, tangent: Any, reduction: Reduction) -> None:
        """Factorise a stored state again, if the first tangent after it has the same unknowns."""
        state, self._stored = self._stored, None
        if state is None or self._comm.size > 1:
            return
        try:
            if reduction.digest == state["unknowns"]:
                self._solver.restore(state["factorised"], tangent)
        except Exception as error:
            raise CheckpointError(
                f"the factorisation in the checkpoint cannot be used ({reason(error)}): its content is "
                "not that of a checkpoint. Remove the checkpoint to resume from the one before it"
            ) from error

    # -- one step ----------------------------------------------------------------

    def internal(self, coefficients: Array) -> Array:
        """Internal forces and volume residual on all coefficients, at given increments."""
        data = self._responses.evaluate(*self._assembly.layout.split(coefficients))
        return self._assembly.residual(coefficients, data)

    def kept(self, reduction: Reduction) -> Callable[[Array, float], Array] | None:
        """Solves with the tangent of the last step, which is that of every step, given a right-hand side
        and a tolerance.

        None if the problem is not linear and symmetric, or if its unknowns are others.
        """
        known, solver = self._assembly.reduction, self._solver
        if not (self._linear and solver.symmetric and solver.ready) or known is None:
            return None
        return solver.again if reduction.same_unknowns(known) else None

    def solve(
        self,
        reduction: Reduction,
        external: Array,
        inertia: Inertia | None = None,
        guess: Array | None = None,
        friction: Friction | None = None,
        path: Path | None = None,
        values: Array | None = None,
        terms: Terms | None = None,
    ) -> Converged:
        """Solve for the increments that balance the external forces.

        Args:
            reduction: Unknowns that the supports leave free.
            external: External forces on all coefficients [N per metre depth].
            inertia: Inertia of a dynamic step.
            guess: Increments of all fields to start from; zero by default.
            friction: Friction of the walls; the tangent neglects its change.
            path: Path on which the load factor is an unknown.
            values: Values of the fields at the beginning, on all coefficients; zero by default. Those
                of fields without a role tell how large round-off is.
            terms: Forces on the border that depend on the solution.

        Raises:
            ConvergenceError: Newton did not reach the tolerance within `max_iterations`, or the
                tangent became singular where that of an elastic body is not.
            SingularError: The tangent cannot be solved; the message names the cells.
            SolverError: Memory ran out, or a library failed.
        """
        clean_up(self._comm)
        self._stopwatch.start()
        self._solver.begin()
        self._measures.begin(self.internal if inertia is None else None, values)
        equations = Equations(reduction, external, inertia, friction, path, terms)
        if terms is not None:
            terms.begin()
        iterate, history, krylov = equations.first(guess), History(), list[int]()
        add_mass = None if inertia is None else inertia.adder(reduction)
        search, most = None, self.numerics.max_iterations
        while True:
            try:
                forces, measured = self._reached(search, iterate, equations, history)
            except _rust.InvertedError as error:
                if guess is None:
                    self._fail(history, f"Then {error}. {equations.advice}")
                guess = search = None
                iterate = equations.first(guess)
                if terms is not None:
                    terms.restart()
                continue
            history.append(measured)
            if not np.isfinite(worst(measured)):
                self._fail(history, f"A number is infinite or undefined. {equations.advice}")
            met = path is None or path.control.is_met(iterate.u)
            converged = worst(measured) < self.numerics.tolerance and met
            if converged and terms is not None and terms.improve():
                if terms.stuck:
                    self._fail(history, terms.stuck)
                most = len(history) + self.numerics.max_iterations
                forces, history[-1] = self._evaluate(iterate, equations)
                converged = worst(history[-1]) < self.numerics.tolerance
            if converged:
                tally.steps += 1
                return Converged(
                    iterate.coefficients, forces.acceleration, forces.reactions, history, krylov,
                    self._solver.condition, self._solver.symmetric, iterate.factor,
                )  # fmt: skip
            if len(history) > most:
                advice = self._diagnosis.advice(history)
                self._fail(history, advice or equations.advice)
            with reported():
                change, of_factor = self._change(iterate, forces, equations, add_mass, history)
            if equations.is_searched(self._responses.form.strain.finite):
                of = self._layout.dot, change, forces.residual, self._signs
                search = LineSearch(*of, equations, len(history))
            iterate.add(change, of_factor)
            krylov.append(self._solver.iterations)
            self._stopwatch.lap()

    def _evaluate(self, iterate: Iterate, equations: Equations) -> tuple[Forces, Measured]:
        """Forces at an iterate, and their measures."""
        internal = self.internal(iterate.coefficients)
        forces = equations.forces(iterate, internal)
        with self._stopwatch("measures"):
            measured = self._measures.of(forces, iterate.coefficients, equations)
        return forces, measured

    def _reached(
        self, search: LineSearch | None, iterate: Iterate, equations: Equations, history: History
    ) -> tuple[Forces, Measured]:
        """Forces and measures at an iterate, or nearer to the last one if it went too far."""

        def evaluate(share: float) -> tuple[Forces, Measured]:
            if share < 1:
                iterate.shorten(share)
                if equations.terms is not None:
                    equations.terms.shorten(share)
            return self._evaluate(iterate, equations)

        if search is None:
            return evaluate(1.0)
        return search.advance(evaluate, lambda measured: worst(measured) > worst(history[-1]))

    def _change(
        self,
        iterate: Iterate,
        forces: Forces,
        equations: Equations,
        add_mass: Callable[[Any], None] | None,
        history: History,
    ) -> tuple[Array, float]:
        """Change of all increments and of the load factor by one tangent."""
        solver, data, reduction = self._solver, self._responses.data, equations.reduction
        tangent = self._assembly.tangent(iterate.coefficients, data, reduction)
        if add_mass is not None:
            add_mass(tangent)
        with self._stopwatch("reduction"):
            tangent = self._tangents.with_terms(tangent, equations)
        self._measures.observe(tangent, reduction)
        tolerance = ON_PATH
        if equations.path is None and not (equations.terms and equations.terms.bordering):
            linear = self._linear and equations.is_smooth and equations.friction is None
            tolerance = forcing(history, self.numerics.tolerance, linear=linear)
        with self._stopwatch("reduction"):
            system = self._tangents.system(tangent, equations, forces.residual, tolerance)
        if self._stored is not None:
            self._restore(system.matrix, reduction)
        singular: SingularError | None = None
        try:
            found = solver.solve(system)
        except SingularError as error:
            if not solver.singular:
                raise
            singular = error
        tally.newton_iterations += 1
        tally.unknowns = max(tally.unknowns, reduction.size)
        if solver.singular:
            solver.forget()
            self._diagnosis.report_singular(solver, equations, history, singular)

        def again(right: Array) -> Array:
            mine = self._tangents.right(equations, right)
            return self._tangents.on_all(equations, solver.again(mine, tolerance))

        try:
            change, of_factor = complete(
                equations, iterate.u, self._tangents.on_all(equations, found), again
            )
        except GivesWayError as error:
            self._fail(history, f"Then {error}. {equations.advice}")
        if not np.isfinite(of_factor):
            self._fail(history, "The loads do not move the control: choose another control")
        return change, of_factor

    @functools.cached_property
    def _signs(self) -> Array:
        """Signs of the coefficients in a line search."""
        layout = self._assembly.layout
        signs = np.zeros(layout.size)
        signs[: layout.num_displacement] = 1.0
        if layout.volumetric is not None:
            signs[layout.volumetric.slice] = -1.0
        return signs

    def _fail(self, history: History, advice: str) -> NoReturn:
        field = self._measures.worst_field
        self._diagnosis.report_divergence(history, self.numerics.tolerance, advice, field)
