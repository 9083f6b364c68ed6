"""Costs outside the solver: the import, the Python part of a step, and the particles of a level set.

The Python part of a step is its processor time outside of calls into the Rust module and into PETSc
(with MUMPS). It contains NumPy and SciPy. Steps with and without Python's profiler alternate: the
profiler counts the time within those calls, and the other steps give the whole time.

`in_turns` runs this file with the package of a checkout on PYTHONPATH: `python -m
cases.costs.bench.overheads NAME` prints one line of JSON.
"""

from __future__ import annotations

import cProfile
import json
import logging
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import numpy.typing as npt

#: Parts of the names of functions in the Rust module and in PETSc.
NATIVE = ("tawami._rust", "petsc4py", "builtins.Active")
#: Pairs of steps of the pile, the size of a step [s], and cells along the grid of the level set.
PAIRS, STEP, CELLS = 20, 1e-3, 360

Array = npt.NDArray[np.float64]
Found = Mapping[str, float]


def importing() -> Found:
    """`import tawami`: wall and processor time [s]."""
    start, busy = perf_counter(), process_time()
    import tawami  # noqa: F401

    return {"wall": perf_counter() - start, "cpu": process_time() - busy}


def scene() -> Found:
    """The same with the names that a dynamic scene needs."""
    start, busy = perf_counter(), process_time()
    from tawami import Dynamics, Grid, Scene, box, linear_elastic  # noqa: F401

    return {"wall": perf_counter() - start, "cpu": process_time() - busy}


def step() -> Found:
    """A step of the collapse of 800 particles: processor time, and that of its Python part [s]."""
    from cases.costs.bench.timed import WARM_UP, pile

    logging.disable(logging.INFO)  # compiling a form logs many lines
    motion, profile, cpu = pile(), cProfile.Profile(process_time), 0.0
    for _ in range(WARM_UP):
        motion.step(STEP)
    for _ in range(PAIRS):
        start = process_time()
        motion.step(STEP)
        cpu += process_time() - start
        profile.enable()
        motion.step(STEP)
        profile.disable()
    native = sum(
        entry.inlinetime
        for entry in profile.getstats()
        if isinstance(entry.code, str) and any(name in entry.code for name in NATIVE)
    )
    return {"cpu": cpu / PAIRS, "python": (cpu - native) / PAIRS}


def filling() -> Found:
    """`level_set` of a flower with 0.7 million particles: processor time [s] and peak memory [MB]."""
    from mpi4py import MPI

    import tawami
    from tawami.fem.environment import peak_memory

    def flower(x: Array, y: Array) -> Array:
        return np.asarray(np.hypot(x, y) - 0.42 * (1 + 0.15 * np.sin(24 * np.arctan2(y, x))))

    h = 1.02 / CELLS
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-0.51, -0.51), h=h, cells=(CELLS, CELLS))
    tawami.level_set(grid, lambda x, y: np.hypot(x, y) - 3 * h)  # loads libraries
    start = process_time()
    body = tawami.level_set(grid, flower)
    return {"cpu": process_time() - start, "MB": peak_memory(), "particles": len(body.x)}


NAMES: Mapping[str, Callable[[], Found]] = {
    "import": importing, "import for a scene": scene, "step": step, "level set": filling
}  # fmt: skip


def in_turns(checkouts: Sequence[tuple[str, Path]], rounds: int) -> dict[str, list[Found]]:
    """Medians of the measurements of each program, for each checkout (interpreter, root)."""
    found: dict[str, list[Found]] = {}
    for name in NAMES:
        runs = [[_run(*one, name) for one in checkouts] for _ in range(rounds)]
        found[name] = [
            {key: float(np.median([run[key] for run in of_one])) for key in of_one[0]}
            for of_one in zip(*runs, strict=True)
        ]
    return found


def _run(python: str, checkout: Path, name: str) -> Found:
    package = os.pathsep.join([str(checkout / "python"), str(Path(__file__).parents[3])])
    environment = os.environ | {"PYTHONPATH": package, "RAYON_NUM_THREADS": "1"}
    command = [python, "-m", "cases.costs.bench.overheads", name]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found: Found = json.loads(run.stdout.splitlines()[-1])
    return found


def lines(found: Mapping[str, Sequence[Found]]) -> list[str]:
    """Results of `in_turns` as text: this checkout, and its ratio to another one."""
    texts = ["\nimport, Python part of a step of 800 particles, level set (medians)"]
    for name, of_checkouts in found.items():
        new, old = of_checkouts[0], of_checkouts[-1]
        parts = [f"{key} {value:.4g}" + _ratio(value, old[key]) * (old is not new)
                 for key, value in new.items()]  # fmt: skip
        if "python" in new:
            parts.append(f"Python share {100 * new['python'] / new['cpu']:.0f} % (aim: at most 25)")
        texts.append(f"  {name}: {', '.join(parts)}")
    return texts


def _ratio(new: float, old: float) -> str:
    return f" ({new / old:.2f} of {old:.4g})"


if __name__ == "__main__":
    print(json.dumps(NAMES[sys.argv[1]]()), flush=True)
