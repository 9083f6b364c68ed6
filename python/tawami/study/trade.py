"""Speed against accuracy of a script, measured without a reference."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.files import atomic_file, readable_file
from tawami.study import front_figure, process
from tawami.study.adjoint import combined
from tawami.study.estimate import estimate
from tawami.study.front import Run, Trade
from tawami.study.knobs import EXAMPLE, Knob, knobs_of
from tawami.study.ladder import Ladder
from tawami.study.series import is_list

#: Name of the function in a script, and of the mapping that may declare its knobs.
BUILD, KNOBS = "build", "knobs"


def trade(
    build: process.Run | str | Path,
    quantities: str | Sequence[str] | None = None,
    budget: float = 60.0,
    *,
    knobs: Mapping[str, Sequence[Any]] | None = None,
    tolerance: float = 0.01,
    folder: str | Path | None = None,
    jobs: int | None = None,
    quiet: bool = False,
) -> Trade:
    """Measure error and time of a script for the values of its knobs, within a budget.

    The errors need no reference: values that converge regularly are extrapolated with their observed
    order, others have a larger uncertainty. Each run has its own process, cheapest first. With several
    jobs each has one thread, which its time is measured with; a knob `threads` means one job. Stored
    runs are not repeated, and count in the budget.

    Args:
        build: Function at the top level of a file, or the path of a script with a function `build`. All
            its arguments have defaults; knobs are annotated with their values from coarse to fine,
            `h: Annotated[float, (1/4, 1/8, 1/16)] = 1/8`. A set instead, `{0.0, 0.3, 0.6}`, has values
            that are equally accurate, as shifts of the grid: their spread measures the noise. It
            returns a mapping from names of quantities to numbers, to error estimates
            (`solution.error(goal)`), or to functions without arguments that return one of them. These
            are called after the time has been taken.
        quantities: Name of a quantity, or names; all numbers by default.
        budget: Wall time of all runs together [s].
        knobs: Values of knobs by name, instead of annotations. A script may declare them as `knobs`.
        tolerance: Relative error that the recommended setting stays below.
        folder: Folder of runs, table and picture; results/trade/NAME by default.
        jobs: Runs at a time; as many as there are processors by default.
        quiet: Do not print a line for each run.

    Returns:
        Runs with errors, and the recommended setting. NAME.csv and NAME.png show them too.

    Raises:
        InputError: No knobs, a quantity that is not a number, or fewer than two runs in the budget that
            succeed.
    """
    if process.MARK in os.environ:
        raise InputError(
            'trade was started by its own run: put it under if __name__ == "__main__":'
        )
    if MPI.COMM_WORLD.size > 1:
        raise InputError(
            f"trade on {MPI.COMM_WORLD.size} ranks: expected one rank; each run has its own process"
        )
    budget = checks.number("budget", budget, low=checks.LEAST)
    tolerance = checks.number("tolerance", tolerance, low=checks.LEAST)
    name, run_name, function, declared = _function(build)
    found = knobs_of(function, declared if knobs is None else knobs)
    path = checks.path("folder", folder or default_folder(name))
    processors = len(os.sched_getaffinity(0))
    jobs = processors if jobs is None else checks.whole_number("jobs", jobs, low=1)
    fingerprint = process.fingerprint(function)
    ladder = Ladder(name, run_name, fingerprint, found, _names(quantities), path, budget, jobs)
    ladder.climb(quiet=quiet)
    result = result_of(name, found, ladder, tolerance)
    with atomic_file(path / f"{name}.csv") as part:
        part.write_text(result.as_csv())
    if importlib.util.find_spec("matplotlib") is not None:
        front_figure.picture(result, path / f"{name}.png")
    return result


def default_folder(name: str) -> Path:
    """Folder of a trade unless another one is given."""
    return Path("results") / "trade" / name


def result_of(name: str, knobs: Sequence[Knob], ladder: Ladder, tolerance: float) -> Trade:
    """Estimate limits and errors from the runs of a ladder."""
    limits = {}
    for q in ladder.quantities:
        points = ladder.points(q)
        refined = estimate(q, knobs, points, ladder.failures)
        limits[q] = combined(q, knobs, refined, points, ladder.estimated(q))
    runs = []
    for setting, run in ladder.runs.items():
        knob_values = ladder.named(setting)
        if "failure" in run:
            runs.append(Run(knob_values, {}, {}, {}, failure=run["failure"]))
            continue
        values = {q: float(run["values"][q]) for q in limits}
        errors = {q: abs(values[q] - limits[q].value) / limits[q].scale for q in limits}
        bars = {q: limits[q].uncertainty / limits[q].scale for q in limits}
        runs.append(Run(knob_values, values, errors, bars, run["wall_s"], run["peak_MB"]))
    return Trade(name, knobs, limits, runs, tolerance)


def _function(
    build: process.Run | str | Path,
) -> tuple[str, str, process.Run, Mapping[str, Any] | None]:
    """Name of a trade, name of its function, the function, and knobs that its script declares."""
    if not isinstance(build, str | Path):
        run_name = process.name_of(build)
        return run_name.rpartition(":")[2], run_name, build, None
    script = readable_file("script", build, "a Python file with a function build").resolve()
    run_name = f"{script}:{BUILD}"
    try:
        function = process.load(run_name)
    except AttributeError:
        function = None
    except Exception as error:
        raise InputError(f"script '{script}' failed: {type(error).__name__}: {error}") from error
    if not callable(function):
        raise InputError(
            f"script '{script}' has no function {BUILD}: expected one with knobs, {EXAMPLE}, that "
            "returns a mapping from names of quantities to numbers"
        )
    return script.stem, run_name, function, function.__globals__.get(KNOBS)


def _names(quantities: str | Sequence[str] | None) -> list[str]:
    names = [quantities] if isinstance(quantities, str) else quantities or []
    if not is_list(names) or not all(isinstance(name, str) for name in names):
        raise InputError(f"quantities = {checks.shown(quantities)}: expected names")
    return list(names)
