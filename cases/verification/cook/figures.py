"""Figures: error of the deflection over the cell size, mean stress on the deformed membrane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import tawami
from cases.common.figure import add_bar, draw_particles, save
from cases.verification.cook.membrane import CORNERS, HEIGHT, LENGTH, Row
from tawami.picture import style

STYLES = {
    "u_epsv_0.1": (r"MPM, $u$-$\varepsilon_v$, $\alpha$ = 0.1", style.VERMILION, "o", "-"),
    "u_epsv_0.01": (r"MPM, $u$-$\varepsilon_v$, $\alpha$ = 0.01", style.BLUE, "o", "-"),
    "u_epsv_projection": (
        r"MPM, $u$-$\varepsilon_v$, projection, $\alpha$ = 0.1", style.SKY, "x", "-"
    ),
    "u_bbar": ("MPM, B-bar", style.ORANGE, "D", "-"),
    "u": ("MPM, displacement only", style.GRAY, "s", "-"),
    "fem_q2": ("FEM, Q2 displacement", style.GREEN, "s", "--"),
    "fem_taylor_hood": ("FEM, Taylor-Hood Q2-Q1", "black", "^", "--"),
}  # fmt: skip
TITLES = {
    "even": "2 x 2 particles, exact in cut cells",
    "gauss": "3 x 3 Gauss points, exact in cut cells",
    "lattice": "2 x 2 particles, those outside left out",
}
#: Factor by which displacements are magnified.
MAGNIFIED = 20
#: Range of the colours of the mean stress. The corners of the clamp are beyond it.
STRESS = 0.2


def deflection_error(rows: Sequence[Row], path: Path) -> None:
    """Draw the error of the deflection over the cell size.

    One row of panels per Poisson's ratio, one column per kind of body.
    """
    ratios = sorted({row.nu for row in rows})
    figure, panels = plt.subplots(
        len(ratios), len(TITLES), figsize=(13, 4.2 * len(ratios)), layout="constrained",
        sharex=True, sharey=True, squeeze=False,
    )  # fmt: skip
    for line, nu in zip(panels, ratios, strict=True):
        for axes, body in zip(line, TITLES, strict=True):
            _errors(axes, [row for row in rows if row.nu == nu and row.body in (body, None)])
            axes.set_title(rf"$\nu$ = {nu:g}: {TITLES[body]}")
        line[0].set_ylabel("|error| of the deflection [%]")
    for axes in panels[-1]:
        axes.set_xlabel("cell size $h$ [-]  (dotted: first order)")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    save(figure, path)


def _errors(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw one line per method, and first order dotted."""
    for method, (label, colour, marker, dash) in STYLES.items():
        mine = [row for row in rows if row.method == method]
        axes.plot(
            [row.h for row in mine], [abs(row.error_percent) for row in mine], dash, label=label,
            color=colour, marker=marker,
        )  # fmt: skip
    sizes = np.array(sorted({row.h for row in rows}))
    axes.plot(sizes, sizes, color="black", linewidth=1, linestyle=":")
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_xticks(sizes, [f"{h:g}" for h in sizes])
    axes.grid()


def mean_stress(solutions: Mapping[str, tawami.Solution], nu: float, h: float, path: Path) -> None:
    """Draw the mean stress at the displaced particles, one panel per method."""
    figure, panels = plt.subplots(
        1, len(solutions), figsize=(4 * len(solutions), 6.4), layout="constrained", sharey=True
    )
    outline = np.array([*CORNERS, CORNERS[0]])
    for axes, (method, solution) in zip(panels, solutions.items(), strict=True):
        x = solution.x + MAGNIFIED * solution.displacement_of_particles
        stress, limits = solution.mean_stress, (-STRESS, STRESS)
        squares = draw_particles(axes, x, np.sqrt(solution.volume), stress, "-", limits)
        axes.plot(*outline.T, color="black", linewidth=0.8, linestyle=":")
        axes.set_xlim(-2, LENGTH + 2)
        axes.set_ylim(-2, HEIGHT + 8)
        largest = np.abs(solution.mean_stress).max()
        title = f"{STYLES[method][0]}\n(largest |mean stress| {largest:.2g})"
        axes.set_title(title)
        axes.set_xlabel(f"$x$ [-]  (displacements x {MAGNIFIED})")
    panels[0].set_ylabel("$y$ [-]")
    figure.suptitle(rf"$\nu$ = {nu:g}, $h$ = {h:g}: {TITLES['even']}")
    add_bar(squares, panels)
    save(figure, path)
