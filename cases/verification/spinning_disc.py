"""A free disc of nearly incompressible rubber spins ten times: what is kept, is it still round.

It starts with the velocity of a rigid rotation and without stress, and so pulsates about the state
that centrifugal forces ask for, in plane strain (Timoshenko and Goodier, rotating discs), with
nubar = nu/(1 - nu)

    sigma_r + sigma_t = rho omega^2 / 4 { (3 + nubar) R^2 - 2 (1 + nubar) r^2 }
    mean stress       = (1 + nu)/3 (sigma_r + sigma_t)

rho omega^2 R^2 / E = 0.05: volumetric strains up to 0.3 %, half of that without the pulsation.

Forces have no moment, sum m x x a = 0 after every step. The trapezoidal rule then keeps
sum m (x + dt v/2) x (v + dt a/2), that is sum m (x x v + dt^2/4 v x a), and not sum m x x v. At the
start a = 0, in the steady state a = -omega^2 x: sum m x x v falls by the share (omega dt)^2/4, and
by up to twice that while the disc pulsates. With 150 steps in a turn this stays below 1e-3; the
rest is the transfer's part.

python -m cases.verification.spinning_disc [--results results/spinning_disc] [--turns 10]
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
from tqdm import tqdm

import tawami
from cases.common.figure import save
from tawami.fem.environment import header
from tawami.motion.transfer import TransferName
from tawami.results.output import result_folder

Array = npt.NDArray[np.float64]

R, RHO = 1.0, 1000.0  # radius [m], density [kg/m3]
E, NU = 1.0e6, 0.49  # [Pa], [-]
OMEGA = float(np.sqrt(0.05 * E / RHO) / R)  # [rad/s]
TURN = 2 * np.pi / OMEGA  # [s]
TENSION = RHO * OMEGA**2 * R**2  # what stresses are divided by [Pa]


@dataclass(frozen=True)
class Kind:
    """What differs from run to run."""

    form: str
    transfer: TransferName
    name: str
    colour: str


KINDS = (
    Kind("u_epsv_finite", "affine_flip", "mixed, affine FLIP", "tab:red"),
    Kind("u_epsv_finite", "tpic", "mixed, TPIC", "tab:blue"),
    Kind("u_finite", "affine_flip", "displacement only, affine FLIP", "tab:gray"),
    Kind("u_epsv_finite", "flip", "mixed, plain FLIP", "tab:orange"),
)


@dataclass
class Run:
    """What a run recorded.

    Attributes:
        kind: Form and transfer.
        radii: Of the particles at the start [m].
        steps: Steps in a turn.
        turns: Of each recorded state, a step each, the start the first [-].
        angular: Angular momentum, over that of the start.
        kept: The quantity that the trapezoidal rule keeps, over the same.
        energy: Kinetic and elastic, over that of the start.
        linear: Linear momentum, over the sum of its magnitudes.
        roundness: (r_max - r_min)/R of the outer ring, about the centre of mass.
        x: Of the particles at the start and after each turn [m].
        steady: Mean stress of the particles, averaged over each turn [Pa].
        seconds: Wall time.
    """

    kind: Kind
    radii: Array
    steps: int
    turns: list[float] = field(default_factory=list)
    angular: list[float] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    energy: list[float] = field(default_factory=list)
    linear: list[float] = field(default_factory=list)
    roundness: list[float] = field(default_factory=list)
    x: list[Array] = field(default_factory=list)
    steady: list[Array] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def drift(self) -> float:
        """Largest change of the angular momentum, as a share."""
        return float(np.abs(np.array(self.angular) - 1).max())

    @property
    def drift_of_transfer(self) -> float:
        """The same without what the rule itself does."""
        return float(np.abs(np.array(self.kept) - 1).max())

    @property
    def stress_error(self) -> list[float]:
        """rms error of the mean stress averaged over each turn, over its rms."""
        exact = mean_stress(self.radii)
        return [float(np.sqrt(np.mean((s - exact) ** 2) / np.mean(exact**2))) for s in self.steady]


def mean_stress(r: Array, nu: float = NU) -> Array:
    """In the steady state, at distances r [m] from the centre [Pa]."""
    nubar = nu / (1 - nu)
    both = RHO * OMEGA**2 / 4 * ((3 + nubar) * R**2 - 2 * (1 + nubar) * r**2)
    return np.asarray((1 + nu) / 3 * both)


def rings(number: int) -> tawami.Body:
    """A disc as so many rings of particles of one volume: 3, 9, 15, ... of them.

    Ring k is between (k - 1) dr and k dr and has 3 (2 k - 1) particles, nearly square. They are at
    the rms radius of the ring: volume and polar moment are those of the disc.
    """
    places = []
    for k in range(1, number + 1):
        count = 3 * (2 * k - 1)
        r = R / number * np.sqrt(((k - 1) ** 2 + k**2) / 2)
        angle = 2 * np.pi / count * (np.arange(count) + 0.5 * (k % 2))
        places.append(r * np.column_stack([np.cos(angle), np.sin(angle)]))
    x = np.concatenate(places)
    return tawami.Body(x, np.full(len(x), np.pi * R**2 / len(x)))


def build(
    kind: Kind,
    *,
    n: int = 6,
    per_axis: int = 3,
    nu: float = NU,
    alpha: float = 0.01,
    **options: Any,
) -> tawami.Dynamics:
    """The disc on n cells over the radius, so many rings in each; other options go to `Scene`."""
    h = R / n
    # the centre of the disc is no point of symmetry of the grid
    origin = (-(n + 2 + 0.013) * h, -(n + 2 + 0.007) * h)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=origin, h=h, cells=(2 * n + 5, 2 * n + 5))
    body = rings(n * per_axis)
    material = tawami.linear_elastic(E=E, nu=nu)
    if kind.form == "u_epsv_finite":
        options["alpha"] = alpha
    scene = tawami.Scene(grid, body, material, form=kind.form, density=RHO, **options)
    spin = OMEGA * np.array([[0.0, -1.0], [1.0, 0.0]])
    motion = tawami.Dynamics(scene, velocity=body.x @ spin.T, transfer=kind.transfer)
    motion.velocity_gradient[:] = spin
    return motion


def solve(
    kind: Kind = KINDS[0],
    *,
    turns: int = 10,
    steps: int = 150,
    nu: float = NU,
    **options: Any,
) -> Run:
    """So many turns of so many steps each."""
    motion = build(kind, nu=nu, **options)
    scene, begin, dt = motion.scene, perf_counter(), TURN / steps
    radii = np.linalg.norm(np.array(scene.particles.x), axis=1)
    run = Run(kind, radii, steps)
    record(run, motion, dt)
    run.x.append(np.array(scene.particles.x))
    with tqdm(total=turns, desc=kind.name, unit="turn", disable=not sys.stderr.isatty()) as bar:
        for _ in range(turns):
            total = np.zeros(len(radii))
            for _ in range(steps):
                motion.step(dt)
                record(run, motion, dt)
                total += scene.particles.stress[:, :3].mean(axis=1)
            run.steady.append(total / steps)
            run.x.append(np.array(scene.particles.x))
            bar.update()
    run.seconds = perf_counter() - begin
    return run


def record(run: Run, motion: tawami.Dynamics, dt: float) -> None:
    """What is recorded of every step."""
    scene, v, a = motion.scene, motion.velocity, motion.acceleration
    x = np.array(scene.particles.x)
    spin = OMEGA * motion.mass @ run.radii**2
    moment = motion.mass @ (v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0])
    speed = motion.mass @ np.linalg.norm(v, axis=1)
    outer = np.isclose(run.radii, run.radii.max())
    r = np.linalg.norm(x[outer] - motion.mass @ x / motion.mass.sum(), axis=1)
    run.turns.append(motion.time / TURN)
    run.angular.append(motion.angular_momentum() / spin)
    run.kept.append((motion.angular_momentum() + dt**2 / 4 * moment) / spin)
    run.energy.append((motion.kinetic_energy + motion.elastic_energy) / (0.5 * OMEGA * spin))
    run.linear.append(float(np.abs(motion.linear_momentum).max() / speed))
    run.roundness.append(float((r.max() - r.min()) / R))


def summary(run: Run) -> str:
    """A line of numbers."""
    errors = run.stress_error
    return (
        f"{run.kind.name:30} {run.turns[-1]:.0f} turns: linear momentum {max(run.linear):.0e}, "
        f"angular {run.angular[-1] - 1:+.1e} at the end, {run.drift:.1e} at most "
        f"({run.drift_of_transfer:.1e} of the transfer), energy {100 * run.energy[-1]:.2f} % "
        f"(highest {100 * max(run.energy):.2f} %), roundness {run.roundness[-1]:.1e}, mean stress "
        f"{100 * errors[0]:.0f} % off in the first, {100 * errors[-1]:.0f} % in the last turn; "
        f"{run.seconds:.0f} s"
    )


# -- figures -----------------------------------------------------------------


def film(runs: Sequence[Run], path: Path) -> None:
    """Particles after several turns, their mean stress, a row a run; a spoke in black."""
    wanted = np.unique(np.linspace(1, len(runs[0].x) - 1, 4).round().astype(int))
    figure, panels = plt.subplots(
        len(runs), len(wanted), figsize=(3.2 * len(wanted) + 1, 3.2 * len(runs)), sharex=True,
        sharey=True, squeeze=False, layout="constrained",
    )  # fmt: skip
    for row, run in enumerate(runs):
        start = run.x[0]
        spoke = (start[:, 0] > 0) & (np.abs(start[:, 1]) < 1e-9)
        for axes, k in zip(panels[row], wanted, strict=True):
            shown = axes.scatter(
                *run.x[k].T, c=run.steady[k - 1] / TENSION, s=8, cmap="viridis", vmin=0, vmax=0.6
            )
            axes.plot(*run.x[k][spoke].T, "ko", markersize=3.5)
            axes.set_aspect("equal")
            axes.set_title(f"{run.kind.name}\nafter turn {k}", fontsize=9)
        panels[row, 0].set_ylabel("$y$ [m]")
    for axes in panels[-1]:
        axes.set_xlabel("$x$ [m]")
    label = "mean stress / $\\rho \\omega^2 R^2$, averaged over the turn [-], tension positive"
    figure.colorbar(shown, ax=panels, aspect=50, label=label, extend="both")
    save(figure, path)


def histories(runs: Sequence[Run], path: Path) -> None:
    """Angular momentum, energy, roundness, and mean stress beside the closed form."""
    figure, panels = plt.subplots(3, 2, figsize=(12, 12), layout="constrained")
    (momentum, loss), (energy, roundness), (profile, error) = panels
    for run in runs:
        style = {"color": run.kind.colour, "label": run.kind.name, "linewidth": 1}
        loss.plot(run.turns, run.angular, **style)
        loss.plot(run.turns, run.energy, color=run.kind.colour, linestyle="--")
        roundness.plot(run.turns, run.roundness, **style)
        error.plot(np.arange(1, len(run.steady) + 1), run.stress_error, "o-", **style)
        if run.kind.transfer == "flip":
            continue
        behind = 1 if run.kind.form == "u_finite" else 2  # it swings most
        energy.plot(run.turns, run.energy, zorder=behind, **style)
        change = 1e3 * (np.array(run.angular) - 1)
        momentum.plot(run.turns, change, alpha=0.4, zorder=behind, **style)
        momentum.plot(run.turns, 1e3 * (np.array(run.kept) - 1), color=run.kind.colour)
        if run.kind.transfer == "affine_flip":
            beside = 0.008 * (1 if run.kind.form == "u_finite" else -1)  # not on each other
            stress = run.steady[-1] / TENSION
            profile.plot(run.radii / R + beside, stress, ".", markersize=3, **style)
    momentum.plot([], [], color="black", label="dark: without the part of the trapezoidal rule")
    momentum.axhline(-1, color="black", linestyle=":")
    r = np.linspace(0, R)
    profile.plot(r / R, mean_stress(r) / TENSION, "k", label="closed form")
    labels = ("change of angular momentum [$10^{-3}$]",
              "angular momentum (dashed: energy) [start = 1]",
              "energy, enlarged [start = 1]", "$(r_{max} - r_{min})/R$ of the outer ring [-]",
              "mean stress / $\\rho \\omega^2 R^2$ [-], mean of the last turn",
              "rms error of the mean stress of a turn [-]")  # fmt: skip
    for axes, label in zip(panels.ravel(), labels, strict=True):
        axes.set_xlabel("$r/R$ at the start [-]" if axes is profile else "turns [-]")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    roundness.set_ylim(bottom=0)
    error.set_yscale("log")
    ticks = (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2)
    error.set_yticks(ticks, [str(value) for value in ticks])
    error.set_yticks([], minor=True)
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Spin the disc with each form and transfer, draw it, say where."""
    parser = argparse.ArgumentParser(
        prog="python -m cases.verification.spinning_disc", description=__doc__
    )
    parser.add_argument("--results", default="results/spinning_disc", help="folder for the results")
    parser.add_argument("--turns", type=int, default=10, help="number of turns")
    options = parser.parse_args(arguments)
    if options.turns < 1:
        parser.error(f"--turns {options.turns}: expected 1 or more")
    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    runs = []
    for kind in KINDS:
        runs.append(solve(kind, turns=options.turns))
        print(summary(runs[-1]), flush=True)
    turned = 2 * np.pi / runs[0].steps
    print(
        f"rho omega^2 R^2 / E = {TENSION / E:g}, nu = {NU}, {len(runs[0].radii)} particles. The "
        f"trapezoidal rule itself takes {turned**2 / 4:.1e} of the angular momentum, twice that at "
        "most"
    )
    film([run for run in runs if run.kind.transfer != "tpic"], folder / "film.png")
    histories(runs, folder / "histories.png")
    print(f"Results: {folder / 'film.png'}, {folder / 'histories.png'}")


if __name__ == "__main__":
    tawami.run(main, "spinning_disc")
