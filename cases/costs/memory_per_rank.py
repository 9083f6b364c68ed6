"""Memory of a rank at fixed work per rank: resident memory, and the NumPy arrays of a scene by holder.

A block of cells full of particles for each rank, on 1, 2, 4 and 8 ranks (which share the processors of
this machine): on rollers under a pressure, solved once by multigrid, and off the lines of the grid,
where supports and an obstacle act on patches of its border, solved by a factorisation. A holder is an
attribute, or a path of attributes, from the scene. The table has the largest holders of the last run, in
bytes on the rank with most. `growth` is the ratio of the last run to the first: about 1 where a rank
holds its own part, and the number of ranks where it holds what is as long as the grid or the body.
`border kB` are the arrays of the points of the border, and `gathered kB` the largest array that a rank
gets from all others while it solves. Times are processor time of the first rank.

python -m cases.costs.memory_per_rank
python -m cases.costs.memory_per_rank --scenes border --cells 24
python -m cases.costs.memory_per_rank --cells 64 --ranks 1,4
"""

from __future__ import annotations

import functools
import gc
import json
import resource
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import process_time
from types import FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.common.program import Program, numbers
from cases.common.table import as_csv, as_text
from tawami.base import ranks as base_ranks
from tawami.base.program import mpirun

PROGRAM = Program("cases.costs.memory_per_rank", __doc__)
WHOLE = numbers(int, lambda n: n > 0, "whole numbers separated by commas, such as 1,2,4")
PROGRAM.option("--ranks", type=WHOLE, default="1,2,4,8", help="numbers of ranks")
PROGRAM.option("--cells", type=int, default=48, help="cells of a rank along each axis")
SCENES = "scenes separated by commas: rollers, border"
PROGRAM.option("--scenes", default="rollers,border", help=SCENES)
PROGRAM.option("--solver", default="multigrid", help="linear solver on rollers")
PROGRAM.option("--rows", type=int, default=25, help="holders in the table")
#: Holders that are counted together, and objects that are no holders.
SHORT, SKIPPED = 4096, (type, ModuleType, str, bytes, int, float, bool, complex)


@dataclass(frozen=True)
class Row:
    """A holder: bytes in the last run, its growth, and its name."""

    bytes: int
    growth: float
    holder: str


