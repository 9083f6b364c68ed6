"""Consolidation of saturated soil at small strain: Terzaghi's column and Mandel's slab.

         load q, drained                              rigid plate, force 2 F, smooth
     o | | | | | | | o                        ____________________________
     o               o                        |                          |
     o               o  H = 1 m     drained   |            .             |  drained    2 b
     o               o                        |__________________________|
     o---------------o                               2 a, plate
         tight                                one quarter: a = 1 m, b = 0.5 m

E = 1 MPa, kappa = 1e-12 m2, mu_w = 1e-3 Pa s; water and grains do not change their volume.

Terzaghi 1925: with T_v = c_v t/H^2, c_v = kappa M/mu_w, M = K + 4 mu/3 and m_k = (2 k + 1) pi/2,

    U(T_v) = 1 - sum_k 2/m_k^2 exp(-m_k^2 T_v),    p/q = sum_k 2/m_k sin(m_k (1 - z/H)) exp(-m_k^2 T_v).

Mandel 1953 (Geotechnique 3, 287): the drained sides shrink first and shift the load to the middle, where
the pressure rises before it falls. With the roots of tan(a_i)/a_i = 2 (1 - nu)/(1 - 2 nu)

    p = F/a sum_i sin a_i (cos(a_i x/a) - cos a_i)/(a_i - sin a_i cos a_i) exp(-a_i^2 c_v t/a^2).

The plate follows the analytic settlement, so that its force is a result.

python -m cases.verification.consolidation
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.optimize import brentq

import tawami
from cases.common.figure import save
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from tawami.picture import style

Array = npt.NDArray[np.float64]

H, A, B = 1.0, 1.0, 0.5  # height of the column, half width and half height of the slab [m]
E, LOAD = 1.0e6, 1.0e3  # Young's modulus, load of the column and mean load of the slab [Pa]
KAPPA, MU_W = 1.0e-12, 1.0e-3  # permeability [m2], viscosity of the water [Pa s]
NU_COLUMN, NU_SLAB = 0.3, 0.2
SHOWN = (0.1, 0.5, 1.0)  # T_v of the table
PROFILES = (0.01, 0.1, 0.3, 0.5, 1.0)  # T_v of the profiles


def lame(nu: float) -> tuple[float, float]:
    """Shear modulus, and modulus M of uniaxial strain [Pa]."""
    mu = E / (2 * (1 + nu))
    return mu, 2 * mu * (1 - nu) / (1 - 2 * nu)


def c_v(nu: float) -> float:
    """Coefficient of consolidation [m2/s]."""
    return KAPPA / MU_W * lame(nu)[1]


def degree(T: float) -> float:
    """Terzaghi's degree of consolidation U."""
    m = (np.arange(2000) + 0.5) * np.pi
    return float(1 - np.sum(2 / m**2 * np.exp(-(m**2) * T)))


def pressure(T: float, z: Array) -> Array:
    """Terzaghi's pore pressure over the load at heights z [m]."""
    m = (np.arange(2000) + 0.5)[:, None] * np.pi
    series = 2 / m * np.sin(m * (1 - z / H)) * np.exp(-(m**2) * T)
    return np.asarray(series.sum(axis=0))


def roots(nu: float = NU_SLAB, count: int = 200) -> Array:
    """The first positive roots of tan(a)/a = 2 (1 - nu)/(1 - 2 nu)."""
    slope = 2 * (1 - nu) / (1 - 2 * nu)

    def f(a: float) -> float:
        return float(np.sin(a) - slope * a * np.cos(a))

    ends = [(k * np.pi + 1e-9, (k + 0.5) * np.pi) for k in range(count)]
    return np.array([brentq(f, max(low, 1e-3), high, xtol=1e-14) for low, high in ends])


def mandel_pressure(T: float, x: Array | float) -> Array:
    """Mandel's pore pressure over F/a at x [m]."""
    a = roots()[:, None]
    share = np.sin(a) / (a - np.sin(a) * np.cos(a))
    modes = np.cos(a * np.atleast_1d(x) / A) - np.cos(a)
    return np.asarray((share * modes * np.exp(-(a**2) * T)).sum(axis=0))


