"""A map of stability and accuracy over form, nu and alpha, for the cantilever with support 'exact'."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

import tawami
from cases.common.figure import save
from cases.verification.cantilever import beam, mpm
from tawami.picture import style

#: Columns of the figure: title, form, and its options.
FORMS: dict[str, tuple[str, dict[str, str]]] = {
    "u": ("u", {}),
    "u_bbar": ("u_bbar", {}),
    "u_epsv\nlaplacian": ("u_epsv", {"stabilisation": "laplacian"}),
    "u_epsv\nresidual_based": ("u_epsv", {"stabilisation": "residual_based"}),
    "u_epsv\nprojection": ("u_epsv", {"stabilisation": "projection"}),
    "u_p": ("u_p", {}),
}
COMPRESSIBILITY = (1.0, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 0.0)  # 1 - 2 nu
ALPHAS = (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0)
#: Rows of the figure: attribute, title, limits of the colours.
ROWS = (
    ("stress", "mean stress: relative L2 error [-]", (1e-3, 1e1)),
    ("deflection", "deflection: relative error [-]", (1e-3, 1e1)),
    ("condition", "condition number, scaled [-]", (1e2, 1e14)),
)
N = 8  # cells over the height


@dataclass(frozen=True)
class Point:
    """One computation: NaN if it was rejected, alpha None if the form has none."""

    form: str
    one_minus_2nu: float
    alpha: float | None
    stress: float
    deflection: float
    condition: float


def point(name: str, one_minus_2nu: float, alpha: float | None) -> Point:
    """Compute the errors against the closed form, and the condition number."""
    form, options = FORMS[name]
    nu = (1 - one_minus_2nu) / 2
    given: dict[str, Any] = dict(options) if alpha is None else {**options, "alpha": alpha}
    try:
        law = tawami.linear_elastic(E=beam.E, one_minus_2nu=one_minus_2nu)
        solution = mpm.build(form, "exact", N, material=law, nu=nu, **given).solve()
    except tawami.TawamiError:
        return Point(name, one_minus_2nu, alpha, np.nan, np.nan, np.nan)
    error = abs(-solution.displacement((beam.L, 0.0))[1] / beam.deflection(nu) - 1)
    stress = mpm.mean_stress_error(solution, nu)
    return Point(name, one_minus_2nu, alpha, stress, error, solution.condition)


def points(short: bool) -> list[Point]:
    """Compute the whole map, or every third point in each direction."""
    with warnings.catch_warnings():  # the map shows these errors
        warnings.simplefilter("ignore", tawami.LockingWarning)
        warnings.simplefilter("ignore", tawami.ParameterWarning)
        return _points(short)


def _points(short: bool) -> list[Point]:
    step = 3 if short else 1
    found = []
    for name, (form, _) in FORMS.items():
        alphas: Sequence[float | None] = ALPHAS[::step] if form in ("u_epsv", "u_p") else (None,)
        found += [point(name, c, alpha) for c in COMPRESSIBILITY[::step] for alpha in alphas]
    return found


def draw(found: Sequence[Point], path: Path) -> None:
    """Draw the map: one row of panels per quantity, one column per form, hatched where rejected."""
    figure, panels = plt.subplots(
        len(ROWS), len(FORMS), figsize=(15, 10), layout="constrained",
        gridspec_kw={"width_ratios": [0.35, 0.35, 1, 1, 1, 1]},
    )  # fmt: skip
    for row, (attribute, title, limits) in zip(panels, ROWS, strict=True):
        for axes, name in zip(row, FORMS, strict=True):
            mine = [p for p in found if p.form == name]
            image = _panel(axes, mine, attribute, limits)
        figure.colorbar(image, ax=list(row), label=title, extend="both", pad=0.01)
    for axes, name in zip(panels[0], FORMS, strict=True):
        axes.set_title(name)
    for row in panels:
        row[0].set_ylabel(r"$1 - 2\nu$ [-]")
    figure.suptitle(
        f"Cantilever, {2 * N} x {N} cells, 2 x 2 particles, support 'exact': errors against the closed "
        "form and condition; hatched: rejected with an error message"
    )
    save(figure, path)


def _panel(axes: Any, mine: Sequence[Point], attribute: str, limits: tuple[float, float]) -> Any:
    """Draw a panel: 1 - 2 nu downwards over alpha."""
    rows = list(dict.fromkeys(p.one_minus_2nu for p in mine))
    columns = list(dict.fromkeys(p.alpha for p in mine))
    values = np.array([getattr(p, attribute) for p in mine]).reshape(len(rows), len(columns))
    image = axes.imshow(
        values, norm=LogNorm(*limits), aspect="auto", cmap=style.MAGNITUDE, interpolation="nearest"
    )
    for i, j in np.argwhere(np.isnan(values)):
        box = plt.Rectangle((j - 0.5, i - 0.5), 1, 1, facecolor="0.9", edgecolor="0.5", hatch="///")
        axes.add_patch(box)
    for i, j in np.argwhere(~np.isnan(values)):
        dark = values[i, j] < np.sqrt(limits[0] * limits[1])
        digit, power = f"{values[i, j]:.0e}".split("e")
        look = {"ha": "center", "va": "center", "fontsize": 6, "color": "w" if dark else "k"}
        axes.text(j, i, f"{digit}e{int(power)}", **look)
    axes.set_yticks(
        range(len(rows)), [f"{c:g}" if c else r"0 ($\nu = 0.5$)" for c in rows], fontsize=7
    )
    labels = ["-" if a is None else f"{a:g}" for a in columns]
    axes.set_xticks(range(len(columns)), labels, fontsize=7)
    axes.set_xlabel(r"$\alpha$ [-]" if columns[0] is not None else r"no $\alpha$")
    return image
