"""A slender cantilever bent far by a dead load at its tip: statics at finite strain, across many cells.

    held  |=====================|  P      length L = 2 m, depth D = 0.1 m, plane strain
                                |         E = 1 MPa, Hencky elastic; P L^2/(Ebar I) = 1 and 10
                                v

The reference is the elastica, a line that bends and does not stretch. With s the distance from the
root, theta the angle below the horizontal, I = D^3/12 and Ebar = E/(1 - nu^2) in plane strain,

    Ebar I theta'' = -P cos theta,    theta(0) = 0,    theta'(L) = 0.

Once integrated it is theta'^2 = 2 P/(Ebar I) (sin theta_L - sin theta), and theta_L, the angle of the
tip, follows from elliptic integrals (Bisshopp and Drucker 1945, Quart. Appl. Math. 3, 272).

What keeps the beam from being an elastica, as shares of the tip's deflection:

    shear           (D/L)^2 / (2 (1 - nu) kappa), kappa = 5/(6 - nu)          0.2 %
    extension       up to P/(Ebar D L) = (D/L)^2/12 times 1 or 10               0.02 %, 0.2 %
    fibres          up to 11 % of strain at the root where P L^2/(Ebar I) = 10; of second order in
                    the deflection, of first in the mean stress
    particles       N of them over the depth have the second moment I (1 - 1/N^2): 1.6 % where N = 8

The load grows in steps; after each the particles have moved and the grid is reset. Without inertia
that is singular as soon as the beam leaves the lines of the grid: the first particle in a cell brings
functions that no other particle holds. The ghost penalty of the shipped forms, k = 0.01, ties these to
the others. Each reset costs some accuracy: more steps are not better.

python -m cases.elastica [--results results/elastica] [--steps 160]
"""

from __future__ import annotations

import argparse
import dataclasses
import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipeinc, ellipkinc
from tqdm import tqdm

import tawami
from cases import figure, table
from tawami.base.files import result_folder
from tawami.fem.environment import header

Array = npt.NDArray[np.float64]

D, SLENDER, E = 0.1, 20, 1.0e6  # depth [m], length over depth [-], Young's modulus [Pa]
LOADS = (1.0, 10.0)  # P L^2/(Ebar I) [-]
FORMS = {
    "u_epsv_finite": "mixed $u$-$\\varepsilon_v$",
    "u_finite": "displacement only",
    "u_bbar_finite": "B-bar",
}
COLOURS = {"u_epsv_finite": "tab:red", "u_finite": "tab:gray", "u_bbar_finite": "tab:blue"}
#: What differs from u_epsv_finite, nu = 0.3, 4 cells, 2 x 2 particles, 20 steps, k = 1e-2.
STUDY: dict[str, list[dict[str, Any]]] = {
    "cells": [
        {"form": form, "nu": nu, "n": n}
        for form in ("u_epsv_finite", "u_finite")
        for nu in (0.3, 0.49, 0.499)
        for n in (2, 4, 8)
    ],
    "bbar": [{"form": "u_bbar_finite", "n": n} for n in (2, 4, 8)],
    "steps": [{"steps": steps, "k": k} for k in (1e-3, 1e-2, 1e-1) for steps in (10, 40, 80, 160)],
    "k": [{"k": k} for k in (0.0, 1e-4, 1e-3, 1e-1)],
    "particles": [{"per_axis": 3}, {"per_axis": 4}],
    "slender": [{"slender": 40}],
    "alpha": [{"alpha": 0.1}],
}


# -- the elastica --------------------------------------------------------------


def tip_angle(load: float) -> float:
    """Angle [rad] of the tip under P L^2/(Ebar I) = load.

    sqrt(load) = F(pi/2, m) - F(phi, m), m = (1 + sin theta_L)/2, sin(phi)^2 = 1/(2 m).
    """

    def missing(angle: float) -> float:
        m, phi = _modulus(angle)
        return float(ellipkinc(np.pi / 2, m) - ellipkinc(phi, m) - np.sqrt(load))

    return float(brentq(missing, 1e-9, np.pi / 2 - 1e-9, xtol=1e-14))


def tip(load: float) -> Array:
    """Displacement (x, y) of the tip over the length.

    y = -1 + 2 (E(pi/2, m) - E(phi, m)) / sqrt(load), x = sqrt(2 sin(theta_L) / load) - 1.
    """
    angle = tip_angle(load)
    m, phi = _modulus(angle)
    arc = ellipeinc(np.pi / 2, m) - ellipeinc(phi, m)
    return np.array([np.sqrt(2 * np.sin(angle) / load) - 1, 2 * arc / np.sqrt(load) - 1])


def _modulus(angle: float) -> tuple[float, float]:
    """Parameter m of the elliptic integrals, and where they begin."""
    m = (1 + np.sin(angle)) / 2
    return m, np.arcsin(1 / np.sqrt(2 * m))


