"""How a step is solved: what a scene may trade for speed, and what of it changes the result.

Newton's tolerance is the only one that changes what it converges to; tangent, factorisations and linear
solver change how long that takes (README, Speed against accuracy).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

from tawami.base import checks
from tawami.fem.rules import TangentRule

Assembly = Literal["fast", "reference"]
Factorise = Literal["when_it_pays", "always"]
SolverName = Literal["direct", "iterative"]


@dataclass(frozen=True)
class Numerics:
    """Numerical settings of a scene.

    Args:
        tolerance: Newton stops when both measures of `tawami.solve.newton` are below it, 1e-14 to 0.1.
        max_iterations: Newton iterations before the step is given up.
        assembly: 'fast', kernels called from Rust, or 'reference', dolfinx and P^T K P: the same
            numbers to round-off.
        tangent_rule: Points at which the tangent takes its sums over particles: 'full' (5 x 5, exact),
            or 'reduced' (3 x 3: cheaper, an approximation: more iterations, and Newton may diverge).
        factorise: 'when_it_pays' keeps a factorisation for later iterations and steps; 'always' makes
            one in each Newton iteration.
        linear_solver: 'direct' (MUMPS), or 'iterative': FGMRES, multigrid for the displacement.

    Raises:
        InputError: A value out of its range.
    """

    tolerance: float = 1e-6
    max_iterations: int = 20
    assembly: Assembly = "fast"
    tangent_rule: TangentRule = "full"
    factorise: Factorise = "when_it_pays"
    linear_solver: SolverName = "direct"

    def __post_init__(self) -> None:
        checks.number("tolerance", self.tolerance, low=1e-14, high=0.1)
        checks.whole_number("max_iterations", self.max_iterations, low=1)
        choices: dict[str, Any] = {
            "assembly": Assembly,
            "tangent_rule": TangentRule,
            "factorise": Factorise,
            "linear_solver": SolverName,
        }
        for name, possible in choices.items():
            checks.choice(name, getattr(self, name), get_args(possible))
