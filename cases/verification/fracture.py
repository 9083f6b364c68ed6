"""Phase-field fracture: a homogeneous bar, and a crack that runs through a notched strip.

       u ^ ^ ^ ^ ^ ^        height 1 m, width 1.5 m, notch 0.4 m; E = 1 MPa, G_c = 1 J/m2
      |             |       top and bottom clamped and moved apart
      |====         |       l: length of the phase field, 2 cells
      |_____________|

Bar (AT2, nu = 0, strain e, psi = E e^2/2, l = 0.1 m), with its largest stress at e^2 = G_c/(3 l E):

    d = 2 psi/(G_c/l + 2 psi),    sigma = (1 - d)^2 E e,    sigma_max = 9/16 sqrt(E G_c/(3 l)).

Strip: the energy of the phase field, sum_p V_p G_c (d^2/(2 l) + l/2 |grad d|^2), grows by G_c for each
area that the crack passes. On a grid d = 1 in a band of one cell, which adds its width (Bourdin,
Francfort and Marigo 2008, J. Elasticity 91): the factor 1 + h/(2 l). AT2 has no elastic limit, and the
strip before the crack has the damage d_b of the bar at its strain. The crack then adds

    G_c (1 + h/(2 l)) (1 - d_b^2),    of d = d_b + (1 - d_b) exp(-|y|/l) less that of d_b.

The slope of the energy over the position of the tip (d > 0.9) is compared with it while the crack is at
least 4 l from the notch and from the end.

At each displacement, solves alternate with updates of H until d stands still.

python -m cases.verification.fracture
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
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

E, G_C = 1.0e6, 1.0  # Young's modulus [Pa], fracture energy [J/m2]
L_BAR, NU_STRIP = 0.1, 0.2  # length of the phase field of the bar [m], Poisson's ratio of the strip
HEIGHT, WIDTH, NOTCH = 1.0, 1.5, 0.4  # [m]
STIFFNESS = E * (1 - NU_STRIP) / ((1 + NU_STRIP) * (1 - 2 * NU_STRIP))  # E' of uniaxial strain [Pa]
RATIO = 2.0  # l/h of the strip
BAR_STRAINS = (0.3, 0.6, 0.9, 1.3, 2.0, 1.0)  # over that of the largest stress; the last unloads


def energy(stress: Array, nu: float) -> Array:
    """Elastic energy psi of the stresses (xx, yy, zz, xy) of the particles [J/m3]."""
    mu, K = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    mean = stress[:, :3].mean(axis=1)
    s = stress[:, :3] - mean[:, None]
    return np.asarray(((s**2).sum(axis=1) + 2 * stress[:, 3] ** 2) / (4 * mu) + mean**2 / (2 * K))


def settle(
    scene: tawami.Scene, H: Array, nu: float, tolerance: float, each: Callable[[Array], None]
) -> tuple[tawami.Solution, Array]:
    """Alternate solves and updates of H until d changes by less than the tolerance.

    `each` is called with d after each solve.
    """
    old = np.inf
    while True:
        scene.data("H", H)
        solution = scene.solve()
        d = solution.field("d")
        H = np.maximum(H, energy(solution.stress, nu))
        each(d)
        if np.abs(d - old).max() < tolerance:
            return solution, H
        old = d


@dataclass(frozen=True)
class Bar:
    """State of the bar: strain over that of the largest stress, damage, stress [Pa], closed forms."""

    strain: float
    d: float
    d_exact: float
    stress: float
    stress_exact: float


def bar() -> list[Bar]:
    """Stretch the bar, and unload it at the end."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(4, 2))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 0.5), gauss=True)
    law = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(grid, body, law, form="u_epsv_damage", k=0.0)
    scene.data("G_c", G_C)
    scene.data("l", L_BAR)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    end = scene.fix("right", "x", 0.0)
    peak, H, states, largest = (
        np.sqrt(G_C / (3 * L_BAR * E)),
        np.zeros(scene.num_particles),
        [],
        0.0,
    )
    for strain in BAR_STRAINS:
        end.change(strain * peak)
        solution, H = settle(scene, H, 0.0, 1e-10, lambda d: None)
        largest = max(largest, strain)
        psi = E * (largest * peak) ** 2 / 2
        d = 2 * psi / (G_C / L_BAR + 2 * psi)
        states.append(Bar(
            strain, float(solution.field("d").mean()), d, float(solution.reaction("right")[0]) / 0.5,
            (1 - d) ** 2 * E * strain * peak,
        ))  # fmt: skip
    return states


@dataclass
class Strip:
    """Records of the strip after each solve.

    Attributes:
        h, length: Side of the cells, and length l of the phase field [m].
        tip: Position of the tip [m].
        surface: Energy of the phase field [J/m].
        strain: Strain of the strip far from the crack [-].
        x, d: Positions [m] and damage of the particles at the end.
    """

    h: float
    length: float
    tip: list[float] = field(default_factory=list)
    surface: list[float] = field(default_factory=list)
    strain: list[float] = field(default_factory=list)
    x: Array = field(default_factory=lambda: np.empty((0, 2)))
    d: Array = field(default_factory=lambda: np.empty(0))

    @property
    def chosen(self) -> npt.NDArray[np.bool_]:
        """Solves with the tip away from notch and end."""
        tip = np.array(self.tip)
        return (tip > NOTCH + 4 * self.length) & (tip < WIDTH - 4 * self.length)

    @property
    def fracture_energy(self) -> float:
        """Growth of the surface energy by the area of the crack [J/m2]."""
        tip, surface = np.array(self.tip)[self.chosen], np.array(self.surface)[self.chosen]
        return float(np.polyfit(tip, surface, 1)[0])

    @property
    def before(self) -> float:
        """Damage d_b of the strip before the crack, the mean over the chosen solves."""
        twice_psi = STIFFNESS * np.array(self.strain)[self.chosen] ** 2
        return float((twice_psi / (G_C / self.length + twice_psi)).mean())

    @property
    def expected(self) -> float:
        """G_c (1 + h/(2 l)) (1 - d_b^2) [J/m2]."""
        return G_C * (1 + self.h / (2 * self.length)) * (1 - self.before**2)


