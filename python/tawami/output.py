"""Results as files: particles and grid as VTU. A file appears when it is whole, or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import inputs, ranks
from tawami.basis import extraction
from tawami.errors import OutputError
from tawami.solution import Solution

Array = npt.NDArray[np.float64]
SOLVED = "a tawami.Solution, as scene.solve() gives it"


def result_folder(path: str | Path) -> Path:
    """A folder that can be written, made if it is not there.

    Raises:
        OutputError: It cannot be made or written.
    """
    folder = inputs.path("result folder", path)
    probe = folder / f".probe-{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        with suppress(OSError):
            probe.unlink(missing_ok=True)
        raise OutputError(
            f"result folder '{folder}' cannot be written ({error.strerror}): expected a folder with "
            "write permission; choose another one"
        ) from error
    return folder


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its name when the block ends well.

    Raises:
        OutputError: The file cannot be written; what was at `path` before is still there.
    """
    target = inputs.path("path", path)
    if not target.name:
        raise OutputError(f"'{target}': expected the name of a file")
    part = target.with_name(f".{os.getpid()}-{target.name}")
    try:
        yield part
        part.replace(target)
    except OSError as error:
        raise OutputError(f"'{target}' cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # where it could not be made, in a folder that is gone, ...
            part.unlink(missing_ok=True)


def write_particles(path: str | Path, solution: Solution) -> None:
    """Particles as VTU vertices with displacement [m], stress and mean stress [Pa], volume [m2].

    Args:
        path: File to write, ending in .vtu.
        solution: What was solved.

    Raises:
        OutputError: The file cannot be written.
    """
    inputs.instance("write_particles: solution", solution, Solution, SOLVED)
    n = len(solution.x)
    data: dict[str, Array] = {
        "displacement [m]": _with_z(solution.displacement_of_particles),
        "stress xx yy zz xy [Pa]": solution.stress,
        "mean stress [Pa]": solution.mean_stress,
        "volume [m2 per m]": solution.volume,
    }
    if solution.scene.form.kinematics == "mixed":
        data["eps_v [-]"] = solution.eps_v
    cells = [("vertex", np.arange(n)[:, None])]
    _write(path, solution.scene.grid.comm, solution.x, cells, data)


def write_grid(path: str | Path, solution: Solution) -> None:
    """Cells of the grid as VTU squares: displacement [m] and the bilinear field at the vertices,
    number of particles in each cell.

    Args:
        path: File to write, ending in .vtu.
        solution: What was solved.

    Raises:
        OutputError: The file cannot be written.
    """
    inputs.instance("write_grid: solution", solution, Solution, SOLVED)
    scene = solution.scene
    grid = scene.grid
    (nx, ny), (x0, y0) = grid.cells, grid.origin
    x, y = x0 + grid.h * np.arange(nx + 1), y0 + grid.h * np.arange(ny + 1)
    points = np.column_stack([np.tile(x, ny + 1), np.repeat(y, nx + 1)])
    corner = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    squares = corner[:, None] + np.array([0, 1, nx + 2, nx + 1])
    vertex = extraction(scene.basis, grid.cells, 1)
    data: dict[str, Array] = {
        "displacement [m]": _with_z(vertex @ solution.u.reshape(-1, 2)),
    }
    if len(scene.form.fields) > 1:
        name, unit = (
            list(scene.form.fields.items())[1][0],
            "-" if scene.form.kinematics == "mixed" else "Pa",
        )
        data[f"{name} [{unit}]"] = np.asarray(solution.volumetric)
    count = {"particles [-]": [scene.particles_per_cell.astype(float)]}
    _write(path, grid.comm, points, [("quad", squares)], data, count)


def _with_z(values: npt.ArrayLike) -> Array:
    return np.pad(np.asarray(values, dtype=float), ((0, 0), (0, 1)))


def _write(
    path: str | Path,
    comm: Any,
    points: Array,
    cells: list[tuple[str, npt.NDArray[Any]]],
    point_data: dict[str, Array],
    cell_data: dict[str, list[Array]] | None = None,
) -> None:
    import meshio  # here: a scene without output does without it

    mesh = meshio.Mesh(_with_z(points), cells, point_data=point_data, cell_data=cell_data)
    if inputs.path("path", path).suffix != ".vtu":
        raise OutputError(f"'{path}': expected a file name ending in .vtu")
    with ranks.together(comm):
        if comm.rank == 0:
            with whole_file(path) as part:
                meshio.write(part, mesh, file_format="vtu")