def curve(load: float, s: Array) -> Array:
    """(x, y, theta, curvature) of the elastica of length 1 at distances s from the root."""

    def change(_s: float, state: Array) -> Array:
        theta, curvature = state[2:]
        return np.array([np.cos(theta), -np.sin(theta), curvature, -load * np.cos(theta)])

    root = [0.0, 0.0, 0.0, np.sqrt(2 * load * np.sin(tip_angle(load)))]
    return np.asarray(solve_ivp(change, (0.0, 1.0), root, t_eval=s, rtol=1e-10, atol=1e-12).y)


# -- the beam ------------------------------------------------------------------


@dataclasses.dataclass
class Run:
    """A run and what came of it.

    Attributes:
        load: P L^2/(Ebar I), L to where the load acts.
        form, nu, n, per_axis, alpha, slender: Weak form, Poisson's ratio, cells over the depth,
            particles per cell and axis, stabilisation, length over depth.
        steps: Asked for, in equal shares of the load.
        k: Factor of the ghost penalty; 0 is without.
        accepted: Steps it took.
        iterations: Newton's, mean over the steps.
        x, y: Displacement of the tip over L.
        error: Distance of the tip from that of the elastica, over L [%].
        expected: Of it, what the second moment of the particles makes [%].
        stress_error: Of the mean stress at the particles, rms over that of the elastica [%].
        crossed: Cells that the tip went through.
        seconds: Wall time.
        at, mean_stress: Of the particles at the end [m, Pa].
        stopped: Why it did not get to the end, if so.
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
    """The straight beam under its load, which is new; the particles that carry it; L [m]."""
    h, length = D / run.n, run.slender * D
    down = min(1.0, -1.5 * tip(run.load)[1]) * length  # B-bar goes farther than the elastica
    above, below = 2, int(np.ceil(down / h))  # rows of cells beside the straight beam
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0.0, -D / 2 - below * h), h=h,
        cells=(round(length / h) + 1, run.n + above + below),
    )  # fmt: skip
    body = tawami.box(grid, (0.0, -D / 2), (length, D / 2), per_axis=run.per_axis)
    material = tawami.linear_elastic(E=E, nu=run.nu)
    options: dict[str, Any] = {"ghost_penalty": "on", "k": run.k} if run.k else {}
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
    """Bring the load up, compare the tip and the mean stress with the elastica's."""
    begin = perf_counter()
    run = Run(load, form, nu, n, per_axis, steps, k, alpha, slender)
    scene, loaded, L = build(run)
    start = np.array(scene.particles.x)
    try:
        taken = tawami.ramp(scene, 1 / steps, smallest=1 / (64 * steps))
    except (tawami.ConvergenceError, tawami.SingularError) as error:
        run.stopped = error.__notes__[0]
        return run
    run.accepted, run.iterations = len(taken), float(np.mean([s.iterations for s in taken]))
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


def mean_stress(load: float, nu: float, L: float, x: Array) -> Array:
    """Of the elastica, (1 + nu)/3 Ebar theta' y [Pa], at places x of the straight beam."""
    s, where = np.unique(x[:, 0] / L, return_inverse=True)
    curvature = curve(load, s)[3][where] / L
    return np.asarray((1 + nu) / 3 * E / (1 - nu**2) * curvature * x[:, 1])


def _stress_error(run: Run, start: Array, L: float) -> float:
    """rms of the difference over rms, farther than D from the ends."""
    inner_part = np.abs(start[:, 0] - run.slender * D / 2) < run.slender * D / 2 - D
    exact = mean_stress(run.load, run.nu, L, start[inner_part])
    difference = run.mean_stress[inner_part] - exact
    return float(np.sqrt(np.mean(difference**2) / np.mean(exact**2)))


# -- figures -------------------------------------------------------------------


def shapes(runs: Sequence[Run], path: Path) -> None:
    """The bent beams, coloured by mean stress, beside the elastica; a column a form, a row a load."""
    figure_, panels = plt.subplots(
        len(LOADS), len(FORMS), figsize=(14, 8), layout="constrained", sharex="row", sharey="row",
        height_ratios=(1, 1.9),
    )  # fmt: skip
    for run in runs:
        row, column = LOADS.index(run.load), list(FORMS).index(run.form)
        axes = panels[row, column]
        L = (run.slender - 0.5 / run.n) * D
        # of the fibres at the root of the stiffest
        limit = mean_stress(run.load, 0.499, L, np.array([[0.0, D / 2]]))[0] / 1e3
        shown = axes.scatter(
            *run.at.T, c=run.mean_stress / 1e3, s=2, cmap="coolwarm", vmin=-limit, vmax=limit
        )
        axes.plot(*L * curve(run.load, np.linspace(0, 1, 200))[:2], "k", label="elastica")
        axes.set_aspect("equal")
        axes.set_title(
            f"{FORMS[run.form]}, $\\nu$ = {run.nu}, $PL^2/\\bar{{E}}I$ = {run.load:g}", fontsize=10
        )
        axes.set_xlabel("$x$ [m]")
        axes.set_ylabel("$y$ [m]")
        axes.legend(loc="lower left", fontsize=8)
        if column == len(FORMS) - 1:
            figure_.colorbar(shown, ax=panels[row], label="mean stress [kPa], tension positive")
    figure.save(figure_, path)


