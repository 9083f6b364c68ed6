"""Error estimates of `tawami.trade`, compared with scenes that have closed forms.

A setting is covered if its true error is within its error bar. The bar is at most three times too wide
if the bound of the error is at most three times the true error. The paper's support and a footing with a
load that is 1 % above Prandtl's have no limit.

python -m cases.costs.trade.coverage [NAME ...]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tawami
from cases.common.program import Program
from cases.common.table import as_text
from cases.verification import consolidation, footing, ring, self_weight
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import V_THEORY, L
from cases.verification.cook import membrane
from cases.verification.cook import mpm as cook

#: A quantity that is evaluated after the time of a run has been taken.
Estimate = Callable[[], tawami.ErrorEstimate]
#: Part of the value below which a bar is not too wide: round-off and the tolerance of Newton's method.
LEAST = 1e-7
#: Middle of the wall of the ring [m].
MIDDLE = (ring.A + ring.B) / 2


def error_of(solution: tawami.Solution, point: tuple[float, float], component: str) -> Estimate:
    """A displacement with its estimated error, which the time of a run does not include."""
    return lambda: solution.error(tawami.Goal.displacement(point, component))


def tip(support: str, n: int, particles: int, alpha: float) -> dict[str, Estimate]:
    """Displacement of the tip of the cantilever."""
    solution = mpm.build("u_epsv", support, n, per_axis=particles, alpha=alpha).solve()
    return {"tip": error_of(solution, (L, 0.0), "y")}


def beam(
    n: Annotated[int, (4, 8, 16, 32)] = 16,
    particles: Annotated[int, (2, 3, 4)] = 3,
    alpha: Annotated[float, (0.1, 0.03, 0.01)] = 0.01,
) -> dict[str, Estimate]:
    """Beam with the exact tractions at its root."""
    return tip("exact", n, particles, alpha)


def paper(
    n: Annotated[int, (4, 8, 16, 32)] = 16,
    particles: Annotated[int, (2, 3)] = 3,
    alpha: Annotated[float, (0.1, 0.03, 0.01)] = 0.01,
) -> dict[str, Estimate]:
    """Beam held at one point of its root."""
    return tip("paper", n, particles, alpha)


def column(
    h: Annotated[float, (5.0, 2.5, 1.25, 0.625)] = 1.25,
    increments: Annotated[int, (5, 10, 20)] = 10,
) -> dict[str, float]:
    """Column that shrinks under its own weight."""
    return {"height": self_weight.solve("u_finite", h=h, increments=increments).height}


def widened(
    n: Annotated[int, (4, 6, 8, 12, 16)] = 8,
    shift: Annotated[float, {0.0, 0.37, 0.71}] = 0.0,
) -> dict[str, Estimate]:
    """Ring under pressure inside, shifted over the grid: displacement in the middle of its wall."""
    law = tawami.linear_elastic(E=ring.E, nu=ring.NU)
    place = (shift, 0.0)
    scene, _, _ = ring.build(n, ring.B + 2 / n, place, law, False)
    scene.pressure("inner", ring.P)
    return {"u": error_of(scene.solve(), (MIDDLE + shift / n, 0.0), "x")}


def widening() -> float:
    """Exact radial displacement in the middle of the wall (Lamé)."""
    a, b, nu = ring.A, ring.B, ring.NU
    factor = ring.P * a**2 * (1 + nu) / (ring.E * (b**2 - a**2))
    return factor * ((1 - 2 * nu) * MIDDLE + b**2 / MIDDLE)


def membrane_of_cook(
    h: Annotated[float, (4.0, 2.0, 1.0, 0.5)] = 1.0,
    body: Annotated[str, ("gauss", "even")] = "gauss",
) -> dict[str, Estimate]:
    """Cook's membrane, nu = 0.4999."""
    scene = cook.scene_of(0.4999, h, body, form="u_epsv", alpha=0.01)
    return {"deflection": error_of(scene.solve(), membrane.MIDDLE, "y")}


def soil(
    n: Annotated[int, (4, 8, 16, 32)] = 16,
    growth: Annotated[float, (0.16, 0.08, 0.04, 0.02)] = 0.08,
) -> dict[str, float]:
    """Terzaghi's column: degree of consolidation at T_v = 0.1."""
    run = consolidation.terzaghi(n, 2.5e-3 * growth, 0.1, growth, growth / 4)
    return {"U": run.value[-1]}


