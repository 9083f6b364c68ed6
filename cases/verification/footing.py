"""The bearing capacity of a rigid, rough strip footing on weightless clay.

    axis        b = 1 m
     |=============|                       one half; width B = 2 b, the ground 4 m x 2 m, plane strain
     o                               o     left and right edge smooth, bottom held
     o            clay               o     s_u = 1 kPa, mu = 667 s_u, nu = 0.495 to 0.4999
     o_______________________________o     von Mises (sigma_y = sqrt(3) s_u) or Tresca

Prandtl 1920 (Z. angew. Math. Mech. 1, 15): under the displacement w of the footing the force grows to

    Q = (2 + pi) s_u B.

This is exact for both laws: in plane strain both flow at the shear stress s_u. Plastic flow preserves
the volume. A method that cannot represent it locks: its force grows without limit.

The footing is a part of the border of the ground, x < b, moved down in adaptive steps. The support holds
means of the displacement over patches of this part, about as long as a cell, so that the footing is as
wide as it should be: with Tresca and 2, 4 and 8 cells over b, Q is 4.3, 3.0 and 1.6 % above Prandtl's.

Points held (`scene.hold`) at both ends and at the centres of the cells are as many as there are
functions under the footing. The last function moves the ground next to the footing by up to half as
much. Such a footing acts wider than it is, by a fraction of h: 33, 17 and 8.8 %. The centres alone leave
this function free: the edge of the footing settles less, and Q converges from below.

python -m cases.verification.footing
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

import tawami
from cases.common.figure import COLOURS, save
from cases.common.ground import ground
from cases.common.program import Program, progress
from cases.common.table import as_csv, as_text
from tawami.picture import style

Array = npt.NDArray[np.float64]

B_HALF, WIDTH, DEPTH = 1.0, 4, 2  # of footing and ground [m]
S_U, RIGIDITY = 1.0e3, 667.0  # undrained strength [Pa], mu/s_u [-]
SETTLEMENT = 12.0  # of the footing at the end, in units of s_u b/mu
PRANDTL = 2 + np.pi  # Q / (s_u B)
Law = Literal["von_mises", "tresca"]
Footing = Literal["rough", "smooth", "centres", "greville"]
#: Runs of the study: differences from u_epsv, von Mises, nu = 0.499, splines, rough.
STUDY: dict[str, list[dict[str, Any]]] = {
    "cells": [{"form": form, "n": n} for form in ("u_epsv", "u_bbar", "u") for n in (2, 4, 8)]
    + [{"form": "u_epsv", "n": 16}],
    "nu": [
        {"form": form, "nu": nu, "n": 4}
        for form in ("u_epsv", "u_bbar", "u")
        for nu in (0.495, 0.4999)
    ],
    "tresca": [{"form": form, "law": "tresca", "n": n}
               for form in ("u_epsv", "u_bbar", "u") for n in (4, 8)],
    "tresca, u_epsv": [{"law": "tresca", "footing": footing, "n": n}
                       for footing in ("rough", "smooth") for n in (2, 4, 8)],
    "bilinear": [{"form": form, "basis": "bilinear", "n": n}
                 for form in ("u_epsv", "u_bbar", "u") for n in (4, 8)],
    "footing": [{"footing": footing, "n": n}
                for footing in ("smooth", "centres", "greville") for n in (4, 8)],
    "alpha": [{"alpha": alpha, "n": 4} for alpha in (0.01, 0.5)],
    "particles": [{"per_axis": 3, "n": 4}],
}  # fmt: skip
FORMS = {"u_epsv": "mixed $u$-$\\varepsilon_v$", "u_bbar": "B-bar", "u": "displacement only"}
DASHES = {2: ":", 4: "--", 8: "-", 16: "-."}


@dataclass
class Run:
    """A run and its records, at the start and after every step.

    Attributes:
        form: Weak form.
        law: Material.
        basis: Basis of u.
        footing: Kind of prescribed settlement.
        n: Cells over half the footing's width.
        nu: Poisson's ratio.
        alpha: Stabilisation.
        per_axis: Particles per cell and axis.
        settlement: Settlement of the footing, in units of s_u b/mu.
        q: Force of the footing over s_u B.
        iterations: Newton iterations of each step.
        uneven: Difference of the largest and smallest settlement under the footing, as a share.
        seconds: Wall time.
        x, plastic: Positions [m] and plastic strain of the particles at the end.
        stopped: Reason why the run ended early; empty if it did not.
    """

    form: str
    law: Law
    basis: str
    footing: Footing
    n: int
    nu: float
    alpha: float
    per_axis: int
    settlement: list[float] = field(default_factory=lambda: [0.0])
    q: list[float] = field(default_factory=lambda: [0.0])
    iterations: list[int] = field(default_factory=list)
    uneven: float = np.nan
    seconds: float = 0.0
    x: Array = field(default_factory=lambda: np.empty((0, 2)))
    plastic: Array = field(default_factory=lambda: np.empty(0))
    stopped: str = ""

    @property
    def steps(self) -> int:
        """Number of accepted steps."""
        return len(self.iterations)

    @property
    def mean_iterations(self) -> float:
        """Newton iterations, mean over the steps."""
        return float(np.mean(self.iterations))

    @property
    def last(self) -> float:
        """Force at the end, over s_u B."""
        return self.q[-1]

    @property
    def error(self) -> float:
        """Error of the force at the end against Prandtl's [%]."""
        return 100 * (self.q[-1] / PRANDTL - 1)

    @property
    def growth(self) -> float:
        """Growth of the force over the last quarter of the settlement [%]."""
        before = np.interp(0.75 * self.settlement[-1], self.settlement, self.q)
        return float(100 * (self.q[-1] / before - 1))


