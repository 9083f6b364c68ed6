"""Estimated errors compared with true ones: cantilever, Cook's membrane, ring.

`solution.error(goal)` estimates the error of a quantity without a reference. The effectivity
index is the estimate over the true error:

cantilever   exact support, tip deflection; closed form (Timoshenko and Goodier)
clamped      tip deflection of the clamped beam; limit by refinement
paper        support of the paper, whose deflection has no limit: the order shows it
Cook         deflection at the middle of the right end; finite elements
ring         displacement at r = 1.5 m, mean stress of a part; closed form (Lame)

python -m cases.verification.effectivity
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, nan, sin
from time import perf_counter

import numpy as np

import tawami
from cases.common.figure import save
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from cases.verification import ring
from cases.verification.cantilever import beam
from cases.verification.cantilever import mpm as cantilever
from cases.verification.cook import mpm as cook
from cases.verification.cook.membrane import MIDDLE, REFERENCE

NU = 0.4999
TIP = tawami.Goal.displacement((beam.L, 0.0), "y")
AT, ANGLE = 1.5, 0.6  # where the ring moves outwards [m], [rad]
RATIO = ring.P * ring.A**2 / (ring.B**2 - ring.A**2)
COLUMNS = (
    "scene", "value", "true", "estimate", "effectivity", "grid", "particles", "stabilisation", "newton",
    "order", "solve_s", "estimate_s",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One estimate; errors are exact minus computed values, in the unit of the quantity.

    Attributes:
        scene: Scene and setting.
        value: Computed value.
        true: Its true error; None if there is no limit.
        estimate: Its estimated error.
        grid, particles, stabilisation, newton: Parts of the estimate.
        order: Observed order of the part of the grid.
        solve_s, estimate_s: Time of the solve and of the estimate [s].
    """

    scene: str
    value: float
    true: float | None
    estimate: float
    grid: float
    particles: float
    stabilisation: float
    newton: float
    order: float
    solve_s: float
    estimate_s: float

    @property
    def effectivity(self) -> float | None:
        """Estimated over true error."""
        return None if self.true is None else self.estimate / self.true


def estimated(
    name: str, scene: tawami.Scene, goal: tawami.Goal, exact: float = nan
) -> tuple[Row, tawami.ErrorEstimate]:
    """Solve a scene and estimate the error of a quantity, whose exact value is known or NaN."""
    start = perf_counter()
    solution = scene.solve()
    middle = perf_counter()
    found = solution.error(goal)
    end = perf_counter()
    true = None if np.isnan(exact) else exact - found.value
    row = Row(
        name, found.value, true, found.error, *found.parts.values(), found.order, middle - start,
        end - middle,
    )  # fmt: skip
    return row, found


def on_cantilever(form: str, n: int, support: str = "exact", **options: object):
    """The cantilever with 2 x 2 particles in each cell by default."""
    exact = {"exact": -beam.V_THEORY, "clamped": -beam.V_CLAMPED}.get(support, nan)
    particles = " ".join(f"{name}={value}" for name, value in options.items())
    name = f"cantilever {support} {form} n={n} {particles}".strip()
    return estimated(name, cantilever.build(form, support, n, **options), TIP, exact)


def on_cook(h: float, body: str = "even"):
    """Cook's membrane with the default form."""
    goal = tawami.Goal.displacement(MIDDLE, "y")
    scene = cook.scene_of(NU, h, body, form="u_epsv")
    return estimated(f"Cook h={h:g} {body}", scene, goal, REFERENCE[NU])


def outward() -> float:
    """Displacement of the ring at the radius AT (Lame)."""
    return RATIO * (1 + ring.NU) / ring.E * ((1 - 2 * ring.NU) * AT + ring.B**2 / AT)


def on_ring(n: int, quantity: str):
    """The ring under pressure, in cut cells.

    The volumes are those of the particles. With the default, parts of opposite signs cancel: at n = 4
    the error of u is 1/30 of its parts.
    """
    law = tawami.linear_elastic(E=ring.E, nu=ring.NU)
    scene, _, _ = ring.build(n, ring.B + 2 / n, (0.0, 0.0), law, gauss=False, volumes="own")
    scene.pressure("inner", ring.P)
    if quantity == "u":
        goal = tawami.Goal.displacement((AT * cos(ANGLE), AT * sin(ANGLE)), "x")
        exact = outward() * cos(ANGLE)
    else:
        goal = tawami.Goal.mean_stress(lambda x, y: (x > 0) & (y > 0) & (x**2 + y**2 < AT**2))
        exact = 2 / 3 * (1 + ring.NU) * RATIO
    return estimated(f"ring n={n} {quantity}", scene, goal, exact)


def on_shifted_ring(n: int, shift: float):
    """The ring with the default volumes, its middle at x = shift h: u in the middle of its wall."""
    law = tawami.linear_elastic(E=ring.E, nu=ring.NU)
    scene, _, _ = ring.build(n, ring.B + 2 / n, (shift, 0.0), law, gauss=False)
    scene.pressure("inner", ring.P)
    goal = tawami.Goal.displacement((AT + shift / n, 0.0), "x")
    return estimated(f"ring n={n} shifted by {shift:g} h", scene, goal, outward())


def runs() -> Iterator[Callable[[], tuple[Row, tawami.ErrorEstimate]]]:
    """All estimates of the table."""
    for n in (4, 8, 16, 32):
        yield lambda n=n: on_cantilever("u_epsv", n)
    yield lambda: on_cantilever("u_epsv", 8, per_axis=3)
    yield lambda: on_cantilever("u_epsv", 8, per_axis=3, gauss=True)
    for form in ("u_p", "u_bbar"):
        yield lambda form=form: on_cantilever(form, 8)
    for support in ("clamped", "paper"):
        for n in (8, 16):
            yield lambda n=n, support=support: on_cantilever("u_epsv", n, support)
    for body in ("even", "gauss"):
        for h in (4.0, 2.0, 1.0):
            yield lambda h=h, body=body: on_cook(h, body)
    for n in (4, 8):
        for quantity in ("u", "mean stress"):
            yield lambda n=n, quantity=quantity: on_ring(n, quantity)
    for n in (4, 8, 16):
        for shift in (0.37, 0.71):
            yield lambda n=n, shift=shift: on_shifted_ring(n, shift)


PROGRAM = Program("cases.verification.effectivity", __doc__)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table of effectivity indices and draw the errors of one membrane."""
    PROGRAM.start(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tawami.QuadratureWarning)
        rows = [run()[0] for run in runs()]
        found = on_cook(2.0)[1]
    print(as_text(rows, COLUMNS))
    known = [row.effectivity for row in rows if row.effectivity is not None]
    times = [row.estimate_s / row.solve_s for row in rows]
    inside = sum(0.7 <= one <= 1.4 for one in known)
    print(
        f"\neffectivity within 0.7 to 1.4 in {inside} of {len(known)} estimates with a known error"
    )
    print(f"time of an estimate over that of the solve: median {np.median(times):.1f}")
    PROGRAM.write("effectivity.csv", as_csv(rows, COLUMNS))
    save(found.plot().get_figure(root=True), PROGRAM.folder / "error.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
