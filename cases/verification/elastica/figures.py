"""Figures of the bent strip."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from cases.common.figure import COLOURS, save
from cases.verification.elastica.mpm import Run
from cases.verification.elastica.strip import LOADS, D, curve, mean_stress
from tawami.picture import style

FORMS = {
    "u_epsv_finite": "mixed $u$-$\\varepsilon_v$",
    "u_finite": "displacement only",
    "u_bbar_finite": "B-bar",
}


def shapes(runs: Sequence[Run], path: Path) -> None:
    """Draw the bent beams, coloured by mean stress, and the elastica.

    One column of panels per form, one row per load.
    """
    figure, panels = plt.subplots(
        len(LOADS), len(FORMS), figsize=(14, 8), layout="constrained", sharex="row", sharey="row",
        height_ratios=(1, 1.9),
    )  # fmt: skip
    for run in runs:
        row, column = LOADS.index(run.load), list(FORMS).index(run.form)
        axes = panels[row, column]
        L = (run.slender - 0.5 / run.n) * D
        # colours up to the stress of the outer fibres at the root, for the largest Poisson's ratio
        limit = mean_stress(run.load, 0.499, L, np.array([[0.0, D / 2]]))[0] / 1e3
        shown = axes.scatter(
            *run.at.T, c=run.mean_stress / 1e3, s=2, cmap=style.SIGNED, vmin=-limit, vmax=limit
        )
        axes.plot(*L * curve(run.load, np.linspace(0, 1, 200))[:2], "k", label="elastica")
        axes.set_aspect("equal")
        axes.set_title(f"{FORMS[run.form]}, $\\nu$ = {run.nu}, $PL^2/\\bar{{E}}I$ = {run.load:g}")
        axes.set_xlabel("$x$ [m]")
        axes.set_ylabel("$y$ [m]")
        axes.legend(loc="lower left")
        if column == len(FORMS) - 1:
            figure.colorbar(shown, ax=panels[row], label="mean stress [kPa], tension positive")
    save(figure, path)


def errors(cells: Sequence[Run], steps: Sequence[Run], path: Path) -> None:
    """Draw errors of tip and mean stress over the cells and of the tip over the steps.

    One column of panels per load.
    """
    figure, panels = plt.subplots(3, len(LOADS), figsize=(12, 10.5), layout="constrained")
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
        axes.grid()
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside right upper")
    panels[2, 1].legend(loc="upper left")
    save(figure, path)


def _over_cells(panels: Sequence[plt.Axes], runs: Sequence[Run]) -> None:
    """Errors of the tip and of the mean stress, one line per form and Poisson's ratio."""
    markers = {0.3: "o", 0.49: "s", 0.499: "^"}
    for form, nu in dict.fromkeys((run.form, run.nu) for run in runs):
        chosen = [run for run in runs if (run.form, run.nu) == (form, nu)]
        n = [run.n for run in chosen]
        look = {"color": COLOURS[form], "marker": markers[nu],
                 "label": f"{FORMS[form]}, $\\nu$ = {nu}"}  # fmt: skip
        panels[0].loglog(n, [run.error for run in chosen], **look)
        panels[1].loglog(n, [run.stress_error for run in chosen], **look)
    expected = [run.expected for run in chosen]
    panels[0].loglog(n, expected, "k--", label="of the particles' second moment")
    panels[0].set_ylabel("distance of the tips / $L$ [%]")
    panels[1].set_ylabel("rms error of the mean stress [%]")
    for axes in panels:
        axes.set_xlabel("cells over the depth [-]")
        axes.set_xticks(n, [str(cells) for cells in n])


def _over_steps(axes: plt.Axes, runs: Sequence[Run]) -> None:
    """Error of the tip, one line per factor of the ghost penalty."""
    for k, colour in ((1e-3, style.ORANGE), (1e-2, style.VERMILION), (1e-1, style.PURPLE)):
        chosen = sorted((run for run in runs if run.k == k), key=lambda run: run.steps)
        accepted = [run.accepted for run in chosen]
        axes.loglog(
            accepted, [run.error for run in chosen], color=colour, marker="o",
            label=f"ghost penalty, $k$ = {k:g}",
        )  # fmt: skip
    axes.set_xlabel("steps, the grid reset after each [-] (mixed, $\\nu$ = 0.3, 4 cells)")
    axes.set_ylabel("distance of the tips / $L$ [%]")
    axes.set_xticks(accepted, [str(count) for count in accepted])