def strip(n: int = 30, first: float = 1.2, increment: float = 0.05) -> Strip:
    """Pull the notched strip, with n cells over a metre, until the crack is near its end.

    Displacements are multiples of that of Griffith, at which E' e^2 HEIGHT/2 = G_c.
    """
    h, rows, columns = 1 / n, 2 * round(HEIGHT * n / 2) + 1, round(WIDTH * n)
    run = Strip(h, RATIO * h)
    top = rows * h / 2
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, -top), h=h, cells=(columns, rows))
    body = tawami.box(grid, (0.0, -top), (WIDTH, top), per_axis=2)
    law = tawami.linear_elastic(E=E, nu=NU_STRIP)
    scene = tawami.Scene(grid, body, law, form="u_epsv_damage")
    scene.data("G_c", G_C)
    scene.data("l", run.length)
    for edge, component in (("bottom", "x"), ("bottom", "y"), ("top", "x")):
        scene.fix(edge, component)
    pull = scene.fix("top", "y", 0.0)
    x, V = np.array(scene.particles.x), np.array(scene.particles.volume)
    middle = np.abs(x[:, 1]) < h / 2
    H = np.where(middle & (x[:, 0] < NOTCH), 1e3 * G_C / (2 * run.length), 0.0)

    def record(d: Array) -> None:
        slope = scene.particles.carried("d")[:, 1:]
        density = G_C * (d**2 / (2 * run.length) + run.length / 2 * (slope**2).sum(axis=1))
        run.tip.append(float(x[middle & (d > 0.9), 0].max()))
        run.surface.append(float(V @ density))
        run.strain.append(load * griffith / (2 * top))

    griffith = np.sqrt(2 * G_C * 2 * top / STIFFNESS)
    load = first
    while not run.tip or run.tip[-1] < WIDTH - 4 * run.length:
        pull.change(load * griffith)
        solution, H = settle(scene, H, NU_STRIP, 2e-3, record)
        load += increment
    run.x, run.d = x, solution.field("d")
    return run


COLUMNS = ("strain", "d", "d_exact", "stress", "stress_exact")


def draw(states: Sequence[Bar], run: Strip, path: Path) -> None:
    """Draw the bar's stress, the damage of the strip, and its surface energy over the tip."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(14, 4.3), layout="constrained")
    peak = np.sqrt(G_C / (3 * L_BAR * E))
    e = np.linspace(0, 2.1, 200)
    psi = E * (e * peak) ** 2 / 2
    left.plot(
        e, (G_C / L_BAR / (G_C / L_BAR + 2 * psi)) ** 2 * E * e * peak, "k", label="closed form"
    )
    left.plot([b.strain for b in states], [b.stress for b in states], "o", color=style.VERMILION,
              label="particles")  # fmt: skip
    left.plot([0, 2.0], [0, states[-2].stress], "k:", label="unloading")
    left.set_xlabel("strain of the bar over that of the largest stress [-]")
    left.set_ylabel("stress [Pa]")
    shown = middle.scatter(*run.x.T, c=run.d, s=3, cmap=style.FROM_ZERO, vmin=0, vmax=1)
    middle.set_aspect("equal")
    middle.set_xlabel("$x$ [m]")
    middle.set_ylabel("$y$ [m]")
    figure.colorbar(shown, ax=middle, label="damage $d$ [-]")
    tip, surface, used = np.array(run.tip), np.array(run.surface), run.chosen
    right.plot(tip, surface, ".", color=style.SKY, label="all solves")
    right.plot(tip[used], surface[used], ".", color=style.BLUE, label="used")
    ends = np.array([tip[used].min(), tip[used].max()])
    middle_of = surface[used].mean() + run.expected * (ends - tip[used].mean())
    right.plot(ends, middle_of, "k", label="$G_c (1 + h/(2 l)) (1 - d_b^2)$")
    right.set_xlabel("tip of the crack [m]")
    right.set_ylabel("energy of the phase field [J/m]")
    for axes in (left, right):
        axes.grid()
        axes.legend()
    save(figure, path)


PROGRAM = Program("cases.verification.fracture", __doc__)
PROGRAM.option("--cells", type=int, default=30, help="cells over a metre of the strip")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run bar and strip, print the tables, draw the figure."""
    n = PROGRAM.start(arguments).cells
    states = bar()
    print(as_text(states, COLUMNS))
    run = strip(n)
    found, expected = run.fracture_energy, run.expected
    print(f"strip, l/h = {RATIO:g}: fracture energy {found:.4f} J/m2, closed form {expected:.4f} J/m2 "
          f"(1 + h/(2 l) = {1 + 1 / (2 * RATIO):.4f}, 1 - d_b^2 = {1 - run.before**2:.4f})")  # fmt: skip
    print(f"difference {100 * (found / expected - 1):.2f} %, {len(run.tip)} solves")
    PROGRAM.write("bar.csv", as_csv(states, COLUMNS))
    draw(states, run, PROGRAM.folder / "fracture.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