def mandel_settlement(T: float) -> float:
    """Settlement of the plate of the quarter [m]."""
    mu, a = lame(NU_SLAB)[0], roots()
    decay = np.sin(a) * np.cos(a) / (a - np.sin(a) * np.cos(a)) * np.exp(-(a**2) * T)
    return float(LOAD * B / (2 * mu) * (1 - NU_SLAB - decay.sum()))


def times(
    first: float,
    last: float,
    growth: float,
    most: float,
    more: Sequence[float] = (*SHOWN, *PROFILES),
) -> list[float]:
    """T_v of the steps, of which each is the share `growth` of the time so far, but at most `most`.

    Those of `more` are added.
    """
    found = [first]
    while found[-1] < last:
        found.append(min(last, found[-1] + min(growth * found[-1], most)))
    return sorted({*found, *(T for T in more if first < T < last)})


@dataclass
class Run:
    """Records of a run after each step.

    Attributes:
        T: c_v t over the square of the drainage path.
        value: Degree of consolidation, or pressure in the middle over F/a.
        exact: The same by the series.
        profiles: T_v -> positions along the drainage path [m] and pressures over the load.
        rms: T_v -> rms error of these pressures.
        force: Force of Mandel's plate over F.
        peak: Largest pressure at a particle over the load.
    """

    T: list[float] = field(default_factory=list)
    value: list[float] = field(default_factory=list)
    exact: list[float] = field(default_factory=list)
    profiles: dict[float, tuple[Array, Array]] = field(default_factory=dict)
    rms: dict[float, float] = field(default_factory=dict)
    force: list[float] = field(default_factory=list)
    peak: float = 0.0

    def error(self, T: float) -> float:
        """Error of the value at a time [%]."""
        k = self.T.index(T)
        return 100 * (self.value[k] / self.exact[k] - 1)

    def record(self, T: float, value: float, exact: float) -> None:
        """Add a step."""
        self.T.append(T)
        self.value.append(value)
        self.exact.append(exact)


def column(n: int = 16, **parameters: Any) -> tawami.Scene:
    """Terzaghi's column of n cells with its load."""
    h = H / n
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=(1, n))
    soil = tawami.box(grid, (0.0, 0.0), (h, H))
    law = tawami.linear_elastic(E=E, nu=NU_COLUMN)
    scene = tawami.Scene(grid, soil, law, form="u_epsv_pw", **parameters)
    scene.fix("left", "x")
    scene.fix("right", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "p_w", 0.0)
    scene.traction("top", (0.0, -LOAD))
    scene.data("kappa", KAPPA)
    return scene


def terzaghi(
    n: int = 16, first: float = 1e-4, last: float = 1.0, growth: float = 0.04, most: float = 0.01,
    **parameters: float,
) -> Run:  # fmt: skip
    """Consolidate the column."""
    scene, run, M = column(n, **parameters), Run(), lame(NU_COLUMN)[1]
    z = scene.particles.x[:, 1]
    for T in times(first, last, growth, most):
        solution = scene.solve(until=T * H**2 / c_v(NU_COLUMN))
        settlement = -H * float(solution.strain[:, 1].mean())  # of particles of one volume
        run.record(T, settlement * M / (LOAD * H), degree(T))
        p = solution.field("p_w") / LOAD
        run.peak = max(run.peak, float(p.max()))
        if T in PROFILES:
            run.profiles[T] = z, p
            run.rms[T] = float(np.sqrt(np.mean((p - pressure(T, z)) ** 2)))
    return run


