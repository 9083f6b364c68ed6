"""Error messages of a step that cannot be solved: where the tangent is weak, and the likely cause."""

from __future__ import annotations

from typing import NoReturn

import numpy as np
from mpi4py import MPI

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import ConvergenceError, SingularError
from tawami.field.layout import Layout
from tawami.field.reduction import Reduction
from tawami.particles.responses import Responses
from tawami.solve.linear_solver import LinearSolver
from tawami.solve.measures import History

#: K/mu from which forms without a field for the volume lose all digits.
NO_DIGITS = 1e9
#: Ratio of shear moduli from which the round-off of stiff parts may exceed Newton's tolerance.
FEW_DIGITS = 1e8
#: Advice if the tangent was regular at the beginning of the step.
BEYOND = (
    "the load, because the tangent was regular when the step began: it exceeds the strength of the "
    "material, or the size of one step. Nothing was changed in the particles. Take a smaller load, or "
    "ramp(...)"
)
#: Advice if nothing else is known.
TOO_FEW_PARTICLES = (
    "some functions of the grid get no stiffness from the particles. Use more particles per cell, the "
    "basis 'quadratic_spline', or alpha > 0"
)
#: Entries of the weak direction that are traced to cells, and cells that the message lists.
ENTRIES, CELLS = 20, 4


class Diagnosis:
    """Errors of the steps of one scene.

    Args:
        layout: Places of the coefficients.
        responses: The particles.
    """

    def __init__(self, layout: Layout, responses: Responses) -> None:
        self._layout, self._responses = layout, responses
        self._comm = layout.grid.comm

    def report_divergence(self, history: History, tolerance: float, advice: str) -> NoReturn:
        """Raise the error of an iteration that did not converge.

        Args:
            history: Measures of all residuals.
            tolerance: Bound of the measures.
            advice: The likely cause, and what to do.
        """
        rows = "; ".join(
            f"{k}: {u:.2e}" + ("" if q is None else f", {q:.2e}")
            for k, (u, q) in enumerate(history)
        )
        so_far = f"measures of momentum and volume by iteration: {rows}. " if history else ""
        raise ConvergenceError(
            f"Newton did not converge in {max(len(history) - 1, 0)} iterations to {tolerance:g}; "
            f"{so_far}Nothing was changed in the particles. {advice}",
            history,
        )

    def report_singular(
        self, solver: LinearSolver, reduction: Reduction, *, first: bool
    ) -> NoReturn:
        """Raise the error of a singular tangent; a collective call.

        Args:
            solver: The solver, which knows the condition number and the weak direction.
            reduction: The unknowns.
            first: Whether it is the first tangent of the step.
        """
        condition = solver.condition
        size = "infinite" if np.isinf(condition) else f"about {condition:.1e}"
        advice = self.material() or (TOO_FEW_PARTICLES if first else BEYOND)
        cells = ", ".join(self._weakest_cells(reduction, solver.weak))
        raise SingularError(
            f"the tangent is singular (condition number of the scaled matrix: {size}; from its "
            f"factorisation and random vectors). The displacement basis is '{self._layout.basis}'; "
            f"weakest at the cells (i, j): {cells}. Likely cause: {advice}"
        )

    def material(self) -> str:
        """Advice on materials that cost all digits; empty if there is none. A collective call."""
        return self._incompressible() or self._contrast()

    def _incompressible(self) -> str:
        K, mu = (self._responses.constants[name] for name in ("K", "mu"))
        ratio = self._comm.allreduce(float((K / mu).max(initial=0.0)), op=MPI.MAX)
        if ratio < NO_DIGITS or self._responses.form.kinematics.volume_fields:
            return ""
        return (
            f"K/mu is {ratio:.1e}: a form without a field for the volume has no digits left; use form "
            "'u_epsv' or 'u_p'"
        )

    def _contrast(self) -> str:
        mu = self._responses.constants["mu"]
        largest = self._comm.allreduce(float(mu.max(initial=0.0)), op=MPI.MAX)
        least = self._comm.allreduce(float(mu.min(initial=np.inf)), op=MPI.MIN)
        if largest < FEW_DIGITS * least:
            return ""
        return (
            f"shear moduli differ by a factor of {largest / least:.1e}, and round-off of the stiff "
            "material is as large as the forces of the soft one; make the stiff one softer, or hold it "
            "by supports"
        )

    def _weakest_cells(self, reduction: Reduction, direction: Array) -> list[str]:
        """The cells where a singular system is weakest, with their numbers of particles.

        Args:
            reduction: The unknowns.
            direction: This rank's entries of the direction in which the system is weakest.
        """
        grid = self._layout.grid
        own = np.argsort(-np.abs(direction))[:ENTRIES]
        entries = ranks.allgathered(self._comm, np.abs(direction[own]))
        unknowns = ranks.allgathered(self._comm, reduction.own.start + own)
        counts = self._responses.particles_per_cell
        found: list[str] = []
        for unknown in unknowns[np.argsort(-entries, kind="stable")][:ENTRIES]:
            cells = self._layout.cells_of(reduction.unknowns[unknown])
            number = counts[grid.cell_numbers(cells)]
            i, j = cells[number.argmin()]
            text = f"({i}, {j}) with {number.min()} particles"
            if text not in found:
                found.append(text)
        return found[:CELLS]