def scene_of(name: str, n: int, comm: Any, solver: str) -> tawami.Scene:
    """A block of n x n cells for each rank, on rollers under a pressure, or under an obstacle."""
    across = 2 ** ((comm.size.bit_length()) // 2)
    cells = (n * across, n * (comm.size // across))
    grid = tawami.Grid(comm, origin=(0, 0), h=1 / n, cells=cells)
    law = tawami.linear_elastic(E=1e6, nu=0.4)
    if name == "border":
        low, high = 0.3 * grid.h, np.subtract(grid.upper, 0.4 * grid.h)
        body = tawami.box(grid, (low, low), high)
        of = {"ghost_penalty": "on", "linear_solver": "direct"}  # contact takes many iterations
        scene = tawami.Scene(grid, body, law, alpha=0.01, **of)
        scene.fix("left", "x")
        scene.fix("bottom", "x")
        scene.fix("bottom", "y")
        plane = tawami.half_plane((0, high[1]), (0, -1))
        scene.obstacle(plane, 0.0, "top", displacement=(0, -1e-3))
        return scene
    body = tawami.box(grid, (0, 0), grid.upper)
    scene = tawami.Scene(grid, body, law, alpha=0.01, linear_solver=solver)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.pressure("top", lambda x, y: 1e3 * (x < 0.5))
    return scene


def held(start: Any) -> dict[str, int]:
    """Bytes of all arrays that can be reached from an object, by the shortest path of names."""
    found: dict[str, int] = {}
    seen, waiting = {id(start)}, deque([("scene", start)])
    for cache in _caches():
        waiting.append((f"cache of {cache.__module__}.{cache.__qualname__}", cache))
    while waiting:
        path, value = waiting.popleft()
        if isinstance(value, np.ndarray):
            while isinstance(value.base, np.ndarray):
                value = value.base
            if id(value) not in seen or path == "scene":
                seen.add(id(value))
                found[path] = found.get(path, 0) + value.nbytes
            continue
        for name, part in _parts(value):
            mine = isinstance(part, np.ndarray) or not isinstance(part, SKIPPED)
            if mine and part is not None and id(part) not in seen:
                if not isinstance(part, np.ndarray):
                    seen.add(id(part))
                waiting.append((path + name, part))
    return found


def _caches() -> Iterator[Any]:
    """Functions of the package that keep their results."""
    for name, module in list(sys.modules.items()):
        if name.startswith("tawami"):
            yield from (f for f in vars(module).values() if hasattr(f, "cache_info"))


def _parts(value: Any) -> Iterator[tuple[str, Any]]:
    """Parts of an object, with their names."""
    if isinstance(value, dict):
        yield from ((f"[{key!s:.30}]", part) for key, part in list(value.items()))
    elif isinstance(value, (list, tuple, set, frozenset, deque)):
        yield from (("[]", part) for part in value)
    elif isinstance(value, FunctionType):
        cells = value.__closure__ or ()
        yield from (
            (f".{n}", c.cell_contents)
            for n, c in zip(value.__code__.co_freevars, cells, strict=True)
        )
    elif isinstance(value, MethodType):
        yield ".__self__", value.__self__
    elif isinstance(value, functools.partial):
        yield ".args", (value.func, value.args, value.keywords)
    elif hasattr(value, "cache_info"):
        yield from (("", part) for part in gc.get_referents(value) if isinstance(part, dict))
    else:
        yield from (
            ((f".{name}", part) for name, part in vars(value).items())
            if hasattr(value, "__dict__")
            else ()
        )
        for kind in type(value).__mro__:
            for name in getattr(kind, "__slots__", ()):
                if hasattr(value, name):
                    yield f".{name}", getattr(value, name)


def resident() -> int:
    """Resident memory of this process [bytes]."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def of_border(scene: tawami.Scene) -> int:
    """Bytes of the arrays of all points of the border."""
    found = 0
    for points in scene.configuration.border.all:
        parts = [vars(points), vars(points.made), vars(points.first)]
        arrays = [value for part in parts for value in part.values()]
        found += sum(value.nbytes for value in arrays if isinstance(value, np.ndarray))
    return found


def watched() -> list[int]:
    """A list that gets the bytes of each array that ranks gather or add up from now on."""
    found = [0]

    def watch(name: str) -> None:
        given = getattr(base_ranks, name)

        @functools.wraps(given)
        def call(*arguments: Any) -> Any:
            result = given(*arguments)
            found.append(result.nbytes)
            return result

        setattr(base_ranks, name, call)

    for name in ("scattered", "allgathered", "sum_of"):
        watch(name)
    return found


def of_rank(name: str, cells: int, solver: str) -> None:
    """Solve on all ranks; the first one prints the largest numbers of any rank as JSON."""
    comm = MPI.COMM_WORLD
    scene_of(name, 2, comm, solver).solve()  # loads libraries and compiles the form
    before, began = resident(), process_time()
    scene = scene_of(name, cells, comm, solver)
    made, gathered = process_time(), watched()
    solution = scene.solve()
    times = {"making": made - began, "solving": process_time() - made}
    mine: dict[str, Any] = {"resident": resident() - before, "holders": held([scene, solution])}
    mine |= {"border": of_border(scene), "gathered": max(gathered)}
    parts = comm.gather(mine)
    if comm.rank == 0:
        names = {name for part in parts for name in part["holders"]}
        most = {name: max(part["holders"].get(name, 0) for part in parts) for name in names}
        total = max(sum(part["holders"].values()) for part in parts)
        largest = {
            key: max(part[key] for part in parts) for key in ("resident", "border", "gathered")
        }
        found = {**largest, "total": total, "holders": most, **times}
        print(json.dumps(found | {"iterations": sum(solution.krylov)}))


def measured(scene: str, ranks: int, cells: int, solver: str) -> dict[str, Any]:
    """The numbers of a run on several ranks."""
    program = [sys.executable, "-m", "cases.costs.memory_per_rank"]
    words = [*program, "--rank", scene, str(cells), solver]
    command, environment = mpirun(ranks, words)
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(run.stderr)
    found: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    return found


def rows_of(first: dict[str, int], last: dict[str, int]) -> list[Row]:
    """The holders of the last run, the largest first."""
    rows = [Row(size, size / max(first.get(name, 0), 1), name) for name, size in last.items()]
    return sorted((row for row in rows if row.bytes > SHORT), key=lambda row: -row.bytes)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print both tables of each scene."""
    options = PROGRAM.start(arguments)
    for scene in options.scenes.split(","):
        of_scene(scene, options)
    PROGRAM.list_results()


def of_scene(scene: str, options: Any) -> None:
    """Measure a scene, and print both tables."""
    runs = [measured(scene, ranks, options.cells, options.solver) for ranks in options.ranks]
    print(f"\n{scene}: {options.cells} x {options.cells} cells for each rank")
    print(
        "ranks  resident MB    arrays MB   growing MB    border kB  gathered kB     making s    "
        "solving s  iterations"
    )
    first = runs[0]["holders"]
    for ranks, run in zip(options.ranks, runs, strict=True):
        growing = [
            row for row in rows_of(first, run["holders"]) if row.growth > 1 + 0.5 * (ranks - 1)
        ]
        sizes = (run["resident"], run["total"], sum(row.bytes for row in growing))
        columns = [size / 1e6 for size in sizes] + [run["border"] / 1e3, run["gathered"] / 1e3]
        columns += [run["making"], run["solving"]]
        shown = "  ".join(f"{value:11.2f}" for value in columns)
        print(f"{ranks:5}  {shown}  {run['iterations']:10}")
    rows = rows_of(first, runs[-1]["holders"])
    print("\n" + as_text(rows[: options.rows], ("bytes", "growth", "holder")))
    PROGRAM.write(f"{scene}.csv", as_csv(rows, ("bytes", "growth", "holder")))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--rank"]:
        of = sys.argv[2], int(sys.argv[3]), sys.argv[4]
        tawami.run(lambda: of_rank(*of), "memory_per_rank")
    else:
        PROGRAM.run(main)