def mandel(
    n: int = 16, first: float = 1e-3, last: float = 1.0, growth: float = 0.05, most: float = 0.01
) -> Run:
    """Consolidate a quarter of the slab, n cells wide."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=A / n, cells=(n, n // 2))
    soil = tawami.box(grid, (0.0, 0.0), (A, B))
    law = tawami.linear_elastic(E=E, nu=NU_SLAB)
    scene = tawami.Scene(grid, soil, law, form="u_epsv_pw")
    unit, run = A**2 / c_v(NU_SLAB), Run()
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("right", "p_w", 0.0)
    scene.fix("top", "y", -1.0, amplitude=lambda t: mandel_settlement(t / unit) if t > 0 else 0.0)
    scene.data("kappa", KAPPA)
    x = scene.particles.x[:, 0]
    middle = x < A / n
    for T in times(first, last, growth, most):
        solution = scene.solve(until=T * unit)
        p = solution.field("p_w") / LOAD
        at = float(x[middle].mean())
        run.record(T, float(p[middle].mean()), float(mandel_pressure(T, at)[0]))
        run.force.append(-float(solution.reaction("top")[1]) / (LOAD * A))
        if T in PROFILES:
            run.profiles[T] = x, p
            run.rms[T] = float(np.sqrt(np.mean((p - mandel_pressure(T, x)) ** 2)))
    return run


@dataclass(frozen=True)
class Row:
    """A line of the table: the value at a time, its error [%], and the rms error of the pressure [%]."""

    case: str
    T: float
    value: float
    exact: float
    error: float
    rms_pressure: float


COLUMNS = ("case", "T", "value", "exact", "error", "rms_pressure")


def rows(name: str, run: Run) -> list[Row]:
    """The run at the times of the table."""
    found = []
    for T in SHOWN:
        k = run.T.index(T)
        found.append(Row(name, T, run.value[k], run.exact[k], run.error(T), 100 * run.rms[T]))
    return found


def draw(one: Run, two: Run, path: Path) -> None:
    """Draw degree of consolidation, isochrones, and the pressure in Mandel's slab."""
    figure, panels = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained")
    settlement, profiles, middle = panels
    settlement.semilogx(one.T, one.exact, "k", label="Terzaghi")
    settlement.semilogx(one.T[::6], one.value[::6], "o", color=style.VERMILION, label="particles")
    settlement.invert_yaxis()
    settlement.set_xlabel("$T_v$ [-]")
    settlement.set_ylabel("degree of consolidation $U$ [-]")
    line = np.linspace(0, H, 200)
    for T, colour in zip(PROFILES, style.LINES, strict=False):
        profiles.plot(pressure(T, line), line, "k", linewidth=0.8)
        z, p = one.profiles[T]
        profiles.plot(p, z, "o", color=colour, label=f"$T_v$ = {T}")
    profiles.set_xlabel("Terzaghi: $p_w/q$ [-]")
    profiles.set_xlim(0, 1.35)
    profiles.set_ylabel("$z/H$ [-]")
    middle.semilogx(two.T, two.exact, "k", label="Mandel")
    middle.semilogx(two.T[::3], two.value[::3], "o", color=style.BLUE, label="particles")
    middle.set_xlabel("$c_v t/a^2$ [-]")
    middle.set_ylabel("pressure in the middle of the slab $p_w a/F$ [-]")
    for axes in panels:
        axes.grid()
        axes.legend()
    save(figure, path)


PROGRAM = Program("cases.verification.consolidation", __doc__)
PROGRAM.option("--cells", type=int, default=16, help="cells over the drainage path")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run both problems, print the table, draw the figure."""
    n = PROGRAM.start(arguments).cells
    one, two = terzaghi(n), mandel(n)
    table = [*rows("Terzaghi, U", one), *rows("Mandel, p a/F", two)]
    print(as_text(table, COLUMNS))
    print(f"Mandel: largest pressure {max(two.value):.4f}, by the series {max(two.exact):.4f}")
    print(f"Mandel: force of the plate {min(two.force):.4f} to {max(two.force):.4f} F")
    early = {a: terzaghi(n, 1e-5, 1e-5, alpha_w=a).peak for a in (0.0, 1 / 6)}
    print("largest pressure after a small step: " + ", ".join(
        f"{peak:.3f} q with alpha_w = {a:.3g}" for a, peak in early.items()))  # fmt: skip
    PROGRAM.write("table.csv", as_csv(table, COLUMNS))
    draw(one, two, PROGRAM.folder / "consolidation.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
