"""Time, size and memory of the files of a run, per particle, on any number of ranks.

A dynamic scene with cells^2 x 4 particles and random stresses is written without solving a step:

particles    displacement, stress, mean stress, eps_v and velocity
grid         displacement, mean stress (projected) and number of particles
table        one row
checkpoint   the whole state

`zlib` is the compression that meshio uses by default. The memory is that of the arrays that exist only
while a file is written, on the rank with most: with each rank writing its own rows it is divided by the
number of ranks.

python -m cases.costs.writing
mpirun -n 4 python -m cases.costs.writing --cells 64
"""

from __future__ import annotations

import tempfile
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from time import perf_counter

import meshio
import numpy as np
from mpi4py import MPI

import tawami
from cases.common.program import Program
from cases.common.table import as_text

# internals, because a run writes these files only together with solving its steps
from tawami.base import archive, ranks
from tawami.motion.observer import Snapshot
from tawami.results.output import Output

COLUMNS = ("what", "us_per_particle", "bytes_per_particle", "memory_per_particle")
COMM = MPI.COMM_WORLD


@dataclass(frozen=True)
class Row:
    """Shortest time of several [us], size of the file [bytes] and memory of arrays on the rank with most
    [bytes], over the number of particles.
    """

    what: str
    us_per_particle: float
    bytes_per_particle: float
    memory_per_particle: float


def motion_of(cells: int) -> tawami.Dynamics:
    """A square block with random stresses and velocities in the middle of a grid."""
    grid = tawami.Grid(COMM, origin=(0.0, 0.0), h=1.0, cells=(cells + 2, cells + 2))
    body = tawami.box(grid, (1.0, 1.0), (cells + 1.0, cells + 1.0), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1.0)
    random = np.random.default_rng(0)
    motion = tawami.Dynamics(scene, velocity=random.standard_normal((len(body.x), 2)))
    scene.particles.stress[:] = random.standard_normal(scene.particles.stress.shape)
    return motion


def measure(
    what: str, motion: tawami.Dynamics, output: Output, folder: Path, repeat: int
) -> tuple[Row, Path]:
    """Write `repeat` files and measure them.

    Returns:
        The row of the table, and the last file.
    """
    scene, step = motion.scene, count()
    output.begin(folder, motion, None)

    def write() -> None:
        now = next(step)
        output.observe(Snapshot(motion, None, 0.1 * now, now, last=True))

    seconds, memory = _cost(write, repeat)
    files = [path for path in (folder / output.name).glob("*") if path.is_file()]
    last = max(files, default=folder / f"{output.name}.csv")
    return _row(what, scene, seconds, memory, last), last


def _row(what: str, scene: tawami.Scene, seconds: float, memory: float, file: Path) -> Row:
    n = scene.num_particles
    return Row(what, 1e6 * seconds / n, file.stat().st_size / n, memory / n)


def rows_of(cells: int, repeat: int, folder: Path) -> list[Row]:
    """Measure every kind of file."""
    motion, rows = motion_of(cells), []
    scene, grid = motion.scene, ("displacement", "mean stress", "particles")
    row, file = measure("particles", motion, tawami.ParticleOutput(), folder, repeat)
    rows.append(row)
    if COMM.size == 1:
        mesh, packed = meshio.read(file), folder / "zlib.vtu"
        cost = _cost(partial(mesh.write, packed), repeat)
        rows.append(_row("the same file with zlib", scene, *cost, packed))
    rows.append(measure("grid", motion, tawami.GridOutput(*grid), folder, repeat)[0])
    table = tawami.TableOutput("momentum", "run-out", "step size")
    rows.append(measure("table, a row", motion, table, folder, repeat)[0])
    checkpoint = folder / "checkpoint.npz"
    cost = _cost(lambda: archive.write(checkpoint, {}, motion.state(), COMM), repeat)
    rows.append(_row("checkpoint", scene, *cost, checkpoint))
    cost = _cost(lambda: archive.read(checkpoint, COMM), repeat)
    rows.append(_row("checkpoint, read", scene, *cost, checkpoint))
    return rows


def _cost(action: Callable[[], object], repeat: int) -> tuple[float, float]:
    """Shortest time of an action in `repeat` tries [s], and memory of its arrays [bytes]."""
    times = []
    for _ in range(repeat):
        before = perf_counter()
        action()
        times.append(perf_counter() - before)
    tracemalloc.start()
    action()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return min(times), ranks.largest(COMM, float(most))


PROGRAM = Program("cases.costs.writing", __doc__, files=False)
PROGRAM.option("--cells", type=int, default=128, help="cells along a side of the block")
PROGRAM.option("--repeat", type=int, default=5, help="number of files; the fastest one counts")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    options = PROGRAM.start(arguments)
    with tempfile.TemporaryDirectory() as folder:
        rows = rows_of(options.cells, options.repeat, Path(ranks.same(COMM, folder)))
        COMM.barrier()
    print(f"{4 * options.cells**2} particles")
    print(as_text(rows, COLUMNS))


if __name__ == "__main__":
    PROGRAM.run(main)