def errors(cells: Sequence[Run], steps: Sequence[Run], path: Path) -> None:
    """Error of the tip and of the mean stress over cells, and of the tip over steps, for each load."""
    figure_, panels = plt.subplots(3, len(LOADS), figsize=(12, 10.5), layout="constrained")
    for column, load in zip(panels.T, LOADS, strict=True):
        _over_cells(column[:2], [run for run in cells if run.load == load])
        _over_steps(column[2], [run for run in steps if run.load == load])
        column[0].set_title(f"$PL^2/\\bar{{E}}I$ = {load:g}")
    ticks = (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
    for axes in panels.ravel():
        low, high = axes.get_ylim()
        shown = [tick for tick in ticks if low < tick < high]
        axes.minorticks_off()
        axes.set_yticks(shown, [f"{tick:g}" for tick in shown])
        axes.grid(alpha=0.3)
    figure_.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside right upper", fontsize=8)
    panels[2, 1].legend(fontsize=8, loc="upper left")
    figure.save(figure_, path)


def _over_cells(panels: Sequence[plt.Axes], runs: Sequence[Run]) -> None:
    """Error of the tip, and of the mean stress, a line a form and Poisson's ratio."""
    markers = {0.3: "o", 0.49: "s", 0.499: "^"}
    for form, nu in dict.fromkeys((run.form, run.nu) for run in runs):
        chosen = [run for run in runs if (run.form, run.nu) == (form, nu)]
        n = [run.n for run in chosen]
        style = {"color": COLOURS[form], "marker": markers[nu],
                 "label": f"{FORMS[form]}, $\\nu$ = {nu}"}  # fmt: skip
        panels[0].loglog(n, [run.error for run in chosen], **style)
        panels[1].loglog(n, [run.stress_error for run in chosen], **style)
    expected = [run.expected for run in chosen]
    panels[0].loglog(n, expected, "k--", label="of the particles' second moment")
    panels[0].set_ylabel("distance of the tips / $L$ [%]")
    panels[1].set_ylabel("rms error of the mean stress [%]")
    for axes in panels:
        axes.set_xlabel("cells over the depth [-]")
        axes.set_xticks(n, [str(cells) for cells in n])


def _over_steps(axes: plt.Axes, runs: Sequence[Run]) -> None:
    """Error of the tip, a line a factor of the ghost penalty."""
    for k, colour in ((1e-3, "tab:orange"), (1e-2, "tab:red"), (1e-1, "tab:purple")):
        chosen = sorted((run for run in runs if run.k == k), key=lambda run: run.steps)
        accepted = [run.accepted for run in chosen]
        axes.loglog(
            accepted, [run.error for run in chosen], color=colour, marker="o",
            label=f"ghost penalty, $k$ = {k:g}",
        )  # fmt: skip
    axes.set_xlabel("steps, the grid reset after each [-] (mixed, $\\nu$ = 0.3, 4 cells)")
    axes.set_ylabel("distance of the tips / $L$ [%]")
    axes.set_xticks(accepted, [str(count) for count in accepted])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study, print the table, draw the figures, say where."""
    parser = argparse.ArgumentParser(prog="python -m cases.elastica")
    parser.add_argument("--results", default="results/elastica", help="folder for the results")
    parser.add_argument("--steps", type=int, default=160, help="leave out runs of more steps")
    options = parser.parse_args(arguments)
    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    for load in LOADS:
        x, y = tip(load)
        print(f"elastica, PL^2/EI = {load:g}: the tip moves ({x:.4f}, {y:.4f}) L")
    work = [
        (name, load, change)
        for name in STUDY
        for load in LOADS
        for change in STUDY[name]
        if change.get("steps", 0) <= options.steps
    ]
    runs: dict[str, list[Run]] = {name: [] for name in STUDY}
    for name, load, change in tqdm(work, desc="elastica", disable=not sys.stderr.isatty()):
        run = solve(load, **change)
        runs[name].append(run)
        if run.stopped:
            tqdm.write(f"{name}, load {load:g}, {change}: stopped {run.stopped}")
    rows = [run for name in STUDY for run in runs[name] if not run.stopped]
    print(table.as_text(rows, COLUMNS))
    (folder / "table.csv").write_text(table.as_csv(rows, COLUMNS))
    cells = [run for run in (*runs["cells"], *runs["bbar"]) if not run.stopped]
    standard = [run for run in cells if (run.form, run.nu, run.n) == ("u_epsv_finite", 0.3, 4)]
    steps = [run for run in (*runs["steps"], *runs["k"], *standard) if not run.stopped]
    bent = [run for run in cells if run.n == 4 and (run.nu == 0.499 or run.form == "u_bbar_finite")]
    shapes(bent, folder / "shapes.png")
    errors(cells, steps, folder / "errors.png")
    print(f"Results: {folder / 'shapes.png'}, {folder / 'errors.png'}, {folder / 'table.csv'}")


if __name__ == "__main__":
    tawami.run(main, "elastica")
