"""Single files of a solution."""

from __future__ import annotations

from pathlib import Path

from tawami.base import checks
from tawami.motion.observer import Snapshot
from tawami.quantities.quantities import of_particles
from tawami.results.frame import grid_frame, particle_frame
from tawami.results.grid_quantities import on_grid, usual_on_grid
from tawami.results.vtu import write_vtu
from tawami.scene.solution import Solution

SOLVED = "a tawami.Solution, as scene.solve() returns it"


def write_particles(path: str | Path, solution: Solution) -> None:
    """Write the particles as VTU vertices: displacement [m], stress and mean stress [Pa], volume [m2],
    and eps_v if the form has that field.

    Args:
        path: File to write, ending in .vtu.
        solution: The solution.

    Raises:
        OutputError: The file cannot be written.
    """
    checks.instance("write_particles: solution", solution, Solution, SOLVED)
    scene = solution.scene
    names = ["displacement", "stress", "mean stress", "volume"]
    names += ["eps_v"] if scene.form.kinematics.has_eps_v else []
    frame = particle_frame(of_particles(names, scene), scene, solution.own)
    write_vtu(path, frame, scene.grid.comm)


def write_grid(path: str | Path, solution: Solution) -> None:
    """Write the cells of the grid as VTU squares: displacement [m] and the bilinear field at the
    vertices, number of particles in each cell.

    Args:
        path: File to write, ending in .vtu.
        solution: The solution.

    Raises:
        OutputError: The file cannot be written.
    """
    checks.instance("write_grid: solution", solution, Solution, SOLVED)
    scene = solution.scene
    snapshot = Snapshot(scene, solution, 0.0, 0, last=True)
    frame = grid_frame(on_grid(usual_on_grid(scene), scene), snapshot)
    write_vtu(path, frame, scene.grid.comm)
