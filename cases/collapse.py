"""A pile of aluminium rods collapses under its own weight, on a rough floor, beside a smooth wall.

0.2 m x 0.1 m, Drucker-Prager without cohesion; it starts with the stress of a pile at rest between
walls, sigma_y the overburden, sigma_x half of it, and one wall is taken away. Mixed u-eps_v at finite
strain beside displacement only.

python -m cases.collapse [--results results/collapse] [--end 0.8] [--dt 1e-3]
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.spatial import cKDTree
from tqdm import tqdm

import tawami
from cases.figure import save
from tawami.environment import header
from tawami.output import result_folder

Array = npt.NDArray[np.float64]

LENGTH, HEIGHT = 0.2, 0.1  # of the pile [m]
RHO, G = 2040.0, 9.81  # [kg/m3], [m/s2]
E, NU, PHI = 0.84e6, 0.3, 21.9  # [Pa], [-], [degrees]
FORMS = {"u_epsv_finite": "mixed $u$-$\\varepsilon_v$", "u_finite": "displacement only"}
COLOURS = {"u_epsv_finite": "tab:red", "u_finite": "tab:gray"}


@dataclass
class Run:
    """What a run recorded.

    Attributes:
        form: Weak form.
        volume: Volumes of the particles at the start [m2].
        iterations: Newton iterations of each accepted step.
        dt: Size of each accepted step [s].
        time, runout, kinetic, potential, roughness: Of each recorded time [s, m, J, J, -]; energies
            per metre depth.
        x, mean_stress: Of the particles at the recorded times [m, Pa].
        seconds: Wall time.
    """

    form: str
    volume: Array
    iterations: list[int] = field(default_factory=list)
    dt: list[float] = field(default_factory=list)
    time: list[float] = field(default_factory=list)
    runout: list[float] = field(default_factory=list)
    kinetic: list[float] = field(default_factory=list)
    potential: list[float] = field(default_factory=list)
    roughness: list[float] = field(default_factory=list)
    x: list[Array] = field(default_factory=list)
    mean_stress: list[Array] = field(default_factory=list)
    seconds: float = 0.0


def build(form: str, *, h: float = 0.01, nu: float = NU, alpha: float = 0.01) -> tawami.Dynamics:
    """The pile, its wall gone."""
    cells = (round(4 * LENGTH / h), round(1.4 * HEIGHT / h))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=cells)
    body = tawami.box(grid, (0.0, 0.0), (LENGTH, HEIGHT))
    rods = tawami.drucker_prager(tawami.linear_elastic(E=E, nu=nu), phi=PHI)
    parameters = {"alpha": alpha, "theta": 0.01} if form == "u_epsv_finite" else {}
    scene = tawami.Scene(grid, body, rods, form=form, density=RHO, **parameters)
    scene.gravity((0.0, -G))
    scene.fix("left", "x")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    vertical = -RHO * G * (HEIGHT - scene.particles.x[:, 1])
    horizontal = 0.5 * vertical
    scene.particles.stress[:, :3] = np.column_stack(
        [horizontal, vertical, 0.5 * (horizontal + vertical)]
    )
    return tawami.Dynamics(scene)


def solve(
    form: str,
    *,
    h: float = 0.01,
    dt: float = 1e-3,
    end: float = 0.8,
    every: int = 20,
    **options: float,
) -> Run:
    """The collapse to `end` [s], recorded every so many steps of `dt` [s]."""
    motion = build(form, h=h, **options)
    scene = motion.scene
    run, start = Run(form, np.array(scene.particles.volume)), perf_counter()
    record(run, motion, h)
    with tqdm(total=end, desc=form, unit="s", disable=not sys.stderr.isatty()) as bar:
        while end - motion.time > 1e-9:
            before = motion.time
            steps = motion.run(min(end, motion.time + every * dt), min(dt, end - motion.time))
            run.iterations += [step.iterations for step in steps]
            run.dt += [(motion.time - before) / len(steps)] * len(steps)
            record(run, motion, h)
            bar.update(motion.time - before)
    run.seconds = perf_counter() - start
    return run


def record(run: Run, motion: tawami.Dynamics, h: float) -> None:
    """Keep what the figures need."""
    x = np.array(motion.scene.particles.x)
    stress = motion.scene.particles.stress[:, :3].mean(axis=1)
    run.time.append(motion.time)
    run.runout.append(float(np.quantile(x[:, 0], 0.99)))  # the farthest particle is spray
    run.kinetic.append(motion.kinetic_energy)
    run.potential.append(float(G * motion.mass @ x[:, 1]))
    run.roughness.append(roughness(x, stress, h))
    run.x.append(x)
    run.mean_stress.append(stress)


def roughness(x: Array, values: Array, h: float) -> float:
    """rms residual of a local linear fit over 24 neighbours within 3 h, over the rms of the values."""
    distance, index = cKDTree(x).query(x, k=25, distance_upper_bound=3 * h)
    residuals = []
    for p in range(len(x)):
        near = index[p][np.isfinite(distance[p])]
        if len(near) < 8:
            continue
        basis = np.column_stack([np.ones(len(near)), x[near] - x[p]])
        fit = np.linalg.lstsq(basis, values[near], rcond=None)[0]
        residuals.append(values[p] - fit[0])
    return float(np.sqrt(np.mean(np.square(residuals))) / np.sqrt(np.mean(values**2)))


def summary(run: Run) -> str:
    """A line of numbers."""
    return (
        f"{run.form:14} to {run.time[-1]:.2f} s in {len(run.dt)} steps: Newton iterations "
        f"{np.mean(run.iterations):.2f} on average, {max(run.iterations)} at most; run-out "
        f"{run.runout[-1]:.4f} m; roughness of the mean stress {np.median(run.roughness[1:]):.3f} "
        f"(median); {run.seconds:.0f} s"
    )


# -- figures -----------------------------------------------------------------


def film(runs: Sequence[Run], path: Path) -> None:
    """Mean stress at the particles at several times, a column a form."""
    wanted = np.linspace(0, len(runs[0].time) - 1, 6).round().astype(int)
    figure, panels = plt.subplots(
        len(wanted), len(runs), figsize=(6.5 * len(runs), 1.6 * len(wanted)), layout="constrained",
        sharex=True, sharey=True, squeeze=False,
    )  # fmt: skip
    limit = RHO * G * HEIGHT / 1e3
    for column, run in enumerate(runs):
        for row, k in enumerate(wanted):
            axes = panels[row, column]
            shown = axes.scatter(
                *run.x[k].T, c=run.mean_stress[k] / 1e3, s=3, cmap="viridis", vmin=-limit, vmax=0
            )
            axes.set_aspect("equal")
            axes.set_title(f"{FORMS[run.form]}, $t$ = {run.time[k]:.2f} s", fontsize=9)
            axes.set_xlim(0, 0.45)
            axes.set_ylim(0, 1.15 * HEIGHT)
            if column == 0:
                axes.set_ylabel("$y$ [m]")
        panels[-1, column].set_xlabel("$x$ [m]")
    figure.colorbar(
        shown, ax=panels, label="mean Kirchhoff stress [kPa], tension positive", aspect=50
    )
    save(figure, path, dpi=150)


def histories(runs: Sequence[Run], path: Path) -> None:
    """Run-out, energies, roughness and Newton iterations over time."""
    figure, panels = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
    for run in runs:
        style = {"color": COLOURS[run.form], "label": FORMS[run.form]}
        panels[0, 0].plot(run.time, run.runout, **style)
        panels[0, 1].plot(run.time, run.kinetic, **style)
        potential = np.array(run.potential) - run.potential[0]
        panels[0, 1].plot(run.time, -potential, color=COLOURS[run.form], linestyle="--")
        panels[1, 0].plot(run.time[1:], run.roughness[1:], **style)
        panels[1, 1].plot(np.cumsum(run.dt), run.iterations, ".", markersize=2, **style)
    labels = ("run-out (99 % of particles) [m]", "energy [J/m] (dashed: released weight)",
              "roughness of the mean stress [-]", "Newton iterations per step [-]")  # fmt: skip
    for axes, label in zip(panels.ravel(), labels, strict=True):
        axes.set_xlabel("$t$ [s]")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    save(figure, path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the collapse with each form, draw it, say where."""
    parser = argparse.ArgumentParser(prog="python -m cases.collapse", description=__doc__)
    parser.add_argument("--results", default="results/collapse", help="folder for the results")
    parser.add_argument("--end", type=float, default=0.8, help="time of the end [s]")
    parser.add_argument("--dt", type=float, default=1e-3, help="size of a step [s]")
    parser.add_argument("--cell", type=float, default=0.01, help="size of a cell [m]")
    options = parser.parse_args(arguments)
    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    runs = []
    for form in FORMS:
        try:
            runs.append(solve(form, h=options.cell, dt=options.dt, end=options.end))
            print(summary(runs[-1]), flush=True)
        except (tawami.ConvergenceError, tawami.SingularError) as error:
            if form == "u_epsv_finite":
                raise
            print(f"{form:14} did not get to the end: {str(error)[:200]} ...", flush=True)
    film(runs, folder / "film.png")
    histories(runs, folder / "histories.png")
    print(f"Results: {folder / 'film.png'}, {folder / 'histories.png'}")


if __name__ == "__main__":
    tawami.run(main, "collapse")
