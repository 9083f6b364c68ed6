"""Steps with an adaptive size: load ramps, and resets of the grid until equilibrium."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

from tawami.base import checks
from tawami.base.errors import ConvergenceError, IncompleteWarning, InputError, SingularError
from tawami.base.program import leave_together
from tawami.base.warn import warn
from tawami.conditions.activity import Activity
from tawami.motion.observer import Observer, Recorder, observed
from tawami.motion.pace import Pace, Step, Steps
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution

#: Actions if the smallest step does not converge.
Stop = Literal["return", "raise"]


def march(
    pace: Pace,
    end: float,
    smallest: float,
    attempt: Callable[[float, float], Solution],
    observer: Observer,
    activity: Activity,
    each: Callable[[Solution], None] | None = None,
    steps: list[Step] | None = None,
) -> list[Step]:
    """Take steps until an end. A step that fails is halved; after three accepted steps the size doubles.

    Args:
        pace: Start, and largest size of a step.
        end: Time [s] or share at which the steps end.
        smallest: Size below which a step is not tried again.
        attempt: Function of the end of a step and its size that takes the step; if it raises, it must
            change nothing.
        observer: Observer of the steps.
        activity: Of the scene; no step may begin while observer and `each` are called.
        each: Called with the solution of each accepted step.
        steps: List to which the accepted steps are added, and that is returned; a new one by default.

    Raises:
        ConvergenceError, SingularError: At the smallest size.
    """
    largest, steps = pace.size, list[Step]() if steps is None else steps
    with activity.callback():
        observer.begin(pace, steps)
    while end - pace.at > 1e-9 * largest:
        now = min(pace.size, end - pace.at)
        # the last step must not be tiny
        target = end if end - pace.at - now < 1e-6 * largest else pace.at + now
        try:
            solution = attempt(target, target - pace.at)
        except (ConvergenceError, SingularError) as error:
            pace.size, pace.good = now / 2, 0
            if pace.size < smallest:
                unit = observer.unit
                error.add_note(f"at {pace.at:g} {unit}, with the smallest step of {now:g} {unit}")
                raise
            observer.failed(error)
            continue
        steps.append(Step(target, target - pace.at, solution.history, solution.krylov))
        pace.at = target
        pace.good += 1
        if pace.good >= 3 and pace.size < largest:
            pace.size, pace.good = min(2 * pace.size, largest), 0
        with leave_together(), activity.callback():
            observer.accepted(solution, last=end - pace.at <= 1e-9 * largest)
            if each is not None:
                each(solution)
            observer.checkpoint()
    return steps


def end_early(steps: Steps, error: ConvergenceError, stop: Stop, what: str, scene: Scene) -> None:
    """End a ramp or a path whose smallest step did not converge.

    Raises:
        ConvergenceError: With stop='raise'.
    """
    if stop == "raise":
        raise error
    steps.error = error
    if scene.grid.comm.rank:
        return
    warn(
        f"{what} stopped {error.__notes__[0]}: Newton did not converge. The scene is in its last "
        "equilibrium; `reached` holds its load. If the body can carry more, use a smaller `smallest`; "
        "follow(scene, ...) passes a limit load; stop='raise' raises the error instead",
        IncompleteWarning,
    )


def ramp(
    scene: Scene,
    size: float = 0.05,
    *,
    smallest: float | None = None,
    until: float | None = None,
    each: Callable[[Solution], None] | None = None,
    results: Recorder | None = None,
    stop: Stop = "return",
) -> Steps:
    """Apply the new loads and prescribed displacements of a scene in steps, without inertia.

    New loads grow in proportion from 0 to their values; loads that are in equilibrium already stay,
    and loads that were released fade. With `until`, loads and displacements with an amplitude follow it
    from the time of the scene to that time, which passes in proportion too.
    If the body cannot carry more, the scene stays in its last equilibrium; later ramps start there.

    Args:
        scene: The scene.
        size: Largest share of the load in a step, above 0 to 1.
        smallest: Share below which a step is not halved any more; size/1024 by default.
        until: Time for amplitudes at the end [s]; the time of the scene by default.
        each: Called with the solution of each accepted step.
        results: `tawami.Results` of the run, with outputs and checkpoints.
        stop: Action if the smallest step does not converge: 'return' the steps with a warning, or
            'raise' the error.

    Returns:
        The accepted steps as a list; those before a resumed run are included. `reached` is the share of
        the load that was reached, `complete` whether that is all of it, `error` why it is not.

    Raises:
        ConvergenceError: The smallest step did not converge, with stop='raise'.
        SingularError: The tangent is singular, and not because the load is too large.
        InputError: A size out of its range, or as `Scene.solve`.

    Warns:
        IncompleteWarning: The ramp stopped before the whole load, with stop='return'.
    """
    checks.instance("ramp: scene", scene, Scene, "a tawami.Scene")
    now = scene.configuration
    now.activity.check_idle("ramp(...)")
    now.moment(1.0, until)
    size = checks.number("size", size, low=checks.LEAST, high=1.0)
    checks.number("size", size, low=1e-9)  # with smaller steps it would not end
    least = size / 1024 if smallest is None else checks.number("smallest", smallest, low=0.0)
    each = checks.function("each", each, "of a solution")
    checks.choice("stop", stop, get_args(Stop))
    pace, steps = Pace(0.0, size), Steps()
    try:
        with observed(results, "ramp", scene, 1.0, "of the load") as observer:
            march(
                pace, 1.0, least, lambda part, _: scene.solve_part(part, until), observer,
                now.activity, each, steps,
            )  # fmt: skip
    except ConvergenceError as error:
        end_early(steps, error, stop, "ramp", scene)
    finally:
        steps.loads = [step.end for step in steps]
        if pace.at < 1.0:
            now.accept(now.moment(pace.at, until))
    return steps


def settle(
    scene: Scene,
    *,
    tolerance: float = 1e-10,
    max_resets: int = 200,
    results: Recorder | None = None,
) -> list[Step]:
    """Solve under the present loads, with a reset of the grid after each solve, until the scene is in
    equilibrium right after a reset.

    A reset moves the particles relative to the functions of the grid, which disturbs the equilibrium.

    Args:
        scene: A scene with a form of finite strain.
        tolerance: Of the momentum measure right after a reset.
        max_resets: Largest number of solves.
        results: `tawami.Results` of the run, with outputs and checkpoints.

    Returns:
        The solves as steps, which end at their numbers.

    Raises:
        ConvergenceError: No equilibrium after `max_resets` solves.
    """
    checks.instance("settle: scene", scene, Scene, "a tawami.Scene")
    activity = scene.configuration.activity
    activity.check_idle("settle(...)")
    tolerance = checks.number("tolerance", tolerance, low=1e-14, high=0.1)
    max_resets = checks.whole_number("max_resets", max_resets, low=1)
    if not scene.form.strain.finite:
        raise InputError(
            "settle(...) resets the grid: expected a scene with a form of finite strain"
        )
    pace, steps = Pace(0.0, 1.0), list[Step]()
    with (
        scene.configuration.tolerance(max(0.1 * tolerance, 1e-14)),
        observed(results, "settle", scene, max_resets, "resets") as observer,
    ):
        with activity.callback():
            observer.begin(pace, steps)
        while pace.at < max_resets and not observer.finished:
            solution = scene.solve()
            pace.at += 1.0
            steps.append(Step(pace.at, 1.0, solution.history, solution.krylov))
            settled = solution.history[0][0] < tolerance
            with leave_together(), activity.callback():
                observer.accepted(solution, last=settled)
                observer.checkpoint()
            if settled:
                return steps
        if observer.finished:
            return steps
        ghost = scene.configuration.model.options.get("ghost_penalty") == "on"
        penalty = ", or use ghost_penalty='off', which settles faster" if ghost else ""
        raise ConvergenceError(
            f"settle: {steps[-1].history[0][0]:.1e} of the forces are out of balance after {max_resets} "
            f"resets of the grid: expected less than {tolerance:g}; allow more resets, or a larger "
            f"tolerance{penalty}",
            steps[-1].history,
        )
