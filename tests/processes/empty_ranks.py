"""A small body in a long grid, which test_empty_ranks.py runs on several ranks.

Ranks are without particles where the body has fewer cells, and cells change their rank as the body moves
on: every output, quantity and checkpoint must be that of one rank.

python tests/processes/empty_ranks.py FOLDER
"""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from tawami.base import archive
from tawami.base.ranks import allgathered
from tawami.motion.observer import Snapshot
from tawami.results import write_grid, write_particles
from tawami.results.frame import grid_frame
from tawami.results.grid_quantities import on_grid

COMM = MPI.COMM_WORLD
FIELDS = ("stress", "mean stress", "deviatoric stress q", "eps_v", "plastic_strain")
OF_PARTICLES = ("displacement", *FIELDS, "volume", "velocity", "acceleration", "material", "number")
OF_GRID = ("displacement", "velocity", "particles", "reaction", *FIELDS)
COLUMNS = (
    "energies", "momentum", "angular momentum", "reaction bottom", "run-out", "particles",
    "Newton iterations", "step size", "displacement (0.4, 0.3)",
)  # fmt: skip
#: Speed [m/s]: the body crosses the grid in a few steps of DT [s].
SPEED, DT, STEPS = 80.0, 0.01, 5


def moving(leaving: str = "stop", speed: float = SPEED) -> tawami.Dynamics:
    """A plastic block that slides on a rough wall along the grid, with a stress at the start."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(24, 3))
    body = tawami.box(grid, (0.25, 0.0), (0.75, 0.5), per_axis=2)
    laws = [
        tawami.von_mises(tawami.linear_elastic(E=1e5, nu=0.3), yield_stress=1e3, hardening=10.0),
        tawami.mohr_coulomb(tawami.linear_elastic(E=2e5, nu=0.3), phi=30.0, c=1e3),
    ]
    scene = tawami.Scene(
        grid, body, laws, material_of=(body.x[:, 1] > 0.25).astype(int), form="u_epsv_finite",
        density=1000.0, leaving=leaving,
    )  # fmt: skip
    assert np.array_equal(scene.particles.number, body.number)
    scene.gravity((0.0, -9.81))
    scene.wall("bottom", 0.1)
    scene.initial("stress", lambda x, y: (-50.0 * y, -100.0 * y, -50.0 * y, 0.0))
    scene.load(body.x[:, 1] > 0.3, (10.0, -5.0))
    return tawami.Dynamics(scene, velocity=lambda x, y: (speed, 0.5 * y))


def results(folder: Path, **options: Any) -> tawami.Results:
    outputs = [
        tawami.ParticleOutput(*OF_PARTICLES, every_steps=4),
        tawami.GridOutput(*OF_GRID, every_steps=4),
        tawami.GridOutput(*FIELDS, every_steps=4, name="consistent", projection="consistent"),
        tawami.BorderOutput(every_steps=4),
        tawami.TableOutput(*COLUMNS),
    ]
    return tawami.Results(folder, *outputs, checkpoint_steps=1, progress=False, **options)


class StopError(Exception):
    """Ends a run after a step."""


def stop_at(step: int) -> Any:
    seen: list[int] = []

    def each(_: tawami.Solution) -> None:
        seen.append(step)
        if len(seen) == step:
            raise StopError

    return each


def slide(folder: Path) -> dict[str, np.ndarray]:
    """Run with results, interrupted in the middle and resumed."""
    counts = [COMM.allgather(len(moving().scene.particles.number))]
    with suppress(StopError):
        moving().run(DT * STEPS, DT, each=stop_at(3), results=results(folder / "slide"))
    motion = moving()
    motion.run(DT * STEPS, DT, results=results(folder / "slide", existing="resume"))
    counts.append(COMM.allgather(len(motion.scene.particles.number)))
    energies = motion.energies
    found = {
        "counts": np.array(counts),
        "momentum": motion.linear_momentum,
        "energy": np.array([motion.kinetic_energy, motion.elastic_energy, energies.dissipated]),
    }
    return found | {f"slide {name}": values for name, values in arrays(motion).items()}


def leave() -> dict[str, np.ndarray]:
    """Particles that leave the grid, until a few are left on the last rank."""
    motion, told = moving("remove", 1.725 * SPEED), "nothing"
    try:
        motion.run(DT * STEPS, DT)
    except tawami.InputError as error:
        told = str(error)
    assert all("the last particle would leave" in text for text in COMM.allgather(told))
    return {"left": np.array([len(motion.scene.left)])} | {
        f"leave {name}": values for name, values in arrays(motion).items()
    }


def arrays(motion: tawami.Dynamics) -> dict[str, np.ndarray]:
    particles = motion.scene.particles
    order = np.argsort(allgathered(COMM, particles.number))
    parts = {
        "x": particles.x, "stress": particles.stress, "velocity": motion.velocity,
        "plastic": particles.history("plastic_strain"), "eps_v": particles.eps_v,
    }  # fmt: skip
    return {name: allgathered(COMM, np.array(part))[order] for name, part in parts.items()}


def statics(folder: Path) -> dict[str, np.ndarray]:
    """A static scene, its solution and single files."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(24, 3))
    body = tawami.box(grid, (0.25, 0.0), (0.5, 0.25), per_axis=3)
    found = {}
    for solver in ("direct", "multigrid"):
        law = tawami.linear_elastic(E=1e5, nu=0.3)
        scene = tawami.Scene(grid, body, law, form="u_epsv", density=1.0, linear_solver=solver)
        scene.fix("bottom", "x")
        scene.fix("bottom", "y")
        scene.gravity((1.0, -9.81))
        scene.hold((0.4, 0.2), "x", 1e-3)
        outputs = tawami.BorderOutput(), tawami.TableOutput("displacement (0.4, 0.2)")
        tawami.ramp(scene, 0.5, results=tawami.Results(folder / solver, *outputs, progress=False))
        solution = scene.solve()
        write_particles(folder / f"{solver}.vtu", solution)
        write_grid(folder / f"{solver} grid.vtu", solution)
        found |= {
            f"static {solver} u": solution.u,
            f"static {solver} stress": solution.stress,
            f"static {solver} mean": solution.mean_stress,
            f"static {solver} eps_v": solution.eps_v,
            f"static {solver} point": solution.displacement((0.4, 0.2)),
            f"static {solver} reaction": solution.reaction("bottom"),
        }
    counts = np.array(COMM.allgather(len(scene.particles)))
    return found | {"static counts": counts}


