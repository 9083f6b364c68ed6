"""Large steps into contact: how many of them Newton's method solves, and in how many iterations.

A rigid disc is pressed into a block of 2 m x .9 m in one step, by up to .4 h, and then by as much
again: with radii of .3, 1 and 4 m, h = .25 and .125 m, without friction and with mu = 0.3, nu = 0.3 and
0.4999, over the middle of a cell and beside it, and with the base of the block on the edge of the grid
and .37 h above it. --factor multiplies the steps.

--drag presses a disc, a punch with sharp corners and one with round corners, and drags them sideways, by
.01 and .03 m at once, with mu = 1, 3 and infinite. `failed` counts the runs in which Newton's method
does not converge, and `of ramps` those that fail in steps too, as the message advises.

python -m cases.costs.contact
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

import tawami
from cases.common.program import Program, progress
from cases.common.table import as_csv, as_text

PROGRAM = Program("cases.costs.contact", __doc__)
PROGRAM.option("--drag", action="store_true", help="drag obstacles with friction of 1 and more")
PROGRAM.option("--factor", type=float, default=1.0, help="factor of the steps")

TOP, WIDTH, E = 0.9, 2.0, 1e6  # of the block [m], [Pa]
RADII, SIZES, FRICTION, NU = (0.3, 1.0, 4.0), (0.25, 0.125), (0.0, 0.3), (0.3, 0.4999)
STEPS, BESIDE, GAPS = (0.01, 0.05), (0.0, 0.4), (0.0, 0.37)  # [m], [h], [h]
DRAGGED = ("form", "runs", "failed", "of_ramps", "iterations")
COLUMNS = ("form", "runs", "failed", "iterations", "most")


@dataclass(frozen=True)
class Row:
    """Runs with one form, those that failed, and iterations of a step, mean and largest number."""

    form: str
    runs: int
    failed: int
    iterations: float
    most: int


@dataclass(frozen=True)
class Dragged:
    """Runs with one form, those that failed at once and in steps, and mean iterations."""

    form: str
    runs: int
    failed: int
    of_ramps: int
    iterations: float


def block(form: str, nu: float, h: float, gap: float) -> tawami.Scene:
    """A block on a held base.

    Args:
        form: Weak form.
        nu: Poisson's ratio.
        h: Side of a cell [m].
        gap: Height of the base above the edge of the grid [h].
    """
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(-0.5, 0.0), h=h, cells=(round(3 / h), round(1.5 / h))
    )
    body = tawami.box(grid, (0.0, gap * h), (WIDTH, TOP), per_axis=3)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=nu), form=form)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def pressed(
    form: str, gap: float, radius: float, h: float, mu: float, nu: float, step: float, beside: float
) -> list[int]:
    """Newton iterations of both steps."""
    scene = block(form, nu, h, gap)
    shape = tawami.rigid_disc((WIDTH / 2 + beside * h, TOP + radius), radius)
    disc = scene.obstacle(shape, mu, displacement=(0.0, -step))
    found = [scene.solve().iterations]
    disc.change((0.0, -2 * step))
    return [*found, scene.solve().iterations]


def dragged(
    form: str, shape: str, mu: float, nu: float, h: float, down: float, side: float, size: float
) -> list[int]:
    """Newton iterations of an obstacle that is pressed and dragged, then dragged as far again.

    Args:
        form, mu, nu, h: As above.
        shape: 'disc', 'sharp' or 'round'.
        down, side: Displacements [m].
        size: Share of the displacements in a step; 1 solves at once.
    """
    x, scene = WIDTH / 2 + 0.03, block(form, nu, h, 0.37)
    radius = 0.05 if shape == "round" else 0.0
    low, half = TOP + radius, 0.3 - radius
    corners = [(x - half, low), (x + half, low), (x + half, low + 0.4), (x - half, low + 0.4)]
    disc, punch = tawami.rigid_disc((x, TOP + 0.3), 0.3), tawami.rigid_polygon(corners, radius)
    obstacle = scene.obstacle(disc if shape == "disc" else punch, mu, displacement=(side, -down))
    found = []
    for way in (side, 2 * side):
        obstacle.change((way, -down))
        if size == 1:
            found.append(scene.solve().iterations)
        else:
            tawami.ramp(scene, size, stop="raise")
    return found


def drag_study(form: str) -> Dragged:
    """All runs with one form."""
    settings = list(
        itertools.product(
            ("disc", "sharp", "round"), (1.0, 3.0, np.inf), NU, SIZES, (0.01, 0.03), (0.01, 0.03)
        )
    )
    iterations: list[int] = []
    failed, of_ramps = 0, 0
    for setting in progress(settings, desc=form):
        try:
            iterations += dragged(form, *setting, 1.0)
        except tawami.ConvergenceError:
            failed += 1
            try:
                dragged(form, *setting, 0.5)
            except tawami.ConvergenceError:
                of_ramps += 1
    return Dragged(form, len(settings), failed, of_ramps, float(np.mean(iterations)))


def study(form: str, factor: float) -> Row:
    """All runs with one form."""
    settings = list(itertools.product(GAPS, RADII, SIZES, FRICTION, NU, STEPS, BESIDE))
    iterations: list[int] = []
    failed = 0
    for gap, radius, h, mu, nu, step, beside in progress(settings, desc=form):
        try:
            iterations += pressed(form, gap, radius, h, mu, nu, factor * step, beside)
        except tawami.ConvergenceError:
            failed += 1
    return Row(form, len(settings), failed, float(np.mean(iterations)), max(iterations))


def main(arguments: Sequence[str] | None = None) -> None:
    """Press, print the table."""
    options = PROGRAM.start(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tawami.SmallStrainWarning)
        warnings.simplefilter("ignore", tawami.SupportWarning)
        warnings.simplefilter("ignore", tawami.QuadratureWarning)
        forms = ("u_epsv", "u_epsv_finite")
        rows: list[Row] | list[Dragged]
        if options.drag:
            rows, columns = [drag_study(form) for form in forms], DRAGGED
        else:
            rows, columns = [study(form, options.factor) for form in forms], COLUMNS
    print(as_text(rows, columns))
    PROGRAM.write("table.csv", as_csv(rows, columns))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
