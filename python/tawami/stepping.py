"""Steps of a size that adapts: halved where one fails, grown again; loads that come in such steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tawami import inputs
from tawami.errors import ConvergenceError, InputError, SingularError
from tawami.newton import History
from tawami.scene import Scene
from tawami.solution import Solution


@dataclass(frozen=True)
class Step:
    """What is kept of an accepted step.

    Attributes:
        end: Time [s], or share of the load, at its end.
        size: Its size, likewise.
        history: (momentum, volume) measures of every residual.
        krylov: FGMRES iterations of every linear solve; 0 where the tangent was factorised.
    """

    end: float
    size: float
    history: History
    krylov: tuple[int, ...]

    @property
    def iterations(self) -> int:
        """Newton iterations."""
        return len(self.history) - 1


def march(
    start: float,
    end: float,
    size: float,
    smallest: float,
    attempt: Callable[[float, float], Solution],
    unit: str,
    each: Callable[[Solution], None] | None = None,
) -> list[Step]:
    """Steps from start to end.

    Args:
        start: Where they begin.
        end: Where they end.
        size: Their largest size; one that fails is halved, after three good ones it doubles.
        smallest: Size below which no step is tried again.
        attempt: Takes a step to a place, of a size; raises and leaves everything as it was if it fails.
        unit: What messages say after numbers.
        each: Called with each accepted step.

    Raises:
        ConvergenceError, SingularError: At the smallest size.
    """
    largest, good, accepted, at = size, 0, list[Step](), start
    while end - at > 1e-9 * largest:
        now = min(size, end - at)
        # no crumb is left for the last step
        target = end if end - at - now < 1e-6 * largest else at + now
        try:
            solution = attempt(target, target - at)
        except (ConvergenceError, SingularError) as error:
            size, good = now / 2, 0
            if size < smallest:
                error.add_note(f"at {at:g} {unit}, with the smallest step of {now:g} {unit}")
                raise
            continue
        accepted.append(Step(target, target - at, solution.history, solution.krylov))
        at = target
        if each is not None:
            each(solution)
        good += 1
        if good >= 3 and size < largest:
            size, good = min(2 * size, largest), 0
    return accepted


def ramp(
    scene: Scene,
    size: float = 0.05,
    *,
    smallest: float | None = None,
    each: Callable[[Solution], None] | None = None,
) -> list[Step]:
    """Bring up, without inertia, the loads and prescribed displacements that are new to a scene.

    What it has borne already stays. Loads grow in proportion, from 0 to 1 of what was asked for.

    Args:
        scene: The scene.
        size: Largest share of the load in a step, above 0 to 1.
        smallest: Share below which the run ends; size/1024 by default.
        each: Called with the solution of each accepted step.

    Returns:
        The accepted steps.

    Raises:
        ConvergenceError, SingularError: At the smallest step, with its history; the scene is in the
            last equilibrium that was found.
        InputError: A size out of its range, or as `Scene.solve`.
    """
    inputs.instance("ramp: scene", scene, Scene, "a tawami.Scene")
    size = inputs.number("size", size, low=inputs.LEAST, high=1.0)
    inputs.number("size", size, low=1e-9)  # more steps than that would never end
    least = size / 1024 if smallest is None else inputs.number("smallest", smallest, low=0.0)
    each = inputs.function("each", each, "of a solution")

    reached = 0.0

    def attempt(part: float, _size: float) -> Solution:
        nonlocal reached
        solution = scene.solve_part(part)
        reached = part
        return solution

    try:
        return march(0.0, 1.0, size, least, attempt, "of the load", each)
    finally:
        if reached < 1.0:
            scene.accept(reached)


def settle(scene: Scene, *, tolerance: float = 1e-10, most: int = 200) -> list[Step]:
    """Solve under the present loads, the grid reset each time, until nothing is out of balance.

    With each reset the particles meet other functions, and what was in balance is so no longer.

    Args:
        scene: A scene of finite strain.
        tolerance: Of the momentum measure right after a reset.
        most: Number of solves after which it is given up.

    Raises:
        ConvergenceError: Not within `most` solves.
    """
    inputs.instance("settle: scene", scene, Scene, "a tawami.Scene")
    tolerance = inputs.number("tolerance", tolerance, low=1e-14, high=0.1)
    most = inputs.whole_number("most", most, low=1)
    if scene.form.strain != "finite":
        raise InputError(
            "settle(...) resets the grid: expected a scene with a form of finite strain"
        )
    steps = list[Step]()
    with scene.tolerance_of(max(0.1 * tolerance, 1e-14)):
        for _ in range(most):
            solution = scene.solve()
            steps.append(Step(1.0, 0.0, solution.history, solution.krylov))
            if solution.history[0][0] < tolerance:
                return steps
    raise ConvergenceError(
        f"settle: {steps[-1].history[0][0]:.1e} of the forces are out of balance after {most} resets of "
        f"the grid: expected less than {tolerance:g}; allow more resets, or a larger tolerance",
        steps[-1].history,
    )
