"""Dual solutions on cells of h/2, h and 2h, and the error of the grid that they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tawami.base.arrays import Array
from tawami.body import rings
from tawami.body.within import within
from tawami.field.prolongation import coarser
from tawami.grid.grid import Grid
from tawami.scene.configuration import Configuration
from tawami.scene.goal import Goal
from tawami.scene.level import Level, Points, prolongation
from tawami.scene.model import Model

#: Gauss points per axis of a full cell of h/2, which integrate the residual exactly.
POINTS = 3
#: Ratio of the differences between grids below which they tell nothing, its smallest and largest value
#: that is used (orders 1 and 6), and the one that is used instead (order 4, that of smooth solutions).
IRREGULAR, SLOWEST, FASTEST, SMOOTH = 0.5, 2.0, 64.0, 16.0


class DualSolutions:
    """Dual solutions for a quantity on three grids.

    Those on cells of h/2, h and 2h give the errors e', e and e_2 of the computed value, without the
    parts that these grids do not resolve. With ratio = (e - e_2)/(e' - e) the error of the grid is
    (e' - e) ratio/(ratio - 1) (Richardson).

    Args:
        now: The scene.
        model: Its model with a field for the volume.
        particles: Its particles.
        goal: The quantity.
        coefficients: The solution on cells of h.

    Attributes:
        fine, coarse: Places of the coefficients on cells of h/2 and h.
        value: The quantity.
        residual: Exact residual without stabilisation on the coefficients of cells of h.
        z: The dual solution there.
        of_grid: Contributions of the coefficients of cells of h/2 to the error of the grid.
        order: Order of this error in h; NaN if it is irregular.
    """

    def __init__(
        self,
        now: Configuration,
        model: Model,
        particles: Points,
        goal: Goal,
        coefficients: Array,
    ) -> None:
        grid = model.grid
        double = _with_cells(grid, grid.h / 2, [2 * n for n in grid.cells])
        half = Level(now, replace(model, grid=double), _exact(double, model, particles))
        body = _exact(grid, model, particles)
        whole = Level(now, model, body)
        self.fine, self.coarse = half.layout, whole.layout
        up = prolongation(self.fine)
        at = up @ coefficients
        weights = goal.weights(half.domain, now.border)
        self.value = float(weights @ at)
        weights_here = up.T @ weights
        self.z, again = whole.dual(weights_here, coefficients)
        matrix = half.transposed(at)
        residual = half.residual(at, stabilised=False)
        fine = half.finer_dual(matrix, whole, again, up, weights, self.z, residual)
        self.residual = up.T @ residual
        self.of_grid = -residual * (fine - up @ self.z)
        large = _with_cells(grid, 2 * grid.h, coarser(grid.cells))  # may reach beyond the grid
        twice, down = Level(now, replace(model, grid=large), body), prolongation(self.coarse)
        state = twice.nearest(self.coarse, down, coefficients)
        z, _ = twice.dual(down.T @ weights_here, state)
        there = up @ (down @ state)
        before = float(weights @ (there - at)) - float(
            half.residual(there, stabilised=False) @ (up @ (down @ z))
        )
        first = float(self.of_grid.sum())
        ratio = (-float(self.residual @ self.z) - before) / first if first else np.inf
        used = min(max(ratio, SLOWEST), FASTEST) if ratio > IRREGULAR else SMOOTH
        self.order = float(np.log2(ratio)) if ratio > 0 else np.nan
        self.of_grid *= used / (used - 1)


def _with_cells(grid: Grid, h: float, cells: Sequence[int]) -> Grid:
    """The grid with other cells, from the same corner on."""
    return Grid(grid.comm, origin=grid.origin, h=h, cells=cells, geometry=grid.geometry)


def _exact(grid: Grid, model: Model, particles: Points) -> Points:
    """Points that integrate exactly over the body within its border."""
    assert model.border is not None
    body = within(grid, model.border, POINTS)
    of = np.zeros(len(body.x), dtype=np.uint32)
    if particles.material.any():
        from scipy.spatial import cKDTree

        of = particles.material[cKDTree(particles.x).query(body.x)[1]]
    return Points(body.x, rings.volumes(grid, body.x, body.volume), of)
