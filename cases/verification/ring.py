"""A ring under internal pressure, at small and at large strain, anywhere on the grid.

           .---.
         /  .-.  \\      A = 1 m, B = 2 m, plane strain, pressure p on the inner border;
        |  ( p )  |     small strain: E = 1000 Pa, nu = 0.4999, p = 1 Pa;
         \\  `-'  /      large strain: neo-Hookean, mu = 1000 Pa, K = 1e4 mu, p = 0.574054 mu
           `---'

Small strain (Lame): u(A) = p A (1 + nu)/E ((1 - 2 nu) A^2 + B^2)/(B^2 - A^2), and the mean stress is
uniform, (2/3) (1 + nu) p A^2/(B^2 - A^2).

Large strain (Rivlin 1949, incompressible), with c = a^2 - A^2, r^2 = R^2 + c, lambda = r/R:

    p/mu = ln(B/A) - ln(b/a) + (c/2) (1/a^2 - 1/b^2),      a = 2 A for p/mu = 0.574054,
    sigma_r = mu [ln(R/B) - ln(r/b) - (c/2) (1/r^2 - 1/b^2)],
    sigma_t = sigma_r + mu (lambda^2 - 1/lambda^2),        sigma_z = sigma_r + mu (1 - 1/lambda^2).

No line of the grid follows the border: cells are cut, and at large strain the particles move through
them. The pressure acts on points of the border, and three points are held against rigid motions.

python -m cases.verification.ring
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

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

A, B = 1.0, 2.0  # radii [m]
E, NU, P = 1000.0, 0.4999, 1.0  # small strain: [Pa], [-], [Pa]
MU, K, P_MU = 1000.0, 1e7, 0.574054  # large strain: [Pa], [Pa], p/mu
SHIFTS = ((0.0, 0.0), (0.37, 0.61), (0.1, 0.8))  # of the centre [cells]


@dataclass(frozen=True)
class Ring:
    """A ring after loading.

    Attributes:
        strain: 'small' or 'large'.
        n: Cells per metre.
        particles: 'even' or 'Gauss'.
        volumes: Volumes in the integrals, as in `Scene`.
        shift: Shift of the centre along x [cells].
        radius: Error of u(A), at large strain of a [%].
        rms: Error of the mean stress, rms by volume [% of it, at large strain of p].
        largest: Its largest error [%].
        R: Initial radii of the particles [m].
        mean: Their mean stress [Pa].
    """

    strain: str
    n: int
    particles: str
    volumes: str
    shift: float
    radius: float
    rms: float
    largest: float
    R: Array
    mean: Array


COLUMNS = ("strain", "n", "particles", "volumes", "shift", "radius", "rms", "largest")


def build(n: int, size: float, shift: tuple[float, float], law: Any, gauss: bool, **options: Any):
    """The ring on three points, before it is loaded; `size` is half the side of the grid [m]."""
    h = 1 / n
    cells = 2 * int(np.ceil(size / h))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-size, -size), h=h, cells=(cells, cells))
    x, y = (h * s for s in shift)
    body = tawami.disc(grid, (x, y), B, inner=A, gauss=gauss)
    scene = tawami.Scene(grid, body, law, **options)
    middle = (A + B) / 2
    scene.hold((x + middle, y), "y")
    scene.hold((x - middle, y), "y")
    scene.hold((x, y + middle), "x")
    return scene, body.x - (x, y), np.asarray(body.volume)


def errors(mean: Array, exact: Array | float, volume: Array, unit: float) -> tuple[float, float]:
    """The rms and the largest error of a stress [%]."""
    error = 100 * (mean - exact) / unit
    return float(np.sqrt(volume @ error**2 / volume.sum())), float(np.abs(error).max())


def small(
    n: int, shift: tuple[float, float] = SHIFTS[0], *, gauss: bool = False, **options: Any
) -> Ring:
    """The ring at small strain."""
    law = tawami.linear_elastic(E=E, nu=NU)
    scene, x, volume = build(n, B + 2 / n, shift, law, gauss, **options)
    scene.pressure("inner", P)
    solution = scene.solve()
    radius = np.linalg.norm(x, axis=1)
    u = np.sum(solution.displacement_of_particles * x, axis=1) / radius
    exact_u = P * A**2 * (1 + NU) / (E * (B**2 - A**2)) * ((1 - 2 * NU) * radius + B**2 / radius)
    near = radius < A + 0.5 / n  # in the first half cell the displacement is that of the border
    ratio = float(volume[near] @ (u / exact_u)[near] / volume[near].sum())
    mean = solution.stress[:, :3].mean(axis=1)
    exact = 2 / 3 * (1 + NU) * P * A**2 / (B**2 - A**2)
    found = errors(mean, exact, volume, exact)
    return Ring(
        "small", n, "Gauss" if gauss else "even", options.get("volumes", "full_cells"), shift[0],
        100 * (ratio - 1), *found, radius, mean,
    )  # fmt: skip


def exact_mean(R: Array) -> Array:
    """Mean stress at large strain [Pa], at initial radii [m]."""
    c = (2 * A) ** 2 - A**2
    r, b = np.sqrt(R**2 + c), np.sqrt(B**2 + c)
    radial = np.log(R / B) - np.log(r / b) - c / 2 * (1 / r**2 - 1 / b**2)
    square = (r / R) ** 2
    return np.asarray(MU * (radial + (square - 2 / square + 1) / 3))


def large(
    n: int,
    shift: tuple[float, float] = SHIFTS[0],
    *,
    steps: int = 10,
    gauss: bool = False,
    volumes: Literal["fitted", "own"] = "fitted",
) -> Ring:
    """The ring at large strain."""
    law, form = tawami.neo_hookean(K=K, mu=MU), "u_epsv_finite"
    scene, x, volume = build(n, 2.75, shift, law, gauss, form=form, volumes=volumes)
    scene.pressure("inner", P_MU * MU)
    solutions: list[tawami.Solution] = []
    tawami.ramp(scene, 1 / steps, each=solutions.append, stop="raise")
    R = np.linalg.norm(x, axis=1)
    mean = solutions[-1].stress[:, :3].mean(axis=1)
    radii = np.linalg.norm(scene.border.x - np.array(shift) / n, axis=1)
    outside = np.sqrt(B**2 + (2 * A) ** 2 - A**2)
    a = float(radii[radii < (2 * A + outside) / 2].mean())
    found = errors(mean, exact_mean(R), volume, P_MU * MU)
    return Ring(
        "large", n, "Gauss" if gauss else "even", volumes, shift[0],
        100 * (a / (2 * A) - 1), *found, R, mean,
    )  # fmt: skip


def draw(rings: Sequence[Ring], path: Path) -> None:
    """Draw the mean stress over the radius, at small and large strain."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    line = np.linspace(A, B, 200)
    exact = np.full(200, 2 / 3 * (1 + NU) * A**2 / (B**2 - A**2)), exact_mean(line) / (P_MU * MU)
    units = P, P_MU * MU
    for one, strain, solution, unit in zip(axes, ("small", "large"), exact, units, strict=True):
        chosen = [ring for ring in rings if ring.strain == strain]
        for ring, colour in zip(chosen, style.LINES, strict=False):
            label = f"n = {ring.n}, {ring.volumes} volumes"
            one.plot(ring.R, ring.mean / unit, ".", color=colour, markersize=2, label=label)
        one.plot(line, solution, "k", label="exact")
        one.set_xlabel("$R$ [m]")
        one.set_ylabel("mean stress / $p$")
        one.set_title(f"{strain} strain")
        one.grid()
        one.legend(markerscale=4)
    save(figure, path)


PROGRAM = Program("cases.verification.ring", __doc__)
PROGRAM.option("--cells", type=int, default=16, help="cells per metre of the finest ring")


def main(arguments: Sequence[str] | None = None) -> None:
    """Load the rings, print the table, draw the figure."""
    n = PROGRAM.start(arguments).cells
    rings = [small(n, volumes="own")]
    rings += [small(n, shift) for shift in SHIFTS]
    rings += [small(n, shift, gauss=True) for shift in SHIFTS]
    drawn = [rings[0], rings[1]]
    rings += [large(m) for m in (n // 4, n // 2, n)]
    rings += [large(n, SHIFTS[1]), large(n, volumes="own")]
    drawn += [rings[-1], rings[-2]]
    print(as_text(rings, COLUMNS))
    PROGRAM.write("table.csv", as_csv(rings, COLUMNS))
    draw(drawn, PROGRAM.folder / "ring.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
