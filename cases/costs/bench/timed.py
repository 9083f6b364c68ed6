"""Times of one checkout, on request: a step of the cantilever, or of a collapsing pile.

`compare` runs this file with the package of a checkout on PYTHONPATH. It uses the public API and
`scene.stopwatch` only, so that it runs with older and newer packages. It repeats the two cases briefly,
because those in `cases/` belong to one version of the package.

Reads requests, one per line: `beam N` for N cells over the height, or `collapse N` for N particles.
Answers each with one line of JSON: seconds of processor time by stage.
"""

from __future__ import annotations

import json
import logging
import sys
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami

RHO, G = 2040.0, 9.81  # of the pile [kg/m3], [m/s2]
WARM_UP = 5  # steps of the pile before the first that is measured


def beam(n: int, **options: Any) -> Any:
    """The cantilever of the paper as a scene, 2n x n cells with 2 x 2 particles each.

    Args:
        n: Cells over the height.
        options: Options of the scene.
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, -0.5), h=1 / n, cells=(2 * n, n))
    body = tawami.box(grid, (0.0, -0.5), (2.0, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=3e6, nu=0.4999)
    scene = tawami.Scene(grid, body, law, form="u_epsv", alpha=0.1, **options)
    scene.fix("left", "x")
    scene.hold((0.0, 0.0), "y")
    scene.traction("right", (0.0, -1e3))
    return scene


def pile(finer: int = 1, *, border: bool = True, **options: Any) -> Any:
    """The pile of `cases.showcase.collapse` in motion.

    Args:
        finer: Ratio of 1 cm to the cell size: 800 finer^2 particles.
        border: Whether the body has a border.
        options: Options of the scene.
    """
    cells = (80 * finer, 14 * finer)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.01 / finer, cells=cells)
    body = tawami.box(grid, (0.0, 0.0), (0.2, 0.1), per_axis=2)
    body = body if border else tawami.Body(body.x, body.volume)
    rods = tawami.drucker_prager(tawami.linear_elastic(E=0.84e6, nu=0.3), phi=21.9)
    scene = tawami.Scene(grid, body, rods, form="u_epsv_finite", density=RHO, alpha=0.01, **options)
    scene.gravity((0.0, -G))
    scene.fix("left", "x")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    vertical = -RHO * G * (0.1 - np.array(scene.particles.x[:, 1]))
    scene.particles.stress[:, :3] = np.outer(vertical, [0.5, 1.0, 0.75])
    return tawami.Dynamics(scene)


class Steps:
    """Steps to measure; the pile continues from one request to the next."""

    def __init__(self) -> None:
        beam(2).solve()  # loads libraries and compiles the form
        self.motions: dict[int, Any] = {}

    def beam(self, n: int) -> dict[str, float]:
        """Solve the beam: seconds of each stage and of the whole step."""
        scene = beam(n)
        start = process_time()
        scene.solve()
        whole = process_time() - start
        return dict(scene.stopwatch.cpu) | {"whole step": whole}

    @staticmethod
    def dt(particles: int) -> float:
        """Size of a step [s], in proportion to that of the cells."""
        return 1e-3 * float((800 / particles) ** 0.5)

    def collapse(self, particles: int) -> dict[str, float]:
        """Take a step of the pile: seconds of each stage and of the whole step."""
        motion = self.motions.get(particles)
        if motion is None:
            motion = self.motions[particles] = pile(round((particles / 800) ** 0.5))
            for _ in range(WARM_UP):
                motion.step(self.dt(particles))
        watch = motion.scene.stopwatch
        before, start = dict(watch.cpu), process_time()
        motion.step(self.dt(particles))
        whole = process_time() - start
        spent = {stage: s - before.get(stage, 0.0) for stage, s in watch.cpu.items()}
        return spent | {"whole step": whole}


def main() -> None:
    """Print the package that is measured, then answer requests until the input ends."""
    logging.disable(logging.INFO)  # compiling a form logs many lines
    steps = Steps()
    print(json.dumps({"package": tawami.__file__}), flush=True)
    for line in sys.stdin:
        scene, number = line.split()
        seconds = {"beam": steps.beam, "collapse": steps.collapse}[scene](int(number))
        print(json.dumps(seconds), flush=True)


if __name__ == "__main__":
    main()
