"""The solution of a step: Newton's method, and states of the walls that do not contradict it."""

from __future__ import annotations

from dataclasses import replace

from tawami.base.arrays import Array
from tawami.base.errors import ConvergenceError
from tawami.conditions.supports import Supports
from tawami.domain.domain import Domain
from tawami.solve.newton import Converged
from tawami.step.step import Accepted, Problem, StepKind

#: Solves of one step with other states of the walls, after which it has failed.
PASSES = 40


def solved(
    domain: Domain, supports: Supports, kind: StepKind, before: Array, old: Array | None
) -> Accepted:
    """A step in which no wall pulls, is passed through, or exceeds its friction.

    Args:
        domain: The particles at its start.
        supports: The supports, whose walls change their states.
        kind: The step.
        before: Coefficients since the start where particles do not move, 0 where they do.
        old: Fields without a role as coefficients, if the form has any.

    Raises:
        ConvergenceError: Contact and friction do not settle, or Newton's method fails.
    """
    n, step, space = domain.layout.num_displacement, None, domain.model.space
    vectors = space.vectors(before[:n])
    for wall in supports.walls:
        wall.begin()
    for _ in range(PASSES):
        problem = kind.problem()
        step = _newton(domain, problem, step, old)
        forces, u = (space.vectors(part[:n]) for part in (step.forces, step.coefficients))
        if not problem.contact.adapt(forces, u, vectors):
            a = step.acceleration
            return Accepted(problem, step, u, None if a is None else space.vectors(a))
    assert step is not None
    raise ConvergenceError(
        f"contact and friction of the walls did not settle in {PASSES} solves. Nothing was changed in "
        "the particles. Use a smaller step",
        step.history,
    )


def _newton(
    domain: Domain, problem: Problem, last: Converged | None, old: Array | None
) -> Converged:
    """Solve a problem, from the solution for the last states of the walls if there is one."""
    guess, path = problem.guess, problem.path
    if last is not None:
        guess = last.coefficients
        path = None if path is None else replace(path, guess=last.factor)
    friction = problem.contact.friction if problem.contact.walls else None
    found = domain.newton.solve(
        problem.reduction, problem.external, problem.inertia, guess, friction, path, old,
        problem.terms,
    )  # fmt: skip
    if last is None:
        return found
    history, krylov = last.history + found.history[1:], last.krylov + found.krylov
    return replace(found, history=history, krylov=krylov)
