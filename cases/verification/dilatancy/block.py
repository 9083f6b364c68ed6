"""A block of dilatant soil on a rough base, pressed from above.

    top: moved down by W, free to slide
     _______________
    |               |     4 x 4 cells, 3 x 3 particles each, plane strain
    |               |     Mohr-Coulomb, phi = 20 degrees, c = 1, mu = 100
    |_______________|     free sides
    base: held

With psi > 0 and nu near 0.5 the mean stress of a particle that yields changes by K times the plastic
volume. The number of steps that converge shows whether the discrete problem has a solution.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

import tawami

PHI, C, MU = 20.0, 1.0, 100.0  # friction angle [degrees], cohesion and shear modulus [Pa]
CELLS, SHORTENING, STEPS = 4, 0.02, 10
PSI, NU = (0.0, 10.0, 20.0), (0.3, 0.45, 0.49, 0.4999)
COLUMNS = ("psi", "nu", "arrived", "iterations", "reaction", "symmetric")


@dataclass
class Run:
    """A run and its results.

    Attributes:
        psi: Angle of dilation [degrees].
        nu: Poisson's ratio.
        arrived: Share of the displacement in equilibrium.
        counts: Newton iterations of each step.
        reaction: Force on the top at the end, over its width and c.
        symmetric: Whether the last tangent was solved by LDL^T.
    """

    psi: float
    nu: float
    arrived: float = 0.0
    counts: list[int] = field(default_factory=list)
    reaction: float = np.nan
    symmetric: bool = False

    @property
    def iterations(self) -> float:
        """Newton iterations, mean over the steps."""
        return float(np.mean(self.counts)) if self.counts else np.nan


def build(psi: float, nu: float, form: str = "u_epsv") -> tawami.Scene:
    """The block, with the whole displacement as the next one to apply."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1 / CELLS, cells=(CELLS + 2, CELLS))
    body = tawami.box(grid, (1 / CELLS, 0.0), (1 + 1 / CELLS, 1.0), per_axis=3)
    elastic = tawami.linear_elastic(E=2 * MU * (1 + nu), nu=nu)
    soil = tawami.mohr_coulomb(elastic, phi=PHI, c=C, psi=psi)
    scene = tawami.Scene(grid, body, soil, form=form, tolerance=1e-8)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y", -SHORTENING)
    return scene


def solve(psi: float, nu: float, steps: int = STEPS) -> Run:
    """Press the block down in steps of the share 1/steps; stop where one does not converge."""
    run = Run(psi, nu)

    def record(solution: tawami.Solution) -> None:
        run.counts.append(solution.iterations)
        run.reaction = float(-solution.reaction("top")[1] / C)
        run.symmetric = solution.symmetric

    run.arrived = tawami.ramp(build(psi, nu), 1 / steps, each=record).reached
    return run


def study() -> list[Run]:
    """All runs."""
    return [solve(psi, nu) for psi in PSI for nu in NU]
