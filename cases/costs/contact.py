"""Large steps into contact: how many of them Newton's method solves, and in how many iterations.

A rigid disc is pressed into a block of 2 m x .9 m in one step, by up to .4 h, and then by as much
again: with radii of .3, 1 and 4 m, h = .25 and .125 m, without friction and with mu = 0.3, nu = 0.3 and
0.4999, over the middle of a cell and beside it, and with the base of the block on the edge of the grid
and .37 h above it. --factor multiplies the steps.

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
PROGRAM.option("--factor", type=float, default=1.0, help="factor of the steps")

TOP, WIDTH, E = 0.9, 2.0, 1e6  # of the block [m], [Pa]
RADII, SIZES, FRICTION, NU = (0.3, 1.0, 4.0), (0.25, 0.125), (0.0, 0.3), (0.3, 0.4999)
STEPS, BESIDE, GAPS = (0.01, 0.05), (0.0, 0.4), (0.0, 0.37)  # [m], [h], [h]
COLUMNS = ("form", "runs", "failed", "iterations", "most")


@dataclass(frozen=True)
class Row:
    """Runs with one form, those that failed, and iterations of a step, mean and largest number."""

    form: str
    runs: int
    failed: int
    iterations: float
    most: int


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
    factor = PROGRAM.start(arguments).factor
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tawami.SmallStrainWarning)
        warnings.simplefilter("ignore", tawami.SupportWarning)
        rows = [study(form, factor) for form in ("u_epsv", "u_epsv_finite")]
    print(as_text(rows, COLUMNS))
    PROGRAM.write("table.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
