"""The linear systems of a step: the tangent of the form, and what the terms on the border add."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.rows import Rows
from tawami.field.sum import Sum
from tawami.solve.equations import Equations
from tawami.solve.linear_solver import System
from tawami.solve.operators import Operators
from tawami.solve.saddle import Saddle
from tawami.solve.scaling import Scaling

#: Tolerance of a system with constraints, relative to one without: their errors are most of its
#: right-hand side.
CONSTRAINED = 1e-2


class Tangents:
    """Makes the linear systems of one scene. Their matrices, and what solvers keep for them, serve later
    steps.

    Args:
        comm: Communicator.
        scaling: Scaling of the unknowns.
        operators: Operators of preconditioners.
    """

    def __init__(self, comm: Any, scaling: Scaling, operators: Operators) -> None:
        self._comm, self._scaling, self._operators = comm, scaling, operators
        self._sum, self._saddle = Sum(comm), Saddle(comm)

    def follow(self, earlier: Tangents) -> None:
        """Keep the matrices of an earlier object of the scene."""
        self._sum, self._saddle = earlier._sum, earlier._saddle

    def with_terms(self, tangent: Any, equations: Equations) -> Any:
        """A reduced tangent with the stiffness of the terms at the last forces."""
        if equations.terms is None:
            return tangent
        stiffness = equations.terms.update_stiffness()
        if stiffness is None:
            return tangent
        return self._sum.of(tangent, stiffness, equations.reduction, equations.terms.far)

    def system(
        self, tangent: Any, equations: Equations, residual: Array, tolerance: float
    ) -> System:
        """The system of all unknowns and multipliers; a collective call.

        Args:
            tangent: Reduced tangent, with the stiffness of the terms.
            equations: The equations of the step.
            residual: Forces out of balance, on all coefficients.
            tolerance: See `System`.
        """
        reduction, terms, saddle = equations.reduction, equations.terms, self._saddle
        scale: Callable[[], Array] = functools.partial(self._scaling.factors, tangent, reduction)
        errors, matrix = np.zeros(0), tangent
        saddle.count = 0
        if terms is not None and terms.tied:
            gradients = Rows.stacked([tie.gradient for tie in terms.tied])
            errors = np.concatenate([tie.residual for tie in terms.tied])
            matrix = saddle.of(tangent, gradients, reduction)
            of_unknowns = scale
            scale = lambda: saddle.factors(of_unknowns())  # noqa: E731
            tolerance *= CONSTRAINED
        parts = functools.partial(self._operators.parts, equations)
        right = -self.right(equations, residual, errors)
        return System(matrix, scale, right, tolerance, parts)

    def right(self, equations: Equations, forces: Array, errors: Array | None = None) -> Array:
        """This rank's part of a right-hand side; a collective call.

        Args:
            equations: The equations of the step.
            forces: On all coefficients of the window.
            errors: Of the constraints; zero by default.
        """
        mine = equations.reduction.restricted(forces)
        if errors is None:
            errors = np.zeros(self._saddle.count)
        return np.concatenate([mine, errors[: self._saddle.num_own]])

    def on_all(self, equations: Equations, solution: Array) -> Array:
        """All coefficients of the window, then all multipliers, from this rank's part of a solution.

        A collective call.
        """
        n = equations.reduction.num_own
        coefficients = equations.reduction.expanded(solution[:n])
        return np.concatenate([coefficients, ranks.allgathered(self._comm, solution[n:])])
