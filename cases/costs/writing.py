"""What writing results costs, per particle and file, beside what it takes in the file system.

python -m cases.costs.writing [--cells 128] [--repeat 5]

A dynamic scene of cells^2 x 4 particles with stresses at random, nothing solved: displacement, stress,
mean stress, eps_v and velocity of the particles; displacement, mean stress (projected) and particles of
the grid; a row of a table; a checkpoint. `zlib` is what meshio does unless it is told not to.
"""

from __future__ import annotations

import argparse
import logging
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import meshio
import numpy as np
from mpi4py import MPI

import tawami
from cases.common.table import as_text
from tawami.base import archive
from tawami.motion.observer import Snapshot
from tawami.results.output import Output
from tawami.results.series import Format

COLUMNS = ("what", "us_per_particle", "bytes_per_particle")


@dataclass(frozen=True)
class Row:
    """The least of a few times [us], and the size of a file [bytes], over the number of particles."""

    what: str
    us_per_particle: float
    bytes_per_particle: float


def motion_of(cells: int) -> tawami.Dynamics:
    """A square block in the middle of the grid."""
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0.0, 0.0), h=1.0, cells=(cells + 2, cells + 2))
    body = tawami.box(grid, (1.0, 1.0), (cells + 1.0, cells + 1.0))
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1.0)
    random = np.random.default_rng(0)
    motion = tawami.Dynamics(scene, velocity=random.standard_normal((len(body.x), 2)))
    scene.particles.stress[:] = random.standard_normal((len(body.x), 4))
    return motion


def measure(
    what: str, motion: tawami.Dynamics, output: Output, folder: Path, repeat: int
) -> tuple[Row, Path]:
    """Time of a file, and the last one."""
    scene = motion.scene
    output.begin(folder, motion, None)
    times = []
    for step in range(repeat):
        before = perf_counter()
        output.look(Snapshot(motion, None, 0.1 * step, step, step == repeat - 1))
        times.append(perf_counter() - before)
    files = [path for path in (folder / output.name).glob("*") if path.is_file()]
    last = max(files, default=folder / f"{output.name}.csv")
    return _row(what, scene, min(times), last), last


def _row(what: str, scene: tawami.Scene, seconds: float, file: Path) -> Row:
    n = scene.num_particles
    return Row(what, 1e6 * seconds / n, file.stat().st_size / n)


def rows_of(cells: int, repeat: int, folder: Path) -> list[Row]:
    """Every kind of output once."""
    motion, rows = motion_of(cells), []
    scene, grid = motion.scene, ("displacement", "mean stress", "particles")
    kinds: tuple[Format, ...] = ("vtu", "xdmf")
    for kind in kinds:
        output = tawami.ParticleOutput(format=kind)
        row, file = measure(f"particles, {kind}", motion, output, folder / kind, repeat)
        rows.append(row)
        if kind == "vtu":
            mesh, packed = meshio.read(file), folder / "zlib.vtu"
            seconds = min(_timed(lambda m=mesh, p=packed: m.write(p)) for _ in range(repeat))  # type: ignore[misc]
            rows.append(_row("the same file with zlib", scene, seconds, packed))
    for kind in kinds:
        output_of_grid = tawami.GridOutput(*grid, format=kind)
        rows.append(measure(f"grid, {kind}", motion, output_of_grid, folder / kind, repeat)[0])
    table = tawami.TableOutput("momentum", "run-out", "step size")
    rows.append(measure("table, a row", motion, table, folder, repeat)[0])
    kept = folder / "checkpoint.npz"
    seconds = min(_timed(lambda: _keep(motion, kept)) for _ in range(repeat))
    rows.append(_row("checkpoint", scene, seconds, kept))
    return rows


def _keep(motion: tawami.Dynamics, path: Path) -> None:
    archive.write(path, {}, {"scene": motion.state()})


def _timed(action: Callable[[], object]) -> float:
    before = perf_counter()
    action()
    return perf_counter() - before


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m cases.costs.writing", description=__doc__)
    parser.add_argument("--cells", type=int, default=128, help="cells along a side of the block")
    parser.add_argument("--repeat", type=int, default=5, help="files, of which the fastest counts")
    options = parser.parse_args(arguments)
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    with tempfile.TemporaryDirectory() as folder:
        rows = rows_of(options.cells, options.repeat, Path(folder))
    print(f"{4 * options.cells**2} particles")
    print(as_text(rows, COLUMNS))


if __name__ == "__main__":
    tawami.run(main, "writing")
