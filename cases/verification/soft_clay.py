"""A layer of soft clay that consolidates under its own weight, at finite strain.

      o .  .  .  .  . o   drained surface, which moves down through the grid
      o    soft       o   H = 10 m, porosity n_0 = 0.7, grains 2650 kg/m3, under water
      o    clay       o   M = 60 kPa (Hencky elastic, nu = 0.3)
      o_______________o   kappa = 1e-15 m2 at the start, proportional to J^4; base tight

J is the volume of the mixture over that at the start, 1 at first. With the buoyant weight g' per V0 the
nominal effective stress of uniaxial strain at the end is

    M ln(J)/J = -g' (H - Z),  g' = (1 - n_0) (rho_s - rho_w) g,

so that J = exp(-W(g' (H - Z)/M)) with Lambert's W. The pores hold the water J - (1 - n_0). The void
ratio is e = J/(1 - n_0) - 1, and the water that has left is the settlement. On the way, with Z of
the grains (Gibson, England and Hussey 1967, Geotechnique 17, 261), with the excess pore pressure p,

    dJ/dt = d/dZ ( kappa(J)/(mu_w J) dp/dZ ),    dp/dZ = d/dZ (M ln(J)/J) - g',

J = 1 at the surface, dp/dZ = 0 at the base. It is solved with finite differences in Z, stiff in time.

The top row of particles is drained by a large `leak`; it is a sixth of a cell below the surface. While
the drained layer is thinner than a cell, the settlement is too large.

python -m cases.verification.soft_clay
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.integrate import quad, solve_ivp
from scipy.special import lambertw

import tawami
from cases.common.figure import save
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from cases.verification.consolidation import times
from tawami.picture import style

Array = npt.NDArray[np.float64]

H, POROSITY = 10.0, 0.7  # height [m] and porosity at the start
RHO_S, RHO_W, G = 2650.0, 1000.0, 9.81  # grains and water [kg/m3], [m/s2]
M, NU = 6.0e4, 0.3  # modulus of uniaxial strain [Pa]
KAPPA, EXPONENT, MU_W = 1.0e-15, 4.0, 1.0e-3  # [m2], of J, [Pa s]
YEAR = 365.25 * 86400.0  # [s]
WEIGHT = (1 - POROSITY) * (RHO_S - RHO_W) * G  # g' [N/m3]
UNIT = H**2 * MU_W / (KAPPA * M)  # H^2/c_v at the start [s]
PROFILES = (0.02, 0.1, 0.3, 0.6, 1.0, 2.0)  # t c_v/H^2


def final_J(Z: Array | float, weight: float = WEIGHT) -> Array:
    """Volume ratio at the end of the layer that started at the height Z [m]."""
    return np.asarray(np.exp(-lambertw(weight * (H - np.asarray(Z)) / M).real))


def final_settlement(weight: float = WEIGHT) -> float:
    """Settlement at the end [m]."""
    return H - float(quad(lambda Z: float(final_J(Z, weight)), 0.0, H)[0])


@cache
def gibson(
    weight: float = WEIGHT, n: int = 200, end: float = PROFILES[-1]
) -> tuple[Array, Array, Array]:
    """Volume ratios by finite differences.

    Returns:
        Times t c_v/H^2, heights Z [m] at the start of the centres of n layers, and J, layers x times.
    """
    d = H / n

    def rate(_: float, J: Array) -> Array:
        stress = M * np.log(J) / J
        # of the inner sides, and of the surface, where the stress is 0 half a layer above
        slope = np.append(np.diff(stress), -2 * stress[-1]) / d - weight
        at_side = np.append((J[1:] + J[:-1]) / 2, 1.0)
        flow = KAPPA / MU_W * at_side ** (EXPONENT - 1) * slope
        return UNIT * np.diff(flow, prepend=0.0) / d

    times = np.unique([*np.geomspace(1e-4, end, 120), *PROFILES])
    found = solve_ivp(rate, (0.0, end), np.ones(n), "LSODA", times, rtol=1e-8, atol=1e-10,
                      lband=1, uband=1)  # fmt: skip
    return found.t, (np.arange(n) + 0.5) * d, found.y


def small_strain(T: Array, weight: float = WEIGHT) -> Array:
    """Settlement of Terzaghi's theory [m]: a pressure that starts as g' (H - Z)."""
    m = (np.arange(400) + 0.5)[:, None] * np.pi
    remains = (2 * np.sin(m) / m**3 * np.exp(-(m**2) * T)).sum(axis=0)
    return np.asarray(weight * H**2 / M * (0.5 - remains))


@dataclass
class Run:
    """Records of a run after each step.

    Attributes:
        T: t c_v/H^2.
        settlement: Settlement [m].
        water: Water that has left through the drain, per area [m].
        iterations: Newton iterations of the steps.
        profiles: T -> present and first heights [m], pore pressures [Pa] and volume ratios.
    """

    T: list[float] = field(default_factory=list)
    settlement: list[float] = field(default_factory=list)
    water: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    profiles: dict[float, tuple[Array, Array, Array, Array]] = field(default_factory=dict)


def build(n: int = 20, weight: float = WEIGHT, **parameters: float) -> tawami.Scene:
    """The layer of n cells, without its weight."""
    h = H / n
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=(1, n))
    clay = tawami.box(grid, (0.0, 0.0), (h, H))
    E = M * (1 + NU) * (1 - 2 * NU) / (1 - NU)
    leak = 1e3 * KAPPA / MU_W / h**2
    scene = tawami.Scene(
        grid, clay, tawami.linear_elastic(E=E, nu=NU), form="u_epsv_pw_finite", density=weight / G,
        rho_w=0.0, mu_w=MU_W, m=EXPONENT, leak=lambda x, y: np.where(y > H - h / 2, leak, 0.0),
        **parameters,
    )  # fmt: skip
    scene.fix("left", "x")
    scene.fix("right", "x")
    scene.fix("bottom", "y")
    scene.data("kappa", KAPPA)
    return scene


def solve(
    n: int = 20, first: float = 1e-3, growth: float = 0.05, most: float = 0.02,
    last: float = PROFILES[-1], weight: float = WEIGHT,
) -> Run:  # fmt: skip
    """Apply the weight at once and let the layer consolidate."""
    scene, run = build(n, weight), Run()
    scene.gravity((0.0, -G))
    Z, V0 = np.array(scene.particles.x[:, 1]), np.array(scene.particles.volume)
    h, water, before = H / n, 0.0, 0.0
    top = H - h / 2 < Z
    leak = 1e3 * KAPPA / MU_W / h**2
    for T in times(first, last, growth, most, PROFILES):
        solution = scene.solve(until=T * UNIT)
        p, J = solution.field("p_w"), 1 + scene.particles.displacement_gradient[:, 1, 1]
        water += (T - before) * UNIT * leak * float((V0 * J * p)[top].sum()) / h
        before = T
        run.T.append(T)
        sunk = -scene.particles.displacement[top, 1] + (1 - J[top]) * (H - Z[top])
        run.settlement.append(float(sunk.mean()))
        run.water.append(water)
        run.iterations.append(solution.iterations)
        if T in PROFILES:
            run.profiles[T] = np.array(scene.particles.x[:, 1]), Z, p, J
    return run


@dataclass(frozen=True)
class Row:
    """A line of the table: settlement and water that has left [m], at a time.

    Attributes:
        T: t c_v/H^2.
        settlement, water: Of the run.
        gibson: Settlement by Gibson's equation.
        error: Of the settlement [%].
        lost: Difference of water and settlement [%].
        pressure: rms error of the pore pressure over g' H [%].
    """

    T: float
    settlement: float
    water: float
    gibson: float
    error: float
    lost: float
    pressure: float


COLUMNS = ("T", "settlement", "water", "gibson", "error", "lost", "pressure")


def at(T: float, weight: float = WEIGHT) -> tuple[Array, Array, Array]:
    """Heights at the start, pore pressures [Pa] and volume ratios by Gibson's equation at a time."""
    found, Z, J = gibson(weight)
    now = J[:, int(np.argmin(abs(found - T)))]
    return Z, weight * (H - Z) + M * np.log(now) / now, now


