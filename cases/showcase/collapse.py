"""A pile of aluminium rods collapses under its own weight, on a rough floor, beside a smooth wall.

0.2 m x 0.1 m, Drucker-Prager without cohesion; it starts with the stress of a pile at rest between
walls, sigma_y the overburden, sigma_x half of it, and one wall is taken away. Mixed u-eps_v at finite
strain beside B-bar and displacement only.

python -m cases.showcase.collapse [--results results/collapse] [--end 0.8] [--dt 1e-3]
python -m cases.showcase.collapse --aspects           run-out of piles 0.5 to 4 times as high as wide
python -m cases.showcase.collapse --incompressible    nu = 0.4999, alpha = 0.1, to 0.4 s
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.spatial import cKDTree
from tqdm import tqdm

import tawami
from cases.common.figure import save
from tawami.fem.environment import header
from tawami.motion.energy import Energies
from tawami.motion.transfer import TransferName
from tawami.results.output import result_folder

Array = npt.NDArray[np.float64]

LENGTH, HEIGHT = 0.2, 0.1  # of the pile [m]
RHO, G = 2040.0, 9.81  # [kg/m3], [m/s2]
E, NU, PHI = 0.84e6, 0.3, 21.9  # [Pa], [-], [degrees]
FORMS = {
    "u_epsv_finite": "mixed $u$-$\\varepsilon_v$",
    "u_bbar_finite": "B-bar",
    "u_finite": "displacement only",
}
COLOURS = {"u_epsv_finite": "tab:red", "u_bbar_finite": "tab:blue", "u_finite": "tab:gray"}
#: Height over length of the piles whose run-outs are compared, and cells along their length: about as
#: many particles in each.
ASPECTS = {0.5: 28, 1.0: 20, 1.5: 16, 2.0: 14, 3.0: 12, 4.0: 10}


@dataclass
class Run:
    """What a run recorded.

    Attributes:
        form: Weak form.
        volume: Volumes of the particles at the start [m2].
        iterations: Newton iterations of each accepted step.
        dt: Size of each accepted step [s].
        ends: Time at its end [s].
        time, runout, energies, roughness: Of each recorded time [s, m, J/m, -].
        x, mean_stress: Of the particles at the recorded times [m, Pa].
        seconds: Wall time.
    """

    form: str
    volume: Array
    iterations: list[int] = field(default_factory=list)
    dt: list[float] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    time: list[float] = field(default_factory=list)
    runout: list[float] = field(default_factory=list)
    energies: list[Energies] = field(default_factory=list)
    roughness: list[float] = field(default_factory=list)
    x: list[Array] = field(default_factory=list)
    mean_stress: list[Array] = field(default_factory=list)
    seconds: float = 0.0


def build(
    form: str,
    *,
    h: float = 0.01,
    nu: float = NU,
    per_axis: int = 2,
    size: tuple[float, float] = (LENGTH, HEIGHT),
    transfer: TransferName = "affine_flip",
    **options: Any,
) -> tawami.Dynamics:
    """The pile, its wall gone; alpha = 0.01 where the form has it, other options go to `Scene`."""
    length, height = size
    # room for a run-out of twice the height
    cells = (round((2 * length + 4 * height) / h), round(1.4 * height / h))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=cells)
    body = tawami.box(grid, (0.0, 0.0), size, per_axis=per_axis)
    rods = tawami.drucker_prager(tawami.linear_elastic(E=E, nu=nu), phi=PHI)
    parameters = {"alpha": 0.01} if form == "u_epsv_finite" else {}
    scene = tawami.Scene(grid, body, rods, form=form, density=RHO, **(parameters | options))
    scene.gravity((0.0, -G))
    scene.fix("left", "x")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    vertical = -RHO * G * (height - scene.particles.x[:, 1])
    horizontal = 0.5 * vertical
    scene.particles.stress[:, :3] = np.column_stack(
        [horizontal, vertical, 0.5 * (horizontal + vertical)]
    )
    return tawami.Dynamics(scene, transfer=transfer)


def solve(
    form: str,
    *,
    h: float = 0.01,
    dt: float = 1e-3,
    end: float = 0.8,
    every: int = 20,
    **options: Any,
) -> Run:
    """The collapse to `end` [s], recorded every so many steps of `dt` [s]."""
    motion = build(form, h=h, **options)
    run, start = Run(form, np.array(motion.scene.particles.volume)), perf_counter()
    record(run, motion, h)
    with tqdm(total=end, desc=form, unit="s", disable=not sys.stderr.isatty()) as bar:

        def look(_: tawami.Solution) -> None:
            bar.update(motion.time - bar.n)
            if motion.time > len(run.time) * every * dt - 1e-9:
                record(run, motion, h)

        steps = motion.run(end, dt, each=look)
        if run.time[-1] < end - 1e-9:
            record(run, motion, h)
    run.iterations = [step.iterations for step in steps]
    run.dt, run.ends = [step.size for step in steps], [step.end for step in steps]
    run.seconds = perf_counter() - start
    return run


def record(run: Run, motion: tawami.Dynamics, h: float) -> None:
    """Keep what the figures need."""
    x = np.array(motion.scene.particles.x)
    stress = motion.scene.particles.stress[:, :3].mean(axis=1)
    run.time.append(motion.time)
    run.runout.append(float(np.quantile(x[:, 0], 0.99)))  # the farthest particle is spray
    run.energies.append(motion.energies)
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
        f"(median); {run.seconds:.0f} s\n{'':14} {run.energies[-1]}"
    )


# -- figures -----------------------------------------------------------------

#: Parts of the balance of energy that are drawn, with their lines.
LINES = {"kinetic": "-", "dissipated": "--", "external": ":", "transfer": "-."}
NAMES = {
    "kinetic": "kinetic",
    "dissipated": "dissipated by the law",
    "external": "released weight",
    "transfer": "lost in transfers",
}


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


def surface(x: Array, h: float) -> tuple[Array, Array]:
    """Profile of the pile: the highest particle in strips of h [m]."""
    strip = np.floor(x[:, 0] / h).astype(int)
    used = np.unique(strip)
    return (used + 0.5) * h, np.array([x[strip == s, 1].max() for s in used])


def profiles(runs: Sequence[Run], path: Path, h: float) -> None:
    """Profiles at several times, a panel a form."""
    figure, panels = plt.subplots(
        len(runs), 1, figsize=(8, 2.2 * len(runs)), layout="constrained", sharex=True, squeeze=False
    )
    for axes, run in zip(panels[:, 0], runs, strict=True):
        wanted = np.unique(np.searchsorted(run.time, [0.0, 0.1, 0.2, 0.3, 0.4, 0.8]))
        for k in wanted[wanted < len(run.time)]:
            shade = plt.cm.viridis(0.9 * run.time[k] / run.time[-1])
            axes.plot(*surface(run.x[k], h), color=shade, label=f"$t$ = {run.time[k]:.2f} s")
        axes.set_aspect("equal")
        axes.set_ylim(0, 1.15 * HEIGHT)
        axes.set_title(FORMS[run.form], fontsize=9)
        axes.set_ylabel("$y$ [m]")
        axes.legend(fontsize=7, ncols=2)
    panels[-1, 0].set_xlabel("$x$ [m]")
    save(figure, path)


def histories(runs: Sequence[Run], path: Path) -> None:
    """Run-out, energies, roughness and Newton iterations over time."""
    figure, panels = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
    for run in runs:
        style = {"color": COLOURS[run.form], "label": FORMS[run.form]}
        panels[0, 0].plot(run.time, run.runout, **style)
        for name, line in LINES.items():
            values = [getattr(energies, name) for energies in run.energies]
            label = style["label"] if name == "kinetic" else None
            panels[0, 1].plot(run.time, values, line, color=style["color"], label=label)
        panels[1, 0].plot(run.time[1:], run.roughness[1:], **style)
        panels[1, 1].plot(run.ends, run.iterations, ".", markersize=2, **style)
    for name, line in LINES.items():
        panels[0, 1].plot([], [], line, color="black", label=NAMES[name])
    labels = ("run-out (99 % of particles) [m]", "energy [J/m]",
              "roughness of the mean stress [-]", "Newton iterations per step [-]")  # fmt: skip
    for axes, label in zip(panels.ravel(), labels, strict=True):
        axes.set_xlabel("$t$ [s]")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    save(figure, path, dpi=150)


# -- piles of other shapes, and of an incompressible material ----------------


@dataclass(frozen=True)
class Runout:
    """Run-out of a pile: height over length, and how far it spreads over its length."""

    aspect: float
    spread: float


def runout(aspect: float, cells: int, *, end: float = 4.0) -> Runout:
    """The collapse of a pile of 0.1 m times `aspect`, to `end` sqrt(height/g)."""
    length = 0.1
    h, height = length / cells, aspect * length
    time = end * np.sqrt(height / G)
    run = solve("u_epsv_finite", h=h, dt=1e-3, end=time, every=10**9, size=(length, height))
    return Runout(aspect, run.runout[-1] / length - 1)


def exponents(piles: Sequence[Runout]) -> tuple[float, float]:
    """Slopes of log spread over log aspect, of the piles up to 1.5 and of those from 1.5."""
    low, high = (
        np.array([(p.aspect, p.spread) for p in piles if where(p.aspect)])
        for where in (lambda a: a <= 1.5, lambda a: a >= 1.5)
    )
    slopes = [np.polyfit(*np.log(part).T, 1)[0] for part in (low, high)]
    return float(slopes[0]), float(slopes[1])


def runouts(piles: Sequence[Runout], path: Path) -> None:
    """Spread over aspect ratio, with the slopes of the experiments."""
    figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
    aspect, spread = np.array([(p.aspect, p.spread) for p in piles]).T
    axes.loglog(aspect, spread, "o-", color=COLOURS["u_epsv_finite"], label=FORMS["u_epsv_finite"])
    for start, slope, line in ((0, 1.0, "--"), (-1, 2 / 3, ":")):
        axes.loglog(
            aspect, spread[start] * (aspect / aspect[start]) ** slope, line, color="black",
            label=f"slope {slope:.2g}",
        )  # fmt: skip
    axes.set_xlabel("height over length of the pile, $a$ [-]")
    axes.set_ylabel("run-out, $(L_{end} - L_0)/L_0$ [-]")
    axes.grid(alpha=0.3, which="both")
    axes.legend()
    save(figure, path)


def compare_aspects(folder: Path) -> None:
    """Run-outs of piles from low to high."""
    piles = []
    for aspect, cells in ASPECTS.items():
        piles.append(runout(aspect, cells))
        print(f"a = {aspect:4.2f}: run-out {piles[-1].spread:.3f} of the length", flush=True)
    low, high = exponents(piles)
    print(f"exponents: {low:.2f} up to a = 1.5, {high:.2f} from there on")
    runouts(piles, folder / "runouts.png")
    print(f"Results: {folder / 'runouts.png'}")


def incompressible(end: float) -> None:
    """The mixed form near nu = 0.5."""
    run = solve("u_epsv_finite", nu=0.4999, alpha=0.1, end=end)
    print(f"nu = 0.4999, alpha = 0.1: {summary(run)}; smallest step {min(run.dt):.2e} s")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the collapse with each form, draw it, say where."""
    parser = argparse.ArgumentParser(prog="python -m cases.showcase.collapse", description=__doc__)
    parser.add_argument("--results", default="results/collapse", help="folder for the results")
    parser.add_argument("--end", type=float, default=0.8, help="time of the end [s]")
    parser.add_argument("--dt", type=float, default=1e-3, help="size of a step [s]")
    parser.add_argument("--cell", type=float, default=0.01, help="size of a cell [m]")
    parser.add_argument("--aspects", action="store_true", help="compare piles of other shapes")
    parser.add_argument("--incompressible", action="store_true", help="nu = 0.4999 to 0.4 s")
    options = parser.parse_args(arguments)
    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    if options.aspects:
        return compare_aspects(folder)
    if options.incompressible:
        return incompressible(min(options.end, 0.4))
    print(build("u_epsv_finite", h=options.cell).header(), flush=True)
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
    profiles(runs, folder / "profiles.png", options.cell)
    histories(runs, folder / "histories.png")
    print(f"Results: film.png, profiles.png and histories.png in {folder}")


if __name__ == "__main__":
    tawami.run(main, "collapse")