COLUMNS = (
    "form", "law", "basis", "footing", "n", "nu", "alpha", "per_axis", "last", "error", "growth",
    "uneven", "steps", "mean_iterations", "seconds", "stopped",
)  # fmt: skip


def under_footing(x: Array, y: Array) -> npt.NDArray[np.bool_]:
    """Whether points of the border are under the footing."""
    return (y == 0) & (x < B_HALF)


def held_points(footing: Footing, n: int) -> Array:
    """Positions [m] of the points held under the footing; none if it is a part of the border."""
    h = B_HALF / n
    centres = (np.arange(n) + 0.5) * h
    positions = {
        "centres": centres,
        "greville": np.concatenate([[0.0], centres, [B_HALF]]),
    }
    return positions.get(footing, np.empty(0))


def clay(law: Law = "tresca", nu: float = 0.499) -> Any:
    """The clay."""
    elastic = tawami.linear_elastic(E=2 * RIGIDITY * S_U * (1 + nu), nu=nu)
    if law == "von_mises":
        return tawami.von_mises(elastic, yield_stress=np.sqrt(3) * S_U)
    return tawami.mohr_coulomb(elastic, phi=0.0, c=S_U)


def build(run: Run, settlement: float = SETTLEMENT) -> tawami.Scene:
    """The ground, with the settlement of the footing [s_u b/mu] as the next displacement to apply."""
    parameters = {"alpha": run.alpha} if run.form == "u_epsv" else {}
    scene = ground(
        B_HALF / run.n, (0.0, WIDTH), DEPTH, clay(run.law, run.nu),
        per_axis=run.per_axis, form=run.form, basis=run.basis, **parameters,
    )  # fmt: skip
    down = -settlement * B_HALF / RIGIDITY
    if run.footing in ("rough", "smooth"):
        scene.fix(under_footing, "y", down)
    if run.footing == "rough":
        scene.fix(under_footing, "x")
    for x in held_points(run.footing, run.n):
        if x > 0:  # the left edge holds the axis
            scene.hold((x, 0.0), "x")
        scene.hold((x, 0.0), "y", down)
    return scene


def solve(
    form: str = "u_epsv",
    *,
    n: int = 4,
    law: Law = "von_mises",
    nu: float = 0.499,
    basis: str = "quadratic_spline",
    footing: Footing = "rough",
    alpha: float = 0.1,
    per_axis: int = 2,
    step: float = 0.04,
) -> Run:
    """Press the footing down, in steps of at most the share `step` of the settlement."""
    begin = perf_counter()
    run = Run(form, law, basis, footing, n, nu, alpha, per_axis)
    scene = build(run)
    points = held_points(footing, n)

    def record(solution: tawami.Solution) -> None:
        forces = [solution.reaction((x, 0.0))[1] for x in points]
        force = sum(forces) if len(points) else solution.reaction("top")[1]
        run.q.append(-force / (S_U * B_HALF))  # the force of half the footing over half its width
        run.settlement.append(-solution.displacement((0.0, 0.0))[1] * RIGIDITY / B_HALF)
        run.iterations.append(solution.iterations)
        under = [solution.displacement((x, 0.0))[1] for x in np.linspace(0, B_HALF, 8 * n + 1)]
        run.uneven = float(np.ptp(under) / np.abs(under).max())

    try:
        tawami.ramp(scene, step, each=record, stop="raise")
    except (tawami.ConvergenceError, tawami.SingularError, tawami.SupportError) as error:
        run.stopped = getattr(error, "__notes__", [f"{error}"])[0]
    run.x = np.array(scene.particles.x)
    run.plastic = np.array(scene.particles.history("plastic_strain"))
    run.seconds = perf_counter() - begin
    return run