def kept(folder: Path) -> dict[str, np.ndarray]:
    """A motion at small strain that is stored and restored: coefficients, and forces that fade."""

    def motion_of() -> tuple[tawami.Dynamics, Any]:
        grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(24, 3))
        body = tawami.box(grid, (0.25, 0.0), (0.75, 0.5), per_axis=2)
        law = tawami.linear_elastic(E=1e5, nu=0.3)
        scene = tawami.Scene(grid, body, law, density=1000.0)
        scene.fix("bottom", "x")
        scene.fix("bottom", "y")
        scene.gravity((1.0, -9.81))
        return tawami.Dynamics(scene, velocity=(0.1, 0.0)), body.x[:, 1] > 0.25

    motion, above = motion_of()
    motion.step(1e-3)
    motion.scene.remove(above)
    archive.write(folder / "state.npz", {}, motion.state(), COMM)
    other, _ = motion_of()
    other.restore(archive.read(folder / "state.npz", COMM)[1])
    one, again = motion.step(1e-3), other.step(1e-3)
    assert np.array_equal(one.u, again.u)
    frame = grid_frame(on_grid(OF_GRID[:4], motion), Snapshot(motion, one, 0.0, 1, last=True))
    rows = np.array(COMM.allgather([len(frame.points), len(frame.cells)]))
    assert (rows.sum(axis=0) == [25 * 4, 24 * 3]).all()
    return {"kept u": one.u, "rows": rows.max(axis=0)}


def all_of(folder: Path) -> dict[str, np.ndarray]:
    return slide(folder) | leave() | statics(folder) | kept(folder)


if __name__ == "__main__":
    where = Path(sys.argv[1])
    found = all_of(where)
    if COMM.rank == 0:
        np.savez(where / "found.npz", **found)
