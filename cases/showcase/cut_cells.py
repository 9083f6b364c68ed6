"""A block that slides over the grid: what cells that it fills in part do to answer and condition.

A block of 6 x 6 cells hangs at its middle, and its lower half stretches under its weight. The same
particles are shifted to the right and up by parts of a cell, once by so much that rows of them lie in
the next cells by 1e-8 h only. With and without the ghost penalty; condition numbers are those of the
scaled matrix, and of the same before scaling.

python -m cases.showcase.cut_cells [--results results/cut_cells]
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

import tawami
from cases.common import table
from cases.common.figure import save
from tawami.fem.environment import header
from tawami.results.output import result_folder

H, N = 0.25, 6  # cell [m], cells along a side of the block
E, NU, RHO, G = 1e6, 0.49, 1000.0, 10.0  # [Pa], [-], [kg/m3], [m/s2]
SLIVER = 0.25 + 1e-8
OFFSETS = (*np.arange(10) / 10, SLIVER)
METHODS = {
    "u_epsv": {"form": "u_epsv", "alpha": 0.1},
    "u_epsv, ghost": {"form": "u_epsv", "alpha": 0.1, "ghost_penalty": "on"},
    "u_epsv, alpha = 0": {"form": "u_epsv", "alpha": 0.0},
    "u_bbar": {"form": "u_bbar"},
    "u": {"form": "u"},
}


@dataclass(frozen=True)
class Row:
    """One computation: offset in cells, how much longer the block is [m], its error against the
    offset 0 [%], condition numbers.
    """

    method: str
    offset: float
    stretch: float
    change_percent: float
    condition: float
    unscaled: float

    @property
    def where(self) -> str:
        """The offset in words."""
        return f"{self.offset:.1f}" if self.offset != SLIVER else "0.25 + 1e-8"


COLUMNS = ("method", "where", "stretch", "change_percent", "condition", "unscaled")


def build(method: str, offset: float) -> tawami.Scene:
    """The block, shifted by an offset in cells."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=H, cells=(N + 3, N + 3))
    body = tawami.box(grid, (H, H), ((N + 1) * H, (N + 1) * H))
    body = tawami.Body(body.x + offset * H, body.volume)
    material = tawami.linear_elastic(E=E, nu=NU)
    scene = tawami.Scene(grid, body, material, density=RHO, **METHODS[method])
    scene.gravity((0.0, -G))
    middle = (1 + N / 2 + offset) * H
    scene.hold((middle - H, middle), "y")
    scene.hold((middle + H, middle), "y")
    scene.hold((middle, middle), "x")
    return scene


def solve(method: str, offset: float, reference: float | None = None) -> Row:
    """Stretch and conditions at one offset."""
    scene = build(method, offset)
    solution = scene.solve()
    u, y = solution.displacement_of_particles[:, 1], scene.particles.x[:, 1]
    middle = (1 + N / 2 + offset) * H
    stretch = float(u[np.abs(y - middle) < H / 2].mean() - u[y < y.min() + H / 4].mean())
    reduction = scene.reduction()
    matrix = scene.tangent(np.zeros(scene.num_coefficients))
    reduced = (reduction.selection.T @ matrix @ reduction.selection).toarray()
    singular = np.linalg.svd(reduced, compute_uv=False)
    change = 0.0 if reference is None else 100 * (stretch / reference - 1)
    return Row(method, offset, stretch, change, solution.condition, singular[0] / singular[-1])


def study() -> list[Row]:
    """Every method at every offset."""
    rows: list[Row] = []
    for method in METHODS:
        first = solve(method, 0.0)
        rows += [first] + [solve(method, offset, first.stretch) for offset in OFFSETS[1:]]
    return rows


def draw(rows: Sequence[Row], path: Path) -> None:
    """Change of the answer and condition number over the offset."""
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
        axes.grid(alpha=0.3)
    right.text(SLIVER, right.get_ylim()[1], " sliver of $10^{-8} h$", va="top", fontsize=8)
    left.legend(fontsize=8)
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, draw it, say where."""
    parser = argparse.ArgumentParser(prog="python -m cases.showcase.cut_cells", description=__doc__)
    parser.add_argument("--results", default="results/cut_cells", help="folder for the results")
    options = parser.parse_args(arguments)
    matplotlib.use("Agg")
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header(), flush=True)
    folder = result_folder(options.results)
    rows = study()
    print(table.as_text(rows, COLUMNS))
    draw(rows, folder / "cut_cells.png")
    print(f"Results: {folder / 'cut_cells.png'}")


if __name__ == "__main__":
    tawami.run(main, "cut_cells")