def curves(runs: dict[str, list[Run]], path: Path) -> None:
    """Draw the force over the settlement for forms and cells, Poisson's ratios, laws and bases."""
    figure, panels = plt.subplots(2, 2, figsize=(12, 9), layout="constrained", sharex=True)
    titles = {
        "cells": "von Mises, splines, $\\nu$ = 0.499",
        "nu": "von Mises, splines, 4 cells",
        "tresca": "Tresca, splines, $\\nu$ = 0.499",
        "bilinear": "von Mises, bilinear, $\\nu$ = 0.499",
    }
    for axes, (name, title) in zip(panels.ravel(), titles.items(), strict=True):
        for run in runs[name]:
            dashes = {0.495: "-", 0.4999: ":"}[run.nu] if name == "nu" else DASHES[run.n]
            what = f"$\\nu$ = {run.nu}" if name == "nu" else f"{run.n} cells"
            axes.plot(
                run.settlement, run.q, dashes, color=COLOURS[run.form],
                label=f"{FORMS[run.form]}, {what}",
            )  # fmt: skip
        axes.axhline(PRANDTL, color="k", linewidth=0.8, label="$2 + \\pi$")
        axes.set_ylim(0, 12)
        axes.set_title(title)
        axes.set_xlabel("settlement $w \\mu / (s_u b)$ [-]")
        axes.set_ylabel("$Q / (s_u B)$ [-]")
        axes.grid()
        axes.legend(loc="lower right", ncols=2)
    save(figure, path)


def zones(runs: Sequence[Run], path: Path) -> None:
    """Draw the plastic strain at the particles, one panel per run."""
    figure, panels = plt.subplots(
        len(runs), 1, figsize=(8, 4.1 * len(runs)), layout="constrained", squeeze=False
    )
    for axes, run in zip(panels.ravel(), runs, strict=True):
        times = run.plastic * RIGIDITY / SETTLEMENT
        shown = axes.scatter(
            *run.x.T, c=times, s=64 / run.n, cmap=style.FROM_ZERO, vmin=0, vmax=1.5
        )
        axes.plot([0, B_HALF], [0.02, 0.02], "k", linewidth=4, label="footing")
        axes.plot(*prandtl().T, color=style.BLUE, label="Prandtl's lines")
        axes.set_aspect("equal")
        axes.set_title(f"{FORMS[run.form]}, $\\nu$ = {run.nu}, {run.n} cells")
        axes.set_xlabel("$x$ [m]")
        axes.set_ylabel("$y$ [m]")
        axes.legend(loc="lower right")
        figure.colorbar(shown, ax=axes, label="plastic strain $\\times\\, b / w$ [-]")
    save(figure, path)


def prandtl() -> Array:
    """Border of Prandtl's mechanism under the right half: active wedge, fan, passive wedge [m]."""
    radius = np.sqrt(2) * B_HALF
    turn = np.linspace(-0.75 * np.pi, -0.25 * np.pi, 50)
    fan = np.column_stack([B_HALF + radius * np.cos(turn), radius * np.sin(turn)])
    return np.vstack([[0.0, -B_HALF], fan, [3 * B_HALF, 0.0]])


PROGRAM = Program("cases.verification.footing", __doc__)
PROGRAM.option("--cells", type=int, default=16, help="most cells over half the footing")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study, print the table, draw the figures."""
    options = PROGRAM.start(arguments)
    print(f"Prandtl: Q/(s_u B) = 2 + pi = {PRANDTL:.4f}")
    work = [(name, c) for name in STUDY for c in STUDY[name] if c["n"] <= options.cells]
    runs: dict[str, list[Run]] = {name: [] for name in STUDY}
    for name, change in progress(work, desc="footing"):
        runs[name].append(solve(**change))
    rows = [run for name in STUDY for run in runs[name]]
    print(as_text(rows, COLUMNS))
    PROGRAM.write("table.csv", as_csv(rows, COLUMNS))
    curves(runs, PROGRAM.folder / "curves.png")
    finest = [max((r for r in runs["cells"] if r.form == form and r.n <= 8), key=lambda r: r.n)
              for form in ("u_epsv", "u")]  # fmt: skip
    zones(finest, PROGRAM.folder / "zones.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