def rows(run: Run, weight: float = WEIGHT) -> list[Row]:
    """The run at the times of the profiles, compared with Gibson's equation."""
    table = []
    for T, (_, Z, p, _) in run.profiles.items():
        k = run.T.index(T)
        heights, pressures, J = at(T, weight)
        exact, s = H * float((1 - J).mean()), run.settlement[k]
        rms = float(np.sqrt(np.mean((p - np.interp(Z, heights, pressures)) ** 2)))
        table.append(Row(T, s, run.water[k], exact, 100 * (s / exact - 1),
                         100 * (run.water[k] / s - 1), 100 * rms / (weight * H)))  # fmt: skip
    return table


def draw(run: Run, path: Path) -> None:
    """Draw pore pressure and void ratio over the height, and the settlement over time."""
    figure, (pressures, ratios, sunk) = plt.subplots(1, 3, figsize=(14, 5), layout="constrained")
    years = UNIT / YEAR
    for (T, (z, _, p, J)), colour in zip(run.profiles.items(), style.LINES, strict=False):
        _, p_exact, J_exact = at(T)
        heights = np.cumsum(J_exact) * H / len(J_exact)
        label = f"{T * years:.3g} years"
        for axes, dots, line in (
            (pressures, p / 1e3, p_exact / 1e3),
            (ratios, J / (1 - POROSITY) - 1, J_exact / (1 - POROSITY) - 1),
        ):
            axes.plot(line, heights, "k", linewidth=0.8)
            axes.plot(dots[::3], z[::3], "o", color=colour, label=label)
    Z = np.linspace(0, H, 200)
    J = final_J(Z)
    end = np.concatenate([[0.0], np.cumsum((J[1:] + J[:-1]) / 2 * np.diff(Z))])
    ratios.plot(J / (1 - POROSITY) - 1, end, "k--", label="end, closed form")
    pressures.set_xlabel("excess pore pressure [kPa]")
    ratios.set_xlabel("void ratio $e$ [-]")
    for axes in (pressures, ratios):
        axes.set_ylabel("height [m]")
        axes.set_ylim(0, H)
        axes.legend()
    found, _, all_J = gibson()
    sunk.semilogx(found * years, H * (1 - all_J).mean(axis=0), "k", label="Gibson et al.")
    T = np.geomspace(1e-3, PROFILES[-1], 200)
    sunk.semilogx(T * years, small_strain(T), ":", color=style.GRAY, label="small strain")
    sunk.semilogx(np.array(run.T[::8]) * years, run.settlement[::8], "o", color=style.VERMILION,
                  label="surface of the particles")  # fmt: skip
    sunk.semilogx(np.array(run.T[::8]) * years, run.water[::8], "x", color=style.BLUE,
                  label="water that has left")  # fmt: skip
    sunk.axhline(final_settlement(), color="k", linestyle="--", linewidth=0.8, label="closed form")
    sunk.set_xlim(1e-3 * years, PROFILES[-1] * years)
    sunk.invert_yaxis()
    sunk.set_xlabel("time [years]")
    sunk.set_ylabel("settlement [m]")
    sunk.legend()
    for axes in (pressures, ratios, sunk):
        axes.grid()
    save(figure, path)


PROGRAM = Program("cases.verification.soft_clay", __doc__)
PROGRAM.option("--cells", type=int, default=20, help="cells over the height")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the layer, print the table, draw the figure."""
    run = solve(PROGRAM.start(arguments).cells)
    table = rows(run)
    print(as_text(table, COLUMNS))
    end, exact = run.settlement[-1], final_settlement()
    print(
        f"settlement at the end {end:.4f} m, closed form {exact:.4f} m: {100 * (end / exact - 1):.2f} %"
    )
    print(f"steps {len(run.T)}, Newton iterations at most {max(run.iterations)}")
    PROGRAM.write("table.csv", as_csv(table, COLUMNS))
    draw(run, PROGRAM.folder / "soft_clay.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
