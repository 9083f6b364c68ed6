"""Figures of the paper: deflection error over the cell size, mean stress at 32 x 16 cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

import tawami
from cases.common.figure import COLOURS, add_bar, draw_particles, save
from cases.verification.cantilever.beam import (
    SUPPORTS,
    V_CLAMPED,
    V_THEORY,
    D,
    L,
    Row,
    mean_stress,
    point_support_growth,
)  # fmt: skip
from tawami.picture import style
from tawami.picture.particles import Squares

Values = npt.NDArray[np.float64]
#: Largest mean stress of the closed form [Pa], the range of the colours.
ROOT_STRESS = float(mean_stress(0.0, D / 2))

STYLES = {
    "u": ("MPM, displacement only", COLOURS["u"], "s", "-"),
    "u_bbar": ("MPM, B-bar", style.ORANGE, "D", "-"),
    "fem_q2": ("FEM, Q2 displacement", style.GREEN, "s", "--"),
    "fem_taylor_hood": ("FEM, Taylor-Hood Q2-Q1", "black", "^", "--"),
    "fem_q1_bbar": ("FEM, Q1 B-bar", style.PURPLE, "D", "--"),
}
TITLES = {
    "paper": "paper: root rolls, centre point held\n(dotted: growth without limit)",
    "exact": "exact: closed-form displacement and tractions\n(limit: eq. (3); dotted: second order)",
    "clamped": "clamped root\n(dotted: its own limit)",
}
#: Scale, ticks and label of the error axis.
SCALES = {
    "paper": ("log", (2, 5, 10, 20, 50, 100), "error of the tip deflection [%]"),
    "exact": (
        "log",
        (1e-5, 1e-4, 1e-3, 0.01, 0.1, 1, 10, 100),
        "|error| of the tip deflection [%]",
    ),
    "clamped": ("symlog", (-20, -10, -5, 0, 5, 10, 20, 50, 100), "error [%], linear within 10 %"),
}


def deflection_error(rows: Sequence[Row], path: Path) -> None:
    """Draw the error of the tip deflection, eq. (4), over the cell size, one panel per support."""
    figure, panels = plt.subplots(1, 3, figsize=(13.5, 5.2), layout="constrained")
    for axes, support in zip(panels, SUPPORTS, strict=True):
        mine = [row for row in rows if row.support == support]
        for method, alpha in dict.fromkeys((row.method, row.alpha) for row in mine):
            line = [row for row in mine if (row.method, row.alpha) == (method, alpha)]
            if alpha is None:
                label, colour, marker, dash = STYLES[method]
            else:
                label = rf"MPM, $u$-$\varepsilon_v$, $\alpha$ = {alpha:g}"
                colour, marker, dash = plt.get_cmap(style.MAGNITUDE)(1.7 * alpha), "o", "-"
            errors = np.array([row.error_percent for row in line])
            axes.plot(
                [D / row.n for row in line], np.abs(errors) if support == "exact" else errors,
                dash, color=colour, marker=marker, label=label,
            )  # fmt: skip
        _reference(axes, support, mine)
        sizes = sorted({D / row.n for row in mine})
        axes.set_xscale("log", base=2)
        axes.set_xticks(sizes, [f"1/{round(D / h)}" for h in sizes])
        scale, ticks, label = SCALES[support]
        axes.set_yscale(scale, **({"linthresh": 10} if scale == "symlog" else {}))
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_ylabel(label)
        axes.minorticks_off()
        axes.set_xlabel("cell size $h/D$ [-]")
        axes.set_title(TITLES[support])
        axes.grid()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    save(figure, path)


def _reference(axes: Axes, support: str, rows: Sequence[Row]) -> None:
    """Draw the expected asymptote of a support, dotted."""
    dotted = {"color": "black", "linewidth": 1, "linestyle": ":"}
    if support == "paper":
        fine = [row for row in rows if row.method == "fem_taylor_hood"]
        last = max(fine, key=lambda row: row.n)
        halvings = np.log2([row.n / last.n for row in fine])
        slope = 100 * point_support_growth() / V_THEORY
        above = last.error_percent + 3 + slope * halvings
        axes.plot([D / row.n for row in fine], above, **dotted)
    elif support == "clamped":
        axes.axhline(100 * (V_CLAMPED / V_THEORY - 1), **dotted)
    else:
        sizes = np.unique([D / row.n for row in rows])
        axes.plot(sizes, 12 * sizes**2, **dotted)


def mean_stress_paper(solutions: Mapping[str, tawami.Solution], path: Path) -> None:
    """Draw the mean stress at the particles for the support `paper`, one panel per solution (Fig. 3)."""
    figure, panels = plt.subplots(
        len(solutions), 1, figsize=(6.6, 3.1 * len(solutions)), layout="constrained", sharex=True
    )
    for axes, (title, solution) in zip(panels, solutions.items(), strict=True):
        points = _field(axes, solution, solution.mean_stress, ROOT_STRESS)
        axes.set_title(_titled(title, solution.mean_stress))
        axes.set_ylabel("$y$ [m]")
    axes.set_xlabel("$x$ [m]")
    add_bar(points, panels)
    save(figure, path)


def mean_stress_exact(solutions: Mapping[str, tawami.Solution], path: Path) -> None:
    """Draw the mean stress at the particles for the support `exact`.

    Fields are on the left, their differences from the closed form on the right.
    """
    figure, panels = plt.subplots(
        len(solutions) + 1, 2, figsize=(12, 2.9 * (len(solutions) + 1)), layout="constrained"
    )
    closed, profile = panels[0]
    for (left, right), (title, solution) in zip(panels[1:], solutions.items(), strict=True):
        x, y = solution.x.T
        exact = mean_stress(x, y)
        difference = solution.mean_stress - exact
        fields = _field(left, solution, solution.mean_stress, ROOT_STRESS)
        left.set_title(_titled(title, solution.mean_stress))
        differences = _field(
            right, solution, difference, 0.1 * ROOT_STRESS, name="difference from the closed form"
        )
        relative = 100 * np.linalg.norm(difference) / np.linalg.norm(exact)
        right.set_title(f"{title}: minus closed form   (L2 {relative:.2g} %)")
        left.set_ylabel("$y$ [m]")
        column = x == x[np.argmin(np.abs(x - L / 4))]
        profile.plot(
            solution.mean_stress[column] / 1e3, y[column], ".-", linewidth=0.8, label=title
        )
    _field(closed, solution, exact, ROOT_STRESS)
    closed.set_title(_titled("closed form", exact))
    closed.set_ylabel("$y$ [m]")
    profile.plot(exact[column] / 1e3, y[column], "k:", linewidth=1.5, label="closed form")
    profile.set_title(f"along the particles at $x$ = {x[column][0]:.3g} m")
    profile.set_xlabel("mean stress [kPa]")
    profile.set_ylabel("$y$ [m]")
    profile.legend()
    profile.grid()
    for axes in panels[-1]:
        axes.set_xlabel("$x$ [m]")
    add_bar(fields, panels[:, 0])
    add_bar(differences, panels[1:, 1])
    save(figure, path)


def _titled(title: str, values: Values) -> str:
    return f"{title}   (largest |mean stress| {np.abs(values).max() / 1e3:.3g} kPa)"


def _field(
    axes: Axes, solution: tawami.Solution, values: Values, scale: float, **name: str
) -> Squares:
    """Draw the particles, coloured from -scale to scale [Pa]."""
    side, limits = np.sqrt(solution.volume), (-scale, scale)
    squares = draw_particles(axes, solution.x, side, values, "Pa", limits, **name)
    axes.set_xlim(-0.02, L + 0.02)
    axes.set_ylim(-D / 2 - 0.02, D / 2 + 0.02)
    return squares
