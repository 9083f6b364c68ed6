"""One run of a study in a process of its own, so that memory and threads are its own."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
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
from tawami.base.program import own_environment
from tawami.base.timing import tally
from tawami.fem.environment import peak_memory

#: A run that takes less than this is repeated, so often at most, and the fastest counts [s].
SHORT, REPEATS = 2.0, 3
#: Set in the processes that studies start.
MARK = "TAWAMI_STUDY"

Run = Callable[..., Mapping[str, Any]]


def name_of(run: Run) -> str:
    """How another process finds a function: 'module:name' or 'path.py:name'.

    Raises:
        InputError: It cannot be found by a name.
    """
    name, module = getattr(run, "__qualname__", checks.shown(run)), getattr(run, "__module__", None)
    if "<" in name or "." in name or module is None:
        raise InputError(
            f"run = {name}: expected a function at the top level of a file, which a process of its own "
            "can find by its name"
        )
    if module == "__main__":
        main = sys.modules["__main__"]
        specification = getattr(main, "__spec__", None)
        if specification is not None:
            module = specification.name
        elif getattr(main, "__file__", None):
            module = str(Path(str(main.__file__)).resolve())
        else:
            raise InputError(f"run = {name}: expected a function in a file, not of a session")
    return f"{module}:{name}"


def found(name: str) -> Run:
    """The function of a name."""
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
    """What a measurement depends on besides its knobs: the function's text, tawami, the machine."""
    try:
        text = inspect.getsource(run)
    except OSError:
        text = name_of(run)
    parts = (text, version("tawami"), platform.node(), platform.machine(), str(os.cpu_count()))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def measured(name: str, knobs: Mapping[str, Any], limit: float) -> dict[str, Any]:
    """Run a function in a process of its own.

    Args:
        name: As :func:`name_of` gives it.
        knobs: Its keyword arguments; 'threads' is not passed on but sets those of the Rust part.
        limit: Wall time after which it is ended [s].

    Returns:
        values, wall_s, cpu_s, peak_MB, newton_iterations, steps, unknowns; or failure, a sentence, with
        `cut` where the process did not come to its end.
    """
    environment, knobs = own_environment() | {MARK: "1"}, dict(knobs)
    if "threads" in knobs:
        environment["RAYON_NUM_THREADS"] = str(knobs.pop("threads"))
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
            last = (ended.stderr.strip().splitlines() or ["it said nothing"])[-1]
            return {"failure": f"ended with code {ended.returncode}: {last}", "cut": True}
        try:
            outcome: dict[str, Any] = json.loads(result.read_text())
        except ValueError:
            return {
                "failure": "its result is cut off: no room in the temporary folder?",
                "cut": True,
            }
        return outcome


@contextmanager
def _temporary_folder() -> Iterator[str]:
    """A folder that goes with the block.

    Raises:
        OutputError: It cannot be made or written.
    """
    try:
        with tempfile.TemporaryDirectory() as folder:
            yield folder
    except OSError as error:
        raise OutputError(
            f"the temporary folder cannot be written ({error.strerror or error}): expected room there, "
            "or another one in the environment variable TMPDIR"
        ) from error


def main() -> None:
    """Run the job of a JSON file and write its result to another; their paths are the arguments."""
    job, result = map(Path, sys.argv[1:])
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    asked = json.loads(job.read_text())
    try:
        outcome = _outcome(found(asked["name"]), asked["knobs"])
    except TawamiError as error:
        outcome = {"failure": f"{type(error).__name__}: {error}"}
    except Exception:
        outcome = {"failure": traceback.format_exc().strip().splitlines()[-1]}
    result.write_text(json.dumps(outcome))


def _outcome(run: Run, knobs: Mapping[str, Any]) -> dict[str, Any]:
    fastest: dict[str, Any] | None = None
    spent = 0.0
    for _ in range(REPEATS):
        tally.reset()
        start, busy = perf_counter(), process_time()
        values = run(**knobs)
        wall = perf_counter() - start - tally.compiling_s
        cpu = process_time() - busy - tally.compiling_cpu_s
        spent += wall
        if fastest is None or wall < fastest["wall_s"]:
            fastest = {"values": _plain(values), "wall_s": wall, "cpu_s": cpu}
        if spent > SHORT:
            break
    assert fastest is not None
    counted = {
        "newton_iterations": tally.newton_iterations,
        "steps": tally.steps,
        "unknowns": tally.unknowns,
    }
    own = {key: fastest["values"].pop(key) for key in counted if key in fastest["values"]}
    return fastest | counted | own | {"peak_MB": peak_memory()}


def _plain(values: Any) -> dict[str, Any]:
    """Numbers and lists of numbers, checked."""
    if not isinstance(values, Mapping):
        raise InputError(
            f"the function of a study returned {type(values).__name__}: expected a mapping from names "
            "of quantities to numbers"
        )
    plain: dict[str, Any] = {}
    for name, value in values.items():
        array = np.asarray(value, dtype=float)
        if not np.isfinite(array).all():
            raise InputError(f"quantity '{name}' is not finite: expected numbers")
        plain[str(name)] = array.tolist()
    return plain
