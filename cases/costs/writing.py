"""Time and size of the files of a run, per particle.

A dynamic scene with cells^2 x 4 particles and random stresses is written without solving a step:

particles    displacement, stress, mean stress, eps_v and velocity
grid         displacement, mean stress (projected) and number of particles
table        one row
checkpoint   the whole state

`zlib` is the compression that meshio uses by default.

python -m cases.costs.writing
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter

import meshio
import numpy as np
from mpi4py import MPI

import tawami
from cases.common.program import Program
from cases.common.table import as_text

# internals, because a run writes these files only together with solving its steps
from tawami.base import archive
from tawami.motion.observer import Snapshot
from tawami.results.output import Output

COLUMNS = ("what", "us_per_particle", "bytes_per_particle")


@dataclass(frozen=True)
class Row:
    """Shortest time of several [us] and size of the file [bytes], over the number of particles."""

    what: str
    us_per_particle: float
    bytes_per_particle: float


def motion_of(cells: int) -> tawami.Dynamics:
    """A square block with random stresses and velocities in the middle of a grid."""
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0.0, 0.0), h=1.0, cells=(cells + 2, cells + 2))
    body = tawami.box(grid, (1.0, 1.0), (cells + 1.0, cells + 1.0), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1.0)
    random = np.random.default_rng(0)
    motion = tawami.Dynamics(scene, velocity=random.standard_normal((len(body.x), 2)))
    scene.particles.stress[:] = random.standard_normal((len(body.x), 4))
    return motion


def measure(
    what: str, motion: tawami.Dynamics, output: Output, folder: Path, repeat: int
) -> tuple[Row, Path]:
    """Write `repeat` files and measure them.

    Returns:
        The row of the table, and the last file.
    """
    scene = motion.scene
    output.begin(folder, motion, None)
    times = []
    for step in range(repeat):
        before = perf_counter()
        output.observe(Snapshot(motion, None, 0.1 * step, step, step == repeat - 1))
        times.append(perf_counter() - before)
    files = [path for path in (folder / output.name).glob("*") if path.is_file()]
    last = max(files, default=folder / f"{output.name}.csv")
    return _row(what, scene, min(times), last), last


def _row(what: str, scene: tawami.Scene, seconds: float, file: Path) -> Row:
    n = scene.num_particles
    return Row(what, 1e6 * seconds / n, file.stat().st_size / n)


def rows_of(cells: int, repeat: int, folder: Path) -> list[Row]:
    """Measure every kind of file."""
    motion, rows = motion_of(cells), []
    scene, grid = motion.scene, ("displacement", "mean stress", "particles")
    row, file = measure("particles", motion, tawami.ParticleOutput(), folder, repeat)
    rows.append(row)
    mesh, packed = meshio.read(file), folder / "zlib.vtu"
    seconds = _shortest(partial(mesh.write, packed), repeat)
    rows.append(_row("the same file with zlib", scene, seconds, packed))
    rows.append(measure("grid", motion, tawami.GridOutput(*grid), folder, repeat)[0])
    table = tawami.TableOutput("momentum", "run-out", "step size")
    rows.append(measure("table, a row", motion, table, folder, repeat)[0])
    checkpoint = folder / "checkpoint.npz"
    seconds = _shortest(partial(_write_checkpoint, motion, checkpoint), repeat)
    rows.append(_row("checkpoint", scene, seconds, checkpoint))
    return rows


def _write_checkpoint(motion: tawami.Dynamics, path: Path) -> None:
    archive.write(path, {}, motion.state())


def _shortest(action: Callable[[], object], repeat: int) -> float:
    """Shortest time of an action in `repeat` tries [s]."""
    times = []
    for _ in range(repeat):
        before = perf_counter()
        action()
        times.append(perf_counter() - before)
    return min(times)


PROGRAM = Program("cases.costs.writing", __doc__, files=False)
PROGRAM.option("--cells", type=int, default=128, help="cells along a side of the block")
PROGRAM.option("--repeat", type=int, default=5, help="number of files; the fastest one counts")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    options = PROGRAM.start(arguments)
    with tempfile.TemporaryDirectory() as folder:
        rows = rows_of(options.cells, options.repeat, Path(folder))
    print(f"{4 * options.cells**2} particles")
    print(as_text(rows, COLUMNS))


if __name__ == "__main__":
    PROGRAM.run(main)
