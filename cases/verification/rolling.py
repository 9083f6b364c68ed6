"""A disc that rolls down a plane, and a block that slides down it or sticks to it.

     .-.
    (   )             disc: R = 0.5 m, E = 10 MPa, mu = 0.6
   o `-'              block: 0.5 x 0.25 m, E = 1 MPa, mu = 0.3 and 0.7
   |  ' .   .-.       nu = 0.3, rho = 1000 kg/m3, g = 9.81 m/s2
   |      '(   )
   |_______ `-'_      the plane, at 30 degrees, is a rigid obstacle with Coulomb friction

A rigid disc rolls if 3 mu > tan(angle), with friction as large as rolling needs. A block slides if
mu < tan(angle), with friction as large as Coulomb's law allows, and sticks otherwise:

    a = (2/3) g sin(angle),    a = g (sin(angle) - mu cos(angle)),    a = 0.

Gravity is inclined in the model, and the plane is horizontal: it lies between two lines of the grid. The
bodies move at finite strain and start in equilibrium: the disc on a level plane, which is then inclined,
the block on a plane with mu = 1, which then becomes smoother. The acceleration is the slope of the
velocity over time.

python -m cases.verification.rolling
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.common.figure import save
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from tawami.picture import style

Array = npt.NDArray[np.float64]
Model = tuple[tawami.Scene, Any]  # with the plane

G, ANGLE = 9.81, float(np.radians(30.0))  # [m/s2], [rad]
RADIUS, ROLLS, SLIDES, STICKS = 0.5, 0.6, 0.3, 0.7  # of the disc [m]; friction [-]
RHO, NU = 1000.0, 0.3  # [kg/m3], [-]
STEP = {"rolls": 0.01, "slides": 0.02, "sticks": 0.02}  # [s]


def exact(how: str, angle: float = ANGLE, friction: float = SLIDES) -> float:
    """Acceleration along the plane [m/s2] of a rigid body that 'rolls', 'slides' or 'sticks'."""
    if how == "rolls":
        return float(2 / 3 * G * np.sin(angle))
    return float(G * (np.sin(angle) - friction * np.cos(angle))) if how == "slides" else 0.0


def slope(angle: float) -> tuple[float, float]:
    """Gravity on a plane at an angle [m/s2], along the plane and across it."""
    return float(G * np.sin(angle)), float(-G * np.cos(angle))


def block_on_incline(angle: float, friction: float, cells: int = 2, length: float = 0.5) -> Model:
    """A block at rest on a plane, which then has another friction.

    Args:
        angle: Of the plane [rad].
        friction: Of the plane.
        cells: Cells over the height of the block.
        length: Way for which there is room [m].
    """
    width, height = 0.5, 0.25
    h = height / cells
    room = int(np.ceil((width + length) / h)) + 4, cells + 2
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=h, cells=room)
    left, foot = 1.9 * h, 0.368 * h  # cuts the cells
    body = tawami.box(grid, (left, foot), (left + width, foot + height), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=NU)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=RHO)
    scene.gravity(slope(angle))
    plane = scene.obstacle(tawami.half_plane((0.0, foot), (0.0, 1.0)), 1.0)
    scene.solve()
    plane.change(friction=friction)
    return scene, plane


def disc_on_incline(angle: float, friction: float, cells: int, length: float = 0.35) -> Model:
    """A disc at rest on a level plane, which is then inclined.

    Args:
        angle: Of the plane [rad].
        friction: Of the plane.
        cells: Cells over the radius.
        length: Way for which there is room [m].
    """
    h = RADIUS / cells
    room = (int(np.ceil((2 * RADIUS + length) / h)) + 4, int(np.ceil(2 * RADIUS / h)) + 4)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=h, cells=room)
    centre = (RADIUS + 2 * h + 0.013, RADIUS + 1.7 * h)
    body = tawami.disc(grid, centre, RADIUS, per_axis=2)
    law = tawami.linear_elastic(E=1e7, nu=NU)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=RHO)
    weight = scene.gravity((0.0, slope(angle)[1]))
    plane = tawami.half_plane((0.0, centre[1] - RADIUS + 0.02 * h), (0.0, 1.0))
    obstacle = scene.obstacle(plane, friction)
    held = scene.hold((centre[0], centre[1] + 0.3), "x")
    scene.solve()
    held.release()
    weight.change(slope(angle))
    return scene, obstacle


def speed_of(motion: tawami.Dynamics) -> float:
    """Mean velocity along the plane [m/s]."""
    return float(motion.linear_momentum[0] / motion.mass.sum())


@dataclass(frozen=True)
class Run:
    """Motion of a body along the plane.

    Attributes:
        body: 'disc' or 'block'.
        friction: Of the plane.
        n: Cells over the radius of the disc, or over the height of the block.
        acceleration: [m/s2].
        error: Its error [%]; for a block that sticks, over g sin(angle).
        behind: Error of the displacement at the end, over that of the closed form or, for a block that
            sticks, without friction [%].
        iterations, most: Newton iterations per step, mean and largest number.
        growth: Sum of all increases of kinetic + elastic - external energy [% of the kinetic energy at
            the end by the closed form; for a block that sticks, of one without friction].
        t, way: Time [s] and displacement of the centre of mass along the plane [m], after each step.
    """

    body: str
    friction: float
    n: int
    acceleration: float
    error: float
    behind: float
    iterations: float
    most: int
    growth: float
    t: Array
    way: Array


COLUMNS = (
    "body", "friction", "n", "acceleration", "error", "behind",
    "iterations", "most", "growth",
)  # fmt: skip


def solve(how: str, n: int, end: float = 0.3) -> Run:
    """Let a body move down the plane.

    Args:
        how: 'rolls', 'slides' or 'sticks'.
        n: Cells over the radius of the disc, or over the height of the block.
        end: Duration [s].
    """
    body = "disc" if how == "rolls" else "block"
    friction = {"rolls": ROLLS, "slides": SLIDES, "sticks": STICKS}[how]
    build = disc_on_incline if body == "disc" else block_on_incline
    scene, _ = build(ANGLE, friction, n)
    motion = tawami.Dynamics(scene)
    start = motion.mass @ scene.particles.x[:, 0] / motion.mass.sum()
    rows = [(0.0, 0.0, 0.0, motion.kinetic_energy + motion.elastic_energy)]
    iterations: list[int] = []

    def each(solution: tawami.Solution) -> None:
        e = motion.energies
        way = motion.mass @ scene.particles.x[:, 0] / motion.mass.sum() - start
        rows.append((motion.time, speed_of(motion), way, e.kinetic + e.elastic - e.external))
        iterations.append(solution.iterations)

    motion.run(end, STEP[how], each=each)
    t, speed, way, energy = np.transpose(rows)
    a = float(np.polyfit(t, speed, 1)[0])
    reference = exact(how) or G * float(np.sin(ANGLE))
    inertia = 1.5 if how == "rolls" else 1.0
    most = 0.5 * inertia * motion.mass.sum() * (reference * end) ** 2
    growth = np.maximum(np.diff(energy), 0).sum() / most
    return Run(
        body, friction, n, a, 100 * (a - exact(how)) / reference,
        100 * float(2 * way[-1] / end**2 - exact(how)) / reference,
        float(np.mean(iterations)), max(iterations), 100 * float(growth), t, way,
    )  # fmt: skip


def draw(runs: Sequence[Run], path: Path) -> None:
    """Draw the displacement along the plane over time, with the closed forms."""
    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    t = np.linspace(0, max(run.t[-1] for run in runs), 200)
    for k, how in enumerate(("rolls", "slides", "sticks")):
        axes.plot(t, 500 * exact(how) * t**2, "k", linewidth=0.8, label=None if k else "rigid body")
    for run, colour in zip(runs, style.LINES, strict=False):
        label = f"{run.body}, $\\mu$ = {run.friction}, n = {run.n}"
        axes.plot(run.t, 1e3 * run.way, "o", color=colour, markersize=3.5, label=label)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("displacement along the plane [mm]")
    axes.grid()
    axes.legend()
    save(figure, path)


PROGRAM = Program("cases.verification.rolling", __doc__)
PROGRAM.option("--cells", type=int, default=20, help="cells over the radius of the finest disc")


def main(arguments: Sequence[str] | None = None) -> None:
    """Let the bodies go, print the table, draw the figure."""
    n = PROGRAM.start(arguments).cells
    runs = [solve("rolls", m) for m in (n // 4, n // 2, n)]
    runs += [solve("slides", 2), solve("slides", 4), solve("sticks", 2)]
    print(as_text(runs, COLUMNS))
    PROGRAM.write("table.csv", as_csv(runs, COLUMNS))
    draw([runs[0], *runs[2:4], runs[-1]], PROGRAM.folder / "rolling.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
