"""A wall between rigid neighbours that is heated at one face: conduction, expansion and stress.

     theta_0 = 50 K
     o_______________o      H = 0.2 m; concrete: E = 30 GPa, nu = 0.2, a = 1e-5 /K,
     o               o      k = 2 W/(m K), rho = 2400 kg/m3, c = 900 J/(kg K)
     o_______________o      the other face is insulated and held; the sides are held

With D = k/(rho c), T = D t/H^2 and m_j = (2 j + 1) pi/2 the temperature is Fourier's series

    theta = theta_0 (1 - sum_j 2/m_j sin(m_j (1 - y/H)) exp(-m_j^2 T)).

The face is free, so that sigma_yy = 0. Along it expansion is prevented, and the face moves by w:

    sigma_xx = sigma_zz = -E a theta/(1 - nu),    w = a (1 + nu)/(1 - nu) int theta dy.

python -m cases.verification.heated_wall
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.common.figure import save
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from tawami.picture import style

Array = npt.NDArray[np.float64]

H, THETA = 0.2, 50.0  # thickness [m], temperature of the face [K]
E, NU, A = 30e9, 0.2, 1e-5  # [Pa], [-], [1/K]
K_T, RHO, C = 2.0, 2400.0, 900.0  # conductivity [W/(m K)], density [kg/m3], capacity [J/(kg K)]
UNIT = H**2 * RHO * C / K_T  # H^2/D [s]
SHOWN = (0.02, 0.1, 0.3, 1.0)  # D t/H^2
M = (np.arange(1000) + 0.5) * np.pi


def temperature(T: float, y: Array) -> Array:
    """Fourier's series [K] at y [m]."""
    m = M[:, None]
    series = 2 / m * np.sin(m * (1 - y / H)) * np.exp(-(m**2) * T)
    return np.asarray(THETA * (1 - series.sum(axis=0)))


def movement(T: float) -> float:
    """Movement of the face [m]."""
    mean = 1 - float(np.sum(2 / M**2 * np.exp(-(M**2) * T)))
    return A * (1 + NU) / (1 - NU) * THETA * mean * H


@dataclass(frozen=True)
class State:
    """State of the wall at a time.

    Attributes:
        T: D t/H^2.
        y, theta, stress: Heights [m], temperatures [K], stresses (xx, yy, zz, xy) [Pa] of the particles.
        theta_error: rms error of the temperature over that of the face [%].
        stress_error: rms error of sigma_xx over E a theta_0/(1 - nu) [%].
        normal: Largest |sigma_yy| over the same [%].
        moved: Movement of the face [mm].
        moved_error: Its error [%].
    """

    T: float
    y: Array
    theta: Array
    stress: Array
    theta_error: float
    stress_error: float
    normal: float
    moved: float
    moved_error: float


COLUMNS = ("T", "theta_error", "stress_error", "normal", "moved", "moved_error")


def build(n: int) -> tawami.Scene:
    """The wall, n cells thick, before it is heated."""
    h = H / n
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=(1, n))
    wall = tawami.box(grid, (0.0, 0.0), (h, H))
    concrete = tawami.linear_elastic(E=E, nu=NU)
    scene = tawami.Scene(grid, wall, concrete, form="u_epsv_theta", density=RHO)
    for name, value in (("expansion", A), ("conductivity", K_T), ("capacity", C)):
        scene.data(name, value)
    scene.fix("left", "x")
    scene.fix("right", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "theta", THETA)
    return scene


def solve(n: int = 16, steps: int = 150) -> list[State]:
    """Heat the wall, in steps that grow with time."""
    scene, states = build(n), []
    unit = E * A * THETA / (1 - NU)
    y = np.array(scene.particles.x[:, 1])
    for T in sorted({*(SHOWN[-1] * (np.arange(1, steps + 1) / steps) ** 2), *SHOWN}):
        solution = scene.solve(until=T * UNIT)
        if T not in SHOWN:
            continue
        theta, stress, exact = solution.field("theta"), solution.stress, temperature(T, y)
        moved = H * float(solution.strain[:, 1].mean())
        states.append(State(
            T, y, theta, stress,
            100 * float(np.sqrt(np.mean((theta - exact) ** 2))) / THETA,
            100 * float(np.sqrt(np.mean((stress[:, 0] / unit + exact / THETA) ** 2))),
            100 * float(np.abs(stress[:, 1]).max()) / unit,
            1e3 * moved, 100 * (moved / movement(T) - 1),
        ))  # fmt: skip
    return states


def draw(states: Sequence[State], path: Path) -> None:
    """Draw temperature and stress through the wall."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained", sharey=True)
    line = np.linspace(0, H, 300)
    for state, colour in zip(states, style.LINES, strict=False):
        exact = temperature(state.T, line)
        hours = state.T * UNIT / 3600
        left.plot(exact, 1e3 * line, "k", linewidth=0.8)
        left.plot(state.theta, 1e3 * state.y, "o", color=colour, label=f"{hours:.2g} h")
        right.plot(-E * A * exact / (1 - NU) / 1e6, 1e3 * line, "k", linewidth=0.8)
        right.plot(
            state.stress[:, 0] / 1e6, 1e3 * state.y, "o", color=colour, label=f"{hours:.2g} h"
        )
    left.set_xlabel("temperature [K]")
    left.set_ylabel("$y$ [mm]")
    right.set_xlabel("stress along the wall $\\sigma_{xx}$ [MPa]")
    for axes in (left, right):
        axes.grid()
        axes.legend()
    save(figure, path)


PROGRAM = Program("cases.verification.heated_wall", __doc__)
PROGRAM.option("--cells", type=int, default=16, help="cells over the thickness")


def main(arguments: Sequence[str] | None = None) -> None:
    """Heat the wall, print the table, draw the figure."""
    states = solve(PROGRAM.start(arguments).cells)
    print(as_text(states, COLUMNS))
    PROGRAM.write("table.csv", as_csv(states, COLUMNS))
    draw(states, PROGRAM.folder / "heated_wall.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
