"""Numerical settings of a scene.

Only Newton's tolerance changes the result. Tangent, factorisations and linear solver change the time
(documentation, Speed against accuracy).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

from tawami.base import checks
from tawami.form.symbols import Assembly

Factorise = Literal["when_it_pays", "always"]
SolverName = Literal["auto", "direct", "multigrid"]

#: Number of unknowns from which 'auto' may take multigrid (`cases.costs.solvers`).
SMALL = 30_000


@dataclass(frozen=True)
class Numerics:
    """Numerical settings of a scene.

    Args:
        tolerance: Newton stops when all measures of `tawami.solve.measures` are below it, 1e-14 to 0.1.
        max_iterations: Newton iterations after which the step fails.
        assembly: 'points' evaluates the form at the particles; 'dolfinx' integrates over cells and
            computes P^T K P. They agree up to round-off for sums of expressions up to degree 4.
        factorise: 'when_it_pays' uses a factorisation in later iterations and steps, 'always' factorises
            in each Newton iteration.
        linear_solver: 'direct' (MUMPS), 'multigrid' (GMRES with multigrid), or 'auto', which chooses by
            size and cost (`tawami.solve.choice`).

    Raises:
        InputError: A value is out of its range.
    """

    tolerance: float = 1e-6
    max_iterations: int = 20
    assembly: Assembly = "points"
    factorise: Factorise = "when_it_pays"
    linear_solver: SolverName = "auto"

    def __post_init__(self) -> None:
        checks.number("tolerance", self.tolerance, low=1e-14, high=0.1)
        checks.whole_number("max_iterations", self.max_iterations, low=1)
        choices: dict[str, Any] = {
            "assembly": Assembly,
            "factorise": Factorise,
            "linear_solver": SolverName,
        }
        renamed = {"iterative": "it is called 'multigrid' now; "}
        for name, possible in choices.items():
            value = getattr(self, name)
            checks.choice(name, value, get_args(possible), renamed.get(str(value), ""))

    def line(self, solver: str, ranks: int) -> str:
        """The settings in words, for the header of a run.

        Args:
            solver: The linear solver in words.
            ranks: Number of ranks.
        """
        return (
            f"Newton to {self.tolerance:g} in at most {self.max_iterations} iterations, "
            f"{solver}, assembly {self.assembly}, "
            f"{ranks} rank{'s' if ranks > 1 else ''}"
        )
