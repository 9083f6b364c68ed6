"""The strip by the material point method.

The load grows in steps. After each step the particles have moved and the grid is reset. Without inertia
the tangent becomes singular as soon as the beam leaves the grid lines: the first particle in a cell
activates functions that no other particle supports. The ghost penalty of the finite forms, k = 0.01,
ties these functions to their neighbours. Each reset costs some accuracy, so more
steps do not help.
"""

from __future__ import annotations

import dataclasses
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.verification.elastica.strip import SLENDER, D, E, mean_stress, tip

Array = npt.NDArray[np.float64]


@dataclasses.dataclass
class Run:
    """A run and its results.

    Attributes:
        load: P L^2/(Ebar I), with L to the point where the load acts.
        form: Weak form.
        nu: Poisson's ratio.
        n: Cells over the depth.
        per_axis: Particles per cell and axis.
        steps: Number of equal load increments asked for.
        k: Factor of the ghost penalty; 0 for none.
        alpha: Stabilisation.
        slender: Length over depth.
        accepted: Number of steps taken.
        iterations: Newton iterations, mean over the steps.
        x, y: Displacement of the tip over L.
        error: Distance of the tip from that of the elastica, over L [%].
        expected: The part of it that the second moment of the particles causes [%].
        stress_error: Error of the mean stress at the particles, rms over that of the elastica [%].
        crossed: Cells that the tip has crossed.
        seconds: Wall time.
        at, mean_stress: Positions [m] and mean stress [Pa] of the particles at the end.
        stopped: Reason why the run ended early; empty if it did not.
    """

    load: float
    form: str
    nu: float
    n: int
    per_axis: int
    steps: int
    k: float
    alpha: float
    slender: int
    accepted: int = 0
    iterations: float = np.nan
    x: float = np.nan
    y: float = np.nan
    error: float = np.nan
    expected: float = np.nan
    stress_error: float = np.nan
    crossed: int = 0
    seconds: float = 0.0
    at: Array = dataclasses.field(default_factory=lambda: np.empty((0, 2)))
    mean_stress: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    stopped: str = ""


COLUMNS = (
    "load", "form", "nu", "n", "per_axis", "steps", "k", "alpha", "slender", "accepted",
    "iterations", "x", "y", "error", "expected", "stress_error", "crossed", "seconds",
)  # fmt: skip


def build(run: Run) -> tuple[tawami.Scene, npt.NDArray[np.bool_], float]:
    """The straight beam with its load.

    Returns:
        The scene, the mask of the particles that carry the load, and L [m].
    """
    h, length = D / run.n, run.slender * D
    down = min(1.0, -1.5 * tip(run.load)[1]) * length  # B-bar bends farther than the elastica
    above, below = 2, int(np.ceil(down / h))  # rows of cells above and below the straight beam
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0.0, -D / 2 - below * h), h=h,
        cells=(round(length / h) + 1, run.n + above + below),
    )  # fmt: skip
    body = tawami.box(grid, (0.0, -D / 2), (length, D / 2), per_axis=run.per_axis)
    material = tawami.linear_elastic(E=E, nu=run.nu)
    penalty = {"ghost_penalty": "on", "k": run.k}
    options: dict[str, Any] = penalty if run.k else {"ghost_penalty": "off"}
    if run.form == "u_epsv_finite":
        options["alpha"] = run.alpha
    scene = tawami.Scene(grid, body, material, form=run.form, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    loaded = body.x[:, 0] > length - h
    L = float(body.x[loaded, 0].mean())
    scene.load(loaded, (0.0, -run.load * E / (1 - run.nu**2) * D**3 / 12 / L**2))
    return scene, loaded, L


def solve(
    load: float,
    form: str = "u_epsv_finite",
    nu: float = 0.3,
    *,
    n: int = 4,
    per_axis: int = 2,
    steps: int = 20,
    k: float = 1e-2,
    alpha: float = 0.01,
    slender: int = SLENDER,
) -> Run:
    """Apply the load in steps; compare the tip and the mean stress with the elastica."""
    begin = perf_counter()
    run = Run(load, form, nu, n, per_axis, steps, k, alpha, slender)
    scene, loaded, L = build(run)
    start = np.array(scene.particles.x)
    try:
        accepted = tawami.ramp(scene, 1 / steps, smallest=1 / (64 * steps), stop="raise")
    except (tawami.ConvergenceError, tawami.SingularError) as error:
        run.stopped = error.__notes__[0]
        return run
    run.accepted = len(accepted)
    run.iterations = float(np.mean([step.iterations for step in accepted]))
    moved = np.array(scene.particles.displacement)[loaded].mean(axis=0)
    run.x, run.y = moved / L
    run.crossed = int(np.abs(moved / scene.grid.h).sum())
    run.error = 100 * float(np.linalg.norm(moved / L - tip(load)))
    softened = load / (1 - 1 / (n * per_axis) ** 2)
    run.expected = 100 * float(np.linalg.norm(tip(softened) - tip(load)))
    run.at = np.array(scene.particles.x)
    run.mean_stress = scene.particles.stress[:, :3].mean(axis=1)
    run.stress_error = 100 * _stress_error(run, start, L)
    run.seconds = perf_counter() - begin
    return run


def _stress_error(run: Run, start: Array, L: float) -> float:
    """rms of the error over rms of the mean stress, at particles farther than D from both ends."""
    inner_part = np.abs(start[:, 0] - run.slender * D / 2) < run.slender * D / 2 - D
    exact = mean_stress(run.load, run.nu, L, start[inner_part])
    difference = run.mean_stress[inner_part] - exact
    return float(np.sqrt(np.mean(difference**2) / np.mean(exact**2)))