def sinking(n: Annotated[int, (2, 4, 8, 16)] = 4) -> dict[str, float]:
    """Settlement under a pressure 1 % above Prandtl's."""
    scene = footing.build(
        footing.Run("u_epsv", "von_mises", "quadratic_spline", "none", n, 0.49, 0.1, 2)
    )
    scene.traction(footing.under_footing, (0.0, -1.01 * footing.PRANDTL * footing.S_U))
    solutions: list[tawami.Solution] = []
    tawami.ramp(scene, 0.1, each=solutions.append, stop="raise")
    return {"settlement": -float(solutions[-1].displacement((0.0, 0.0))[1])}


#: Function, its exact value; None without a limit.
SCENES: Mapping[str, tuple[Callable[..., Any], float | None]] = {
    "beam": (beam, -V_THEORY),
    "column": (column, self_weight.final_height()),
    "ring": (widened, widening()),
    "cook": (membrane_of_cook, membrane.REFERENCE[0.4999]),
    "terzaghi": (soil, consolidation.degree(0.1)),
    "paper": (paper, None),
    "footing": (sinking, None),
}


@dataclass(frozen=True)
class Row:
    """Bars of a scene.

    Attributes:
        scene: Its name.
        limit: Estimate of the limit.
        uncertainty: Its uncertainty; infinite if the trade finds no limit.
        exact: Exact value; None if there is none.
        settings: Number of settings.
        covered: Settings of which the true error is within the bar.
        narrow: Settings of which the bar is at most three times too wide.
        recommended: True error of the recommended setting [%].
    """

    scene: str
    limit: float
    uncertainty: float
    exact: float | None
    settings: int
    covered: int | None = None
    narrow: int | None = None
    recommended: float | None = None


COLUMNS = (
    "scene", "limit", "uncertainty", "exact", "settings", "covered", "narrow", "recommended",
)  # fmt: skip


def judged(name: str, trade: tawami.Trade, exact: float | None) -> Row:
    """Compare a trade with the exact value."""
    ((quantity, estimate),) = trade.estimates.items()
    runs = trade.succeeded
    row = (name, estimate.value, estimate.uncertainty, exact, len(runs))
    if exact is None or not estimate.exists:
        return Row(*row)
    covered, narrow = 0, 0
    for run in runs:
        true = abs(run.values[quantity] - exact) / estimate.scale
        covered += abs(true - run.error) <= run.uncertainties[quantity] + LEAST
        narrow += run.bound <= 3 * true + LEAST
    chosen = next((run for run in trade.front() if run.bound <= trade.tolerance), None)
    error = None if chosen is None else 100 * abs(chosen.values[quantity] / exact - 1)
    return Row(*row, covered, narrow, error)


PROGRAM = Program("cases.costs.trade.coverage", __doc__, files=False)
PROGRAM.option("scenes", nargs="*", help=f"among {', '.join(SCENES)}; all by default")
PROGRAM.option("--results", default="results/trade", help="folder of the results")
PROGRAM.option("--budget", type=float, default=60.0, help="time of each scene [s]")
PROGRAM.option(
    "--tolerance", type=float, default=0.01, help="relative error of the recommended setting"
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the trades and print the table."""
    options = PROGRAM.start(arguments)
    rows = []
    for name in options.scenes or SCENES:
        if name not in SCENES:
            PROGRAM.error(f"scene {name}: expected one of {', '.join(SCENES)}")
        function, exact = SCENES[name]
        folder = Path(options.results) / f"coverage_{name}"
        try:
            trade = tawami.trade(
                function,
                budget=options.budget,
                tolerance=options.tolerance,
                folder=folder,
                quiet=True,
            )
        except tawami.InputError as error:  # every run failed
            print(f"# {name}\n{error}\n")
            rows.append(Row(name, math.nan, math.inf, exact, 0))
            continue
        print(f"# {name}\n{trade}\n")
        rows.append(judged(name, trade, exact))
    print(as_text(rows, COLUMNS))


if __name__ == "__main__":
    PROGRAM.run(main)
