"""One run of a study in its own process, so that its memory and threads are measured alone."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import json
import logging
import os
import platform
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.errors import InputError, OutputError, TawamiError
from tawami.base.files import reason
from tawami.base.meaning import meaning
from tawami.base.program import own_environment
from tawami.base.timing import tally
from tawami.estimate.error import ErrorEstimate
from tawami.fem.environment import peak_memory

#: Runs shorter than this [s] are repeated, up to this number of times; the fastest one counts.
SHORT, REPEATS = 2.0, 3
#: Environment variable of the processes that studies start.
MARK = "TAWAMI_STUDY"

Run = Callable[..., Mapping[str, Any]]


def name_of(run: Run) -> str:
    """Name by which another process finds a function: 'module:name' or 'path.py:name'.

    Raises:
        InputError: It has no such name.
    """
    name, module = getattr(run, "__qualname__", checks.shown(run)), getattr(run, "__module__", None)
    if "<" in name or "." in name or module is None:
        raise InputError(
            f"run = {name}: expected a function at the top level of a file, which another process can "
            "find by its name"
        )
    if module == "__main__":
        main = sys.modules["__main__"]
        specification = getattr(main, "__spec__", None)
        if specification is not None:
            module = specification.name
        elif getattr(main, "__file__", None):
            module = str(Path(str(main.__file__)).resolve())
        else:
            raise InputError(
                f"run = {name}: expected a function in a file, not in an interactive session"
            )
    return f"{module}:{name}"


def load(name: str) -> Run:
    """The function of a name; the reverse of :func:`name_of`."""
    module, _, function = name.rpartition(":")
    if module.endswith(".py"):
        specification = importlib.util.spec_from_file_location("tawami_study", module)
        assert specification is not None
        assert specification.loader is not None
        loaded = importlib.util.module_from_spec(specification)
        sys.path.insert(0, str(Path(module).parent))
        specification.loader.exec_module(loaded)
    else:
        loaded = importlib.import_module(module)
    run: Run = getattr(loaded, function)
    return run


def fingerprint(run: Run) -> str:
    """Hash of all that a measurement depends on besides its knobs: the code of the function and the
    values that it reads, version, machine.
    """
    parts = (
        json.dumps(meaning(run), sort_keys=True),
        version("tawami"),
        platform.node(),
        platform.machine(),
        str(os.cpu_count()),
    )
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def measure(
    name: str, knobs: Mapping[str, Any], limit: float, threads: int | None = None
) -> dict[str, Any]:
    """Run a function in its own process.

    Args:
        name: From :func:`name_of`.
        knobs: Its keyword arguments; 'threads' is not passed to it but sets the threads of Rust.
        limit: Wall time after which the process is ended [s].
        threads: Threads of Rust; None for those of the environment.

    Returns:
        values, estimated, wall_s, cpu_s, peak_MB, newton_iterations, steps, unknowns; or failure, a
        message, with `cut` if the process did not finish. `estimated` has the parts and the order
        of the error of quantities that are estimates.
    """
    environment, knobs = own_environment() | {MARK: "1"}, dict(knobs)
    threads = knobs.pop("threads", threads)
    if threads is not None:
        environment["RAYON_NUM_THREADS"] = str(threads)
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    with _temporary_folder() as folder:
        job, result = Path(folder) / "job.json", Path(folder) / "result.json"
        job.write_text(json.dumps({"name": name, "knobs": knobs}))
        command = [sys.executable, "-m", "tawami.study", str(job), str(result)]
        try:
            ended = subprocess.run(
                command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                timeout=limit, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return {"failure": f"took longer than the limit of {limit:g} s", "cut": True}
        if not result.exists():
            last = (ended.stderr.strip().splitlines() or ["without a message"])[-1]
            return {"failure": f"ended with code {ended.returncode}: {last}", "cut": True}
        try:
            outcome: dict[str, Any] = json.loads(result.read_text())
        except ValueError:
            return {
                "failure": "its result is incomplete: is the temporary folder full?",
                "cut": True,
            }
        return outcome


@contextmanager
def _temporary_folder() -> Iterator[str]:
    """A folder that is removed at the end of the block.

    Raises:
        OutputError: It cannot be created or written.
    """
    try:
        with tempfile.TemporaryDirectory() as folder:
            yield folder
    except OSError as error:
        raise OutputError(
            f"the temporary folder cannot be written ({reason(error)}): expected free space there, or "
            "another folder in the environment variable TMPDIR"
        ) from error


def main() -> None:
    """Run the job of a JSON file and write its result to another one; the arguments are their paths."""
    job, result = map(Path, sys.argv[1:])
    logging.disable(logging.INFO)  # compiling forms logs a lot
    asked = json.loads(job.read_text())
    try:
        outcome = _outcome(load(asked["name"]), asked["knobs"])
    except TawamiError as error:
        outcome = {"failure": f"{type(error).__name__}: {error}"}
    except Exception:
        outcome = {"failure": traceback.format_exc().strip().splitlines()[-1]}
    result.write_text(json.dumps(outcome))


def _outcome(run: Run, knobs: Mapping[str, Any]) -> dict[str, Any]:
    times = list[tuple[float, float]]()
    while not times or (len(times) < REPEATS and sum(wall for wall, _ in times) <= SHORT):
        tally.reset()
        start, busy = perf_counter(), process_time()
        values = run(**knobs)
        wall = perf_counter() - start - tally.compiling_s
        times.append((wall, process_time() - busy - tally.compiling_cpu_s))
    wall, cpu = min(times)
    counted = {
        "newton_iterations": tally.newton_iterations,
        "steps": tally.steps,
        "unknowns": tally.unknowns,
    }
    measured = {"wall_s": wall, "cpu_s": cpu, "peak_MB": peak_memory()}
    values, errors = evaluated(values)
    plain = _plain(values)
    own = {key: plain.pop(key) for key in counted if key in plain}
    return {"values": plain, "estimated": errors} | measured | counted | own


def evaluated(values: Any) -> tuple[Any, dict[str, dict[str, Any]]]:
    """Quantities with numbers in place of estimates, and the errors of these.

    Functions without arguments are called: their time does not count.
    """
    if not isinstance(values, Mapping):
        return values, {}
    found = {name: value() if callable(value) else value for name, value in values.items()}
    estimates = {n: e for n, e in found.items() if isinstance(e, ErrorEstimate)}
    errors = {str(n): {"parts": dict(e.parts), "order": e.order} for n, e in estimates.items()}
    return found | {n: e.value for n, e in estimates.items()}, errors


def _plain(values: Any) -> dict[str, Any]:
    """Quantities as numbers and lists of numbers, checked."""
    if not isinstance(values, Mapping):
        raise InputError(
            f"the function of a study returned {type(values).__name__}: expected a mapping from names "
            "of quantities to numbers"
        )
    plain: dict[str, Any] = {}
    for name, value in values.items():
        try:
            array = checks.real_values(value)
        except (TypeError, ValueError):
            raise InputError(
                f"quantity '{name}' = {checks.shown(value)}: expected real numbers; leave out others"
            ) from None
        if not np.isfinite(array).all():
            raise InputError(f"quantity '{name}' is not finite: expected numbers")
        plain[str(name)] = array.tolist()
    return plain
