"""Error messages of a step that cannot be solved: where the tangent is weak, and the likely cause."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import numpy as np
from mpi4py import MPI

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import ConvergenceError, SingularError, SolverError
from tawami.base.timing import Stopwatch
from tawami.field.assembly import Assembly
from tawami.field.reduction import Reduction
from tawami.particles.responses import Responses
from tawami.solve.direct import DirectSolver
from tawami.solve.equations import Equations
from tawami.solve.linear_solver import LinearSolver, System
from tawami.solve.measures import History, out_of_reach, text
from tawami.solve.scaling import Scaling

#: K/mu from which forms without a field for the volume lose all digits.
NO_DIGITS = 1e9
#: Ratio of shear moduli from which the round-off of stiff parts may exceed Newton's tolerance.
FEW_DIGITS = 1e8
#: Entries of the weak direction that are traced to cells, and cells that the message lists.
ENTRIES, CELLS = 20, 4


class Diagnosis:
    """Errors of the steps of one scene.

    Args:
        assembly: Residual and tangent of the form.
        responses: The particles.
        scaling: Scaling of the unknowns.
        elastic: Makes the responses of the same particles with elastic laws.
    """

    def __init__(
        self,
        assembly: Assembly,
        responses: Responses,
        scaling: Scaling,
        elastic: Callable[[], Responses],
    ) -> None:
        self._assembly, self._responses = assembly, responses
        self._scaling, self._elastic = scaling, elastic
        self._layout = assembly.layout
        self._comm = self._layout.grid.comm

    def report_divergence(
        self, history: History, tolerance: float, advice: str, field: str | None
    ) -> NoReturn:
        """Raise the error of an iteration that did not converge.

        Args:
            history: Measures of all residuals.
            tolerance: Bound of the measures.
            advice: The likely cause, and what to do.
            field: The field without a role whose measure is the largest; None without such fields.
        """
        rows = "; ".join(f"{k}: {text(measures, 2)}" for k, measures in enumerate(history))
        names = "momentum and volume" if field is None else f"momentum, volume and '{field}'"
        so_far = f"measures of {names} by iteration: {rows}. " if history else ""
        raise ConvergenceError(
            f"Newton did not converge in {max(len(history) - 1, 0)} iterations to {tolerance:g}; "
            f"{so_far}Nothing was changed in the particles. {advice}",
            history,
        )

    def report_singular(
        self,
        solver: LinearSolver,
        equations: Equations,
        history: History,
        error: SingularError | None,
    ) -> NoReturn:
        """Raise the error of a singular tangent; a collective call.

        If the tangent of the same body with elastic laws is regular, the material has lost its
        stiffness: the step did not converge. Otherwise particles, supports or the grid are at fault.

        Args:
            solver: The solver, which knows the condition number and the weak direction.
            equations: The equations.
            history: Measures of all residuals.
            error: Of the solver, if it raised one.

        Raises:
            ConvergenceError: The load exceeds the strength of the material.
            SingularError: Any other singular tangent.
        """
        reduction, condition = equations.reduction, solver.condition
        size = "infinite" if np.isinf(condition) else f"about {condition:.1e}"
        weak = solver.weak[: reduction.num_own]
        cells = ", ".join(self._weakest_cells(reduction, weak)) if error is None else ""
        what = str(error) if error is not None else (
            f"the tangent is singular (condition number of the scaled matrix: {size}; from its "
            f"factorisation and random vectors). The displacement basis is '{self._layout.basis}'; "
            f"weakest at the cells (i, j): {cells}"
        )  # fmt: skip
        material = self.material()
        if not material and self._elastic_is_regular(equations):
            raise ConvergenceError(
                f"{what}. An elastic body would not be, so the likely cause is the load, which exceeds "
                "the strength of the material or the size of one step. Nothing was changed in the "
                f"particles. {equations.advice}",
                history,
            ) from error
        if error is not None:
            raise error
        raise SingularError(f"{what}. Likely cause: {material or self._too_few_particles()}")

    def _elastic_is_regular(self, equations: Equations) -> bool:
        """Whether the tangent of the body with elastic laws is regular at the start of the step."""
        reduction, zero = equations.reduction, np.zeros(self._layout.size)
        data = self._elastic().evaluate(*self._layout.split(zero))
        tangent = self._assembly.tangent(zero, data, reduction)
        if equations.inertia is not None:
            equations.inertia.adder(reduction)(tangent)
        solver = DirectSolver(self._comm, Stopwatch(), always=True)
        try:
            solver.solve(
                System(
                    tangent,
                    lambda: self._scaling.factors(tangent, reduction),
                    np.zeros(reduction.num_own),
                    1e-3,
                    list,
                )
            )
        except (SingularError, SolverError):
            return False
        regular = not solver.singular
        solver.forget()
        return regular

    def _too_few_particles(self) -> str:
        """Advice on functions without stiffness: what is not set already."""
        form, lagrange = self._responses.form, self._layout.basis == "biquadratic"
        advice = ["use more particles per cell (per_axis=3)"]
        if lagrange:
            advice.append("use the basis 'quadratic_spline' with per_axis=2 or more")
        attachment = self._assembly.attachment
        off = not attachment.compiled.penalises and "ghost_penalty" in form.options
        moves = form.strain.finite  # elsewhere full cells have no penalty
        inactive = np.array([not attachment.active.all()])
        partly = ranks.any_of(self._comm, inactive)[0]
        if off and moves and not lagrange and partly:
            advice.append("use ghost_penalty='on', which ties partial cells to their neighbours")
        return (
            "some functions of the grid get no stiffness from the particles. Support every part of the "
            f"body; {'; '.join(advice)}"
        )

    def advice(self, history: History) -> str:
        """Advice on what keeps the measures from the tolerance; empty if that is not known."""
        return self.material() or out_of_reach(history)

    def material(self) -> str:
        """Advice on materials that cost all digits; empty if there is none. A collective call."""
        return self._incompressible() or self._contrast()

    def _incompressible(self) -> str:
        K, mu = (self._responses.constants[name] for name in ("K", "mu"))
        ratio = ranks.largest(self._comm, float((K / mu).max(initial=0.0)))
        if ratio < NO_DIGITS or self._responses.form.kinematics.has_mean_stress:
            return ""
        return (
            f"K/mu is {ratio:.1e}: a form without a field for the volume has no digits left; use form "
            "'u_epsv' or 'u_p'"
        )

    def _contrast(self) -> str:
        mu = self._responses.constants["mu"]
        largest = ranks.largest(self._comm, float(mu.max(initial=0.0)))
        least = self._comm.allreduce(float(mu.min(initial=np.inf)), op=MPI.MIN)
        if largest < FEW_DIGITS * least:
            return ""
        return (
            f"shear moduli differ by a factor of {largest / least:.1e}, and round-off of the stiff "
            "material is as large as the forces of the soft one; make the stiff one softer, or hold "
            "all of it by supports"
        )

    def _weakest_cells(self, reduction: Reduction, direction: Array) -> list[str]:
        """The cells where a singular system is weakest, with their numbers of particles.

        A field without a role is named with its cells.

        Args:
            reduction: The unknowns.
            direction: This rank's entries of the direction in which the system is weakest.
        """
        grid = self._layout.grid
        own = np.argsort(-np.abs(direction))[:ENTRIES]
        counts, mine = self._responses.particles_per_cell, []
        for unknown in own:
            coefficient = int(reduction.coefficients[unknown])
            cells, name = self._layout.cells_of(coefficient), self._layout.name_of(coefficient)
            number = counts[grid.window.numbers(cells)]
            i, j = cells[number.argmin()]
            text = f"({i}, {j}) with {number.min()} particles"
            if name in self._responses.form.own_fields:
                text += f" in field '{name}'"
            mine.append((-abs(float(direction[unknown])), text))
        every = sorted(
            (one for part in self._comm.allgather(mine) for one in part), key=lambda one: one[0]
        )
        return list(dict.fromkeys(text for _, text in every[:ENTRIES]))[:CELLS]
