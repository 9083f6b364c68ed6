"""A rigid footing on Tresca clay under a vertical force, and pushed sideways under that force.

             V
       H --> |            B = 2 m, s_u = 1 kPa, mu = 667 s_u, nu = 0.499, weightless, small strain
     ____ ======= ____    the ground: 8 m x 2 m; left and right edge smooth, bottom held
     o               o    the footing is an obstacle on its part of the border: a level plane
     o_____ clay ____o

The footing is free to move along y under V, and its displacement along x is prescribed. A rough one does
not slide, a smooth one has no friction. Its limit load is Prandtl's, V = (2 + pi) s_u B. Under
V/(s_u B) > 1 + pi/2 a rough footing gives way sideways, without sliding, at the force H of Green (1954,
J. Mech. Phys. Solids 2, 197), with eta = H/(s_u B):

    V/(s_u B) = 1 + pi/2 + acos(eta) + sqrt(1 - eta^2).

V alone grows in steps until no step converges. The sideways mechanism ends in the cells at both edges
of the footing: the error of H falls with h/B, and the table extrapolates it to h = 0.

python -m cases.verification.rigid_footing
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

import tawami
from cases.common.figure import save
from cases.common.ground import ground
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from cases.verification.footing import DEPTH, PRANDTL, RIGIDITY, S_U, clay
from tawami.picture import style

Array = npt.NDArray[np.float64]

B, WIDTH = 2.0, 8  # footing and ground [m]
VERTICAL = 4.0  # V/(s_u B) under which the footing is pushed sideways
END = 10.0  # displacement along x at the end [s_u b/mu], b = B/2
COLUMNS = ("base", "cells", "largest", "exact", "error", "iterations")


def greens(vertical: float) -> float:
    """H/(s_u B) of a rough footing under V/(s_u B), from 1 + pi/2 to 2 + pi."""

    def unbalance(eta: float) -> float:
        return float(1 + np.pi / 2 + np.arccos(eta) + np.sqrt(1 - eta**2) - vertical)

    return float(brentq(unbalance, 0.0, 1.0))


@dataclass
class Run:
    """A run.

    Attributes:
        base: 'rough', 'smooth', or 'sideways' for the rough one that is pushed sideways.
        cells: B/h.
        exact: The closed form of the force over s_u B.
        moved: Displacement of the footing along the force, after each step [s_u b/mu].
        force: V, or H, over s_u B, after each step.
        steps: Newton iterations of each step.
    """

    base: str
    cells: int
    exact: float
    moved: list[float] = field(default_factory=list)
    force: list[float] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)

    @property
    def largest(self) -> float:
        """Largest force over s_u B."""
        return max(self.force)

    @property
    def error(self) -> float:
        """Error of the largest force [%]."""
        return 100 * (self.largest / self.exact - 1)

    @property
    def iterations(self) -> float:
        """Newton iterations, mean over the steps."""
        return float(np.mean(self.steps))


def build(cells: int, friction: float, force: float) -> tuple[tawami.Scene, Any]:
    """The ground and the footing.

    Args:
        cells: B/h.
        friction: Of the footing.
        force: V/(s_u B).
    """
    sides = (-WIDTH / 2, WIDTH / 2)
    scene = ground(B / cells, sides, DEPTH, clay(), form="u_epsv", alpha=0.1)
    footing = scene.obstacle(
        tawami.half_plane((0.0, 0.0), (0.0, -1.0)), friction, name="footing",
        where=lambda x, y: (y == 0) & (abs(x) < B / 2), force=(0.0, -force * S_U * B), free="y",
    )  # fmt: skip
    return scene, footing


def pressed(base: str, cells: int, step: float = 0.05) -> Run:
    """Press the footing with a growing force until the ground gives way.

    Args:
        base: 'rough' or 'smooth'.
        cells: B/h.
        step: Largest step of the force, as a share of 1.2 times Prandtl's.
    """
    run = Run(base, cells, PRANDTL)
    scene, footing = build(cells, np.inf if base == "rough" else 0.0, 1.2 * PRANDTL)

    def each(solution: tawami.Solution) -> None:
        run.moved.append(-footing.x[1] * RIGIDITY / (B / 2))
        run.force.append(solution.contact(footing).force[1] / (S_U * B))
        run.steps.append(solution.iterations)

    tawami.ramp(scene, step, each=each)
    return run


def pushed(cells: int, vertical: float = VERTICAL, step: float = 0.05) -> Run:
    """Push the rough footing sideways.

    Args:
        cells: B/h.
        vertical: V/(s_u B).
        step: Largest step, as a share of the displacement.
    """
    run = Run("sideways", cells, greens(vertical))
    scene, footing = build(cells, np.inf, vertical)
    tawami.ramp(scene, 0.1)
    footing.change((END * B / 2 / RIGIDITY, -vertical * S_U * B))

    def each(solution: tawami.Solution) -> None:
        run.moved.append(footing.x[0] * RIGIDITY / (B / 2))
        run.force.append(-solution.contact(footing).force[0] / (S_U * B))
        run.steps.append(solution.iterations)

    tawami.ramp(scene, step, each=each)
    return run


def extrapolated(coarse: Run, fine: Run) -> float:
    """Largest force for h = 0, if its error falls with h, over s_u B."""
    ratio = fine.cells / coarse.cells
    return (ratio * fine.largest - coarse.largest) / (ratio - 1)


def draw(runs: Sequence[Run], path: Path) -> None:
    """Draw the forces over the displacement, with the closed forms."""
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 4.0), layout="constrained")
    titles = ("vertical force", f"sideways under $V = {VERTICAL:g}\\,s_u B$")
    for axis, title, letter, sideways in zip(axes, titles, "VH", (False, True), strict=True):
        mine = [run for run in runs if (run.base == "sideways") == sideways]
        for run, colour in zip(mine, style.LINES, strict=False):
            label = f"B/h = {run.cells}" + ("" if sideways else f", {run.base}")
            axis.plot(run.moved, run.force, color=colour, label=label)
        axis.axhline(
            mine[0].exact, color="k", linewidth=0.8, label="Green" if sideways else "Prandtl"
        )
        axis.set_title(title)
        axis.set_xlabel("displacement of the footing [$s_u B/2\\mu$]")
        axis.set_ylabel(f"${letter}/(s_u B)$ [-]")
        axis.set_xlim(0, END)
        axis.grid()
        axis.legend()
    save(figure, path)


PROGRAM = Program("cases.verification.rigid_footing", __doc__)
PROGRAM.option("--cells", type=int, default=16, help="cells over the footing, on the finest grid")


def main(arguments: Sequence[str] | None = None) -> None:
    """Load the footings, print the table, draw the figure."""
    n = PROGRAM.start(arguments).cells
    runs = [pressed(base, m) for base in ("rough", "smooth") for m in (n // 2, n)]
    runs += [pushed(m) for m in (n // 4, n // 2, n)]
    print(as_text(runs, COLUMNS))
    print(
        f"sideways, extrapolated to h = 0: {extrapolated(*runs[-2:]):.3f}, exact {runs[-1].exact:.3f}"
    )
    PROGRAM.write("table.csv", as_csv(runs, COLUMNS))
    draw(runs, PROGRAM.folder / "rigid_footing.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
