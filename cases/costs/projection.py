"""Errors of projecting stresses from particles to the vertices of the grid.

The particles carry the bending and shear stress of a cantilever,

    sigma_xx = P (L - x) y / I,    sigma_xy = -P (D^2/4 - y^2) / 2 I,

with L = 2 m, D = 1 m and P = 1 kN per metre depth. The projected stresses are compared with these
formulas at the vertices of cells with particles. Errors are root mean squares and maxima, over
max |sigma|. The consistent projection is solved iteratively, and directly for comparison; the condition
number is that of its matrix with rows and columns scaled to ones on the diagonal.

python -m cases.costs.projection
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.common.program import Program
from cases.common.table import as_text
from tawami.results.projection import nodal, vertices

Array = npt.NDArray[np.float64]
L, D, P = 2.0, 1.0, 1e3  # [m], [m], [N per metre depth]
I = D**3 / 12  # noqa: E741 - second moment of area of the beam
COLUMNS = ("particles", "n", "method", "bending_rms", "bending_max", "shear_rms", "shear_max",
           "condition")  # fmt: skip


@dataclass(frozen=True)
class Row:
    """Errors of one projection, over max |sigma|.

    Attributes:
        particles: Arrangement of the particles.
        n: Cells over the height.
        method: Method of projection.
        bending_rms, bending_max: Errors of sigma_xx.
        shear_rms, shear_max: Errors of sigma_xy.
        condition: Condition number of the matrix, if it was solved directly.
    """

    particles: str
    n: int
    method: str
    bending_rms: float
    bending_max: float
    shear_rms: float
    shear_max: float
    condition: float | None = None


def stresses(x: Array) -> Array:
    """sigma_xx and sigma_xy [Pa] at points, points x 2."""
    y = x[:, 1]
    return np.column_stack([P * (L - x[:, 0]) * y / I, -P * (D**2 / 4 - y**2) / (2 * I)])


def scene_of(particles: str, n: int) -> tawami.Scene:
    """The beam with 2 x 2 particles per cell as a lattice, moved by a part of a cell, or at random."""
    h = D / n
    grid = tawami.Grid(MPI.COMM_SELF, origin=(-h, -D / 2 - h), h=h, cells=(2 * n + 3, n + 3))
    body = tawami.box(grid, (0.0, -D / 2), (L, D / 2), per_axis=2)
    x, shift = body.x, {"lattice": 0.0, "moved": 0.37 * h, "random": 0.0}[particles]
    if particles == "random":
        x = np.random.default_rng(0).uniform((0.0, -D / 2), (L, D / 2), x.shape)
    body = tawami.Body(x + shift, body.volume)
    return tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3))


def consistent(scene: tawami.Scene, values: Array) -> tuple[Array, float]:
    """Solve the consistent projection directly.

    Returns:
        Values at the vertices, vertices x columns, and the condition number of the scaled matrix.
    """
    x = (np.asarray(scene.particles.x) - scene.grid.origin) / scene.grid.h
    cell = np.floor(x).astype(int)
    t, stride = x - cell, scene.grid.cells[0] + 1
    M = np.zeros((len(x), stride * (scene.grid.cells[1] + 1)))
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = np.where(i, t[:, 0], 1 - t[:, 0]) * np.where(j, t[:, 1], 1 - t[:, 1])
        M[np.arange(len(x)), cell[:, 0] + i + stride * (cell[:, 1] + j)] = weight
    near = M.any(axis=0)
    weighted = np.asarray(scene.particles.volume)[:, None] * M[:, near]
    matrix, right = M[:, near].T @ weighted, weighted.T @ values
    scale = 1 / np.sqrt(np.diag(matrix))
    scaled = scale[:, None] * matrix * scale
    found = np.full((M.shape[1], values.shape[1]), np.nan)
    found[near] = scale[:, None] * np.linalg.lstsq(scaled, scale[:, None] * right, rcond=None)[0]
    return found, float(np.linalg.cond(scaled))


def rows_of(particles: str, n: int) -> list[Row]:
    """Errors of every projection for one arrangement of particles."""
    scene = scene_of(particles, n)
    values, exact = stresses(np.asarray(scene.particles.x)), stresses(vertices(scene))
    direct, condition = consistent(scene, values)
    found = {"lumped": nodal(scene, values), "consistent": nodal(scene, values, "consistent"),
             "direct": direct}  # fmt: skip
    rows = []
    for method, projected in found.items():
        near = np.isfinite(projected[:, 0])
        errors = np.abs(projected - exact)[near] / np.abs(values).max(axis=0)
        rms, most = np.sqrt((errors**2).mean(axis=0)), errors.max(axis=0)
        rows.append(
            Row(particles, n, method, rms[0], most[0], rms[1], most[1],
                condition if method == "direct" else None)
        )  # fmt: skip
    return rows


PROGRAM = Program("cases.costs.projection", __doc__, files=False)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    PROGRAM.start(arguments)
    kinds = ("lattice", "moved", "random")
    print(as_text([row for kind in kinds for n in (4, 8, 16) for row in rows_of(kind, n)], COLUMNS))


if __name__ == "__main__":
    PROGRAM.run(main)
