"""Figures of the vibrating beam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from cases.common.figure import save
from cases.verification.vibrating_beam.beam import AMPLITUDE, NUS
from cases.verification.vibrating_beam.mpm import Run
from tawami.picture import style

COLOURS = {
    "affine_flip": style.VERMILION,
    "apic": style.SKY,
    "tpic": style.BLUE,
    "flip": style.ORANGE,
    "pic": style.GRAY,
}
#: Dashed, because their lines coincide with that of affine FLIP.
DASHES = {"apic": ":", "tpic": "--"}
OF_NU = {0.3: style.GREEN, 0.49: style.PURPLE}


def motion(runs: Sequence[Run], periods: Mapping[float, float], path: Path) -> None:
    """Draw deflection and energy over time for each transfer, one column per Poisson's ratio.

    Args:
        runs: Runs that differ only in Poisson's ratio and transfer.
        periods: Periods by finite elements [s], by Poisson's ratio.
        path: File of the figure.
    """
    figure, panels = plt.subplots(3, len(NUS), figsize=(12, 10), layout="constrained", sharex=True)
    for column, nu in enumerate(NUS):
        top, middle, bottom = panels[:, column]
        for run in (run for run in runs if run.nu == nu):
            time = np.array(run.time) / periods[nu]
            dashes = DASHES.get(run.transfer, "-")
            look = {"color": COLOURS[run.transfer], "label": run.transfer, "linestyle": dashes}
            top.plot(time, np.array(run.deflection) / AMPLITUDE, **look)
            middle.plot(time, run.energy, **look)
            if run.energy[-1] > 0.99:
                bottom.plot(time, run.energy, **look)
        time = np.linspace(0, time[-1], 500)
        top.plot(time, np.sin(2 * np.pi * time), "k:", label="finite elements, without damping")
        top.set_title(f"$\\nu$ = {nu}")
        top.set_ylabel("tip's deflection / amplitude [-]")
        middle.set_ylabel("energy / that of the start [-]")
        bottom.set_ylabel("the same, enlarged [-]")
        middle.set_ylim(0, 1.05)
        bottom.set_ylim(0.99, 1.001)
        bottom.set_xlabel("$t$ / period of the finite elements [-]")
        for axes in panels[:, column]:
            axes.grid()
        top.set_ylim(-1.1, 1.9)
        top.legend(loc="upper center", ncols=3)
        middle.legend(loc="lower left")
        bottom.legend(loc="lower left")
    save(figure, path)


def accuracy(
    over_steps: Sequence[Run], over_cells: Sequence[Run], periods: Mapping[float, float], path: Path
) -> None:
    """Draw the error of the period and the loss of energy over the sizes of step and cell.

    Args:
        over_steps: Runs that differ only in Poisson's ratio and step size.
        over_cells: Runs that differ only in Poisson's ratio and cell size.
        periods: Periods by finite elements [s], by Poisson's ratio.
        path: File of the figure.
    """
    figure, panels = plt.subplots(2, 2, figsize=(11, 8), layout="constrained", sharey="row")
    ticks = ((0.2, 0.5, 1, 2, 5), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1))
    for (top, bottom), runs, name, label in (
        (panels[:, 0], over_steps, "steps", "steps per period [-]"),
        (panels[:, 1], over_cells, "n", "cells over the depth [-]"),
    ):
        for nu in NUS:
            chosen = sorted((r for r in runs if r.nu == nu), key=lambda r: getattr(r, name))
            abscissa = [getattr(run, name) for run in chosen]
            look = {"color": OF_NU[nu], "marker": "o", "label": f"$\\nu$ = {nu}"}
            error = [run.period / periods[nu] - 1 for run in chosen]
            top.plot(abscissa, 100 * np.array(error), **look)
            bottom.plot(abscissa, [100 * (1 - run.energy[-1]) for run in chosen], **look)
        expected = [100 * run.expected for run in chosen]
        top.plot(abscissa, expected, "k--", label="of trapezoidal rule and particles' places")
        for axes, values in zip((top, bottom), ticks, strict=True):
            axes.set_xscale("log", base=2)
            axes.set_yscale("log")
            axes.set_xticks(abscissa, [str(value) for value in abscissa])
            axes.set_yticks(values, [str(value) for value in values])
            axes.set_yticks([], minor=True)
            axes.set_xlabel(label)
            axes.grid()
            axes.legend()
    panels[0, 0].set_ylabel("period, longer than by finite elements [%]")
    panels[1, 0].set_ylabel("energy lost in five periods [%]")
    save(figure, path)
