"""A block in different positions on the grid: the effect of partially filled cells.

     ________
    |        |       1.5 m x 1.5 m, 6 x 6 cells of 0.25 m, 2 x 2 particles each, plane strain
    |-o-o-o--|       E = 1 MPa, nu = 0.49, rho = 1000 kg/m3
    |________|       held at its middle; the lower half stretches under its weight

The same particles are shifted to the right and up by fractions of a cell. One of the offsets puts rows
of them into the next cells by 1e-8 h only. Each method runs with and without the ghost penalty where it
has one. Condition numbers are those of the scaled matrix and of the matrix before scaling. The reference
is the offset 0, where all cells are full.

python -m cases.showcase.cut_cells
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

import tawami
from cases.common.figure import save
from cases.common.program import Program
from cases.common.table import as_text
from cases.common.tangent import reduced_tangent

H, N = 0.25, 6  # cell [m], cells along a side of the block
E, NU, RHO, G = 1e6, 0.49, 1000.0, 10.0  # [Pa], [-], [kg/m3], [m/s2]
SLIVER = 0.25 + 1e-8
OFFSETS = (*np.arange(10) / 10, SLIVER)
METHODS = {
    "u_epsv": {"form": "u_epsv", "alpha": 0.1, "ghost_penalty": "off"},
    "u_epsv, ghost": {"form": "u_epsv", "alpha": 0.1, "ghost_penalty": "on"},
    "u_epsv, alpha = 0": {"form": "u_epsv", "alpha": 0.0, "ghost_penalty": "off"},
    "u_bbar": {"form": "u_bbar"},
    "u": {"form": "u"},
}


@dataclass(frozen=True)
class Row:
    """One computation.

    Attributes:
        method: Form and options, a key of `METHODS`.
        offset: Shift in cells.
        stretch: Elongation of the lower half [m].
        change_percent: Difference of the stretch from that at the offset 0 [%].
        condition: Condition number of the scaled matrix.
        unscaled: Condition number before scaling.
    """

    method: str
    offset: float
    stretch: float
    change_percent: float
    condition: float
    unscaled: float

    @property
    def where(self) -> str:
        """The offset as text."""
        return f"{self.offset:.1f}" if self.offset != SLIVER else "0.25 + 1e-8"


COLUMNS = ("method", "where", "stretch", "change_percent", "condition", "unscaled")


def build(method: str, offset: float) -> tawami.Scene:
    """The block, shifted by an offset in cells."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=H, cells=(N + 3, N + 3))
    body = tawami.box(grid, (H, H), ((N + 1) * H, (N + 1) * H), per_axis=2)
    body = replace(body, x=body.x + offset * H, border=None)
    material = tawami.linear_elastic(E=E, nu=NU)
    scene = tawami.Scene(grid, body, material, density=RHO, **METHODS[method])
    scene.gravity((0.0, -G))
    middle = (1 + N / 2 + offset) * H
    scene.hold((middle - H, middle), "y")
    scene.hold((middle + H, middle), "y")
    scene.hold((middle, middle), "x")
    return scene


def solve(method: str, offset: float, reference: float | None = None) -> Row:
    """Compute stretch and condition numbers at one offset."""
    scene = build(method, offset)
    solution = scene.solve()
    u, y = solution.displacement_of_particles[:, 1], scene.particles.x[:, 1]
    middle = (1 + N / 2 + offset) * H
    stretch = float(u[np.abs(y - middle) < H / 2].mean() - u[y < y.min() + H / 4].mean())
    singular = np.linalg.svd(reduced_tangent(scene)[0], compute_uv=False)
    change = 0.0 if reference is None else 100 * (stretch / reference - 1)
    return Row(method, offset, stretch, change, solution.condition, singular[0] / singular[-1])


def study() -> list[Row]:
    """Solve with every method at every offset."""
    rows: list[Row] = []
    for method in METHODS:
        first = solve(method, 0.0)
        rows += [first] + [solve(method, offset, first.stretch) for offset in OFFSETS[1:]]
    return rows


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the change of the stretch and the condition numbers over the offset."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for method in METHODS:
        mine = sorted((r for r in rows if r.method == method), key=lambda r: r.offset)
        offset = [r.offset for r in mine]
        left.plot(offset, [r.change_percent for r in mine], ".-", label=method)
        (line,) = right.semilogy(offset, [r.condition for r in mine], ".-", label=method)
        right.semilogy(offset, [r.unscaled for r in mine], ":", color=line.get_color())
    left.set_ylabel("change of the stretch [%]")
    right.set_ylabel("condition number [-] (dotted: before scaling)")
    for axes in (left, right):
        axes.set_xlabel("offset [cells]")
        axes.axvline(SLIVER, color="black", linewidth=0.5)
        axes.grid()
    right.text(SLIVER, right.get_ylim()[1], " sliver of $10^{-8} h$", va="top")
    left.legend()
    save(figure, path)


PROGRAM = Program("cases.showcase.cut_cells", __doc__)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table and draw it."""
    PROGRAM.start(arguments)
    rows = study()
    print(as_text(rows, COLUMNS))
    draw(rows, PROGRAM.folder / "cut_cells.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
