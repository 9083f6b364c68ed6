"""Figures of the collapse."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from cases.common.figure import COLOURS, add_bar, draw_particles, save
from cases.showcase.collapse.pile import HEIGHT, RHO, Array, G, Run
from cases.showcase.collapse.runout import Runout
from tawami.picture.film import Film, Frame
from tawami.picture.particles import Corners, scale_of

NAMES = {
    "u_epsv_finite": "mixed $u$-$\\varepsilon_v$",
    "u_bbar_finite": "B-bar",
    "u_finite": "displacement only",
}
#: Parts of the energy balance that are drawn, with their names and lines.
ENERGIES = {
    "kinetic": ("kinetic", "-"),
    "dissipated": ("dissipated by the law", "--"),
    "external": ("released weight", ":"),
    "transfer": ("lost in transfers", "-."),
}


def film(runs: Sequence[Run], path: Path) -> None:
    """Draw the mean stress at the particles at several times, one column of panels per form."""
    wanted = np.linspace(0, len(runs[0].time) - 1, 6).round().astype(int)
    figure, panels = plt.subplots(
        len(wanted), len(runs), figsize=(6.5 * len(runs), 1.6 * len(wanted)), layout="constrained",
        sharex=True, sharey=True, squeeze=False,
    )  # fmt: skip
    limit = RHO * G * HEIGHT
    for column, run in enumerate(runs):
        for row, k in enumerate(wanted):
            axes = panels[row, column]
            shown = draw_particles(
                axes, run.x[k], np.sqrt(run.volume), run.mean_stress[k], "Pa", (-limit, 0.0)
            )
            axes.set_title(f"{NAMES[run.form]}, $t$ = {run.time[k]:.2f} s")
            axes.set_xlim(0, 0.45)
            axes.set_ylim(0, 1.15 * HEIGHT)
            if column == 0:
                axes.set_ylabel("$y$ [m]")
        panels[-1, column].set_xlabel("$x$ [m]")
    add_bar(shown, panels)
    save(figure, path, dpi=150)


def movie(run: Run, path: Path) -> None:
    """Write the mean stress at the particles as a GIF."""
    frames = [
        Frame(f"$t$ = {time:.2f} s", x, np.sqrt(run.volume), stress)
        for time, x, stress in zip(run.time, run.x, run.mean_stress, strict=True)
    ]
    scale = scale_of("mean Kirchhoff stress", "Pa", run.mean_stress)
    corners = Corners(np.zeros(2), np.array([0.45, 1.15 * HEIGHT]))
    Film(frames, scale, corners).movie(path, "gif")


def surface(x: Array, h: float) -> tuple[Array, Array]:
    """Profile of the pile: centres of strips of width h [m] and their highest particles [m]."""
    strip = np.floor(x[:, 0] / h).astype(int)
    used = np.unique(strip)
    return (used + 0.5) * h, np.array([x[strip == s, 1].max() for s in used])


def profiles(runs: Sequence[Run], path: Path, h: float) -> None:
    """Draw profiles of the pile at several times, one panel per form."""
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
        axes.set_title(NAMES[run.form])
        axes.set_ylabel("$y$ [m]")
        axes.legend(ncols=2)
    panels[-1, 0].set_xlabel("$x$ [m]")
    save(figure, path)


def histories(runs: Sequence[Run], path: Path) -> None:
    """Draw run-out, energies, roughness and Newton iterations over time."""
    figure, panels = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
    for run in runs:
        look = {"color": COLOURS[run.form], "label": NAMES[run.form]}
        panels[0, 0].plot(run.time, run.runout, **look)
        for name, (_, line) in ENERGIES.items():
            values = [getattr(energies, name) for energies in run.energies]
            label = look["label"] if name == "kinetic" else None
            panels[0, 1].plot(run.time, values, line, color=look["color"], label=label)
        panels[1, 0].plot(run.time[1:], run.roughness[1:], **look)
        panels[1, 1].plot(run.ends, run.iterations, ".", markersize=2, **look)
    for name, line in ENERGIES.values():
        panels[0, 1].plot([], [], line, color="black", label=name)
    labels = ("run-out (99 % of particles) [m]", "energy [J/m]",
              "roughness of the mean stress [-]", "Newton iterations per step [-]")  # fmt: skip
    for axes, label in zip(panels.ravel(), labels, strict=True):
        axes.set_xlabel("$t$ [s]")
        axes.set_ylabel(label)
        axes.grid()
        axes.legend()
    save(figure, path, dpi=150)


def runouts(piles: Sequence[Runout], path: Path) -> None:
    """Draw the spread over the aspect ratio, with the slopes of the experiments."""
    figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
    aspect, spread = np.array([(p.aspect, p.spread) for p in piles]).T
    axes.loglog(aspect, spread, "o-", color=COLOURS["u_epsv_finite"], label=NAMES["u_epsv_finite"])
    for start, slope, line in ((0, 1.0, "--"), (-1, 2 / 3, ":")):
        axes.loglog(
            aspect, spread[start] * (aspect / aspect[start]) ** slope, line, color="black",
            label=f"slope {slope:.2g}",
        )  # fmt: skip
    axes.set_xlabel("height over length of the pile, $a$ [-]")
    axes.set_ylabel("run-out, $(L_{end} - L_0)/L_0$ [-]")
    axes.grid(which="both")
    axes.legend()
    save(figure, path)
