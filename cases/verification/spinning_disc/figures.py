"""Figures of the spinning disc."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from cases.common.figure import save
from cases.verification.spinning_disc.disc import TENSION, R, Run, mean_stress
from tawami.picture import style


def film(runs: Sequence[Run], path: Path) -> None:
    """Draw the particles after several turns, coloured by mean stress, with one spoke in black.

    One row of panels per run.
    """
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
                *run.x[k].T,
                c=run.steady[k - 1] / TENSION,
                s=8,
                cmap=style.MAGNITUDE,
                vmin=0,
                vmax=0.6,
            )
            axes.plot(*run.x[k][spoke].T, "ko", markersize=3.5)
            axes.set_aspect("equal")
            axes.set_title(f"{run.kind.name}\nafter turn {k}")
        panels[row, 0].set_ylabel("$y$ [m]")
    for axes in panels[-1]:
        axes.set_xlabel("$x$ [m]")
    label = "mean stress / $\\rho \\omega^2 R^2$, averaged over the turn [-], tension positive"
    figure.colorbar(shown, ax=panels, aspect=50, label=label, extend="both")
    save(figure, path)


def histories(runs: Sequence[Run], path: Path) -> None:
    """Draw angular momentum, energy, roundness, and mean stress with the closed form."""
    figure, panels = plt.subplots(3, 2, figsize=(12, 12), layout="constrained")
    (momentum, loss), (energy, roundness), (profile, error) = panels
    for run in runs:
        look = {"color": run.kind.colour, "label": run.kind.name, "linewidth": 1}
        loss.plot(run.turns, run.angular, **look)
        loss.plot(run.turns, run.energy, color=run.kind.colour, linestyle="--")
        roundness.plot(run.turns, run.roundness, **look)
        error.plot(np.arange(1, len(run.steady) + 1), run.stress_error, "o-", **look)
        if run.kind.transfer == "flip":
            continue
        behind = 1 if run.kind.form == "u_finite" else 2  # its line oscillates most
        energy.plot(run.turns, run.energy, zorder=behind, **look)
        change = 1e3 * (np.array(run.angular) - 1)
        momentum.plot(run.turns, change, alpha=0.4, zorder=behind, **look)
        momentum.plot(run.turns, 1e3 * (np.array(run.conserved) - 1), color=run.kind.colour)
        if run.kind.transfer == "affine_flip":
            offset = 0.008 * (1 if run.kind.form == "u_finite" else -1)  # side by side
            stress = run.steady[-1] / TENSION
            profile.plot(run.radii / R + offset, stress, ".", markersize=3, **look)
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
        axes.grid()
        axes.legend()
    roundness.set_ylim(bottom=0)
    error.set_yscale("log")
    ticks = (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2)
    error.set_yticks(ticks, [str(value) for value in ticks])
    error.set_yticks([], minor=True)
    save(figure, path)
