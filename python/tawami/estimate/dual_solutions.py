"""Dual solutions on cells of h/2, h and 2h, and the error of the grid that they show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tawami.base.arrays import Array
from tawami.body import rings
from tawami.body.within import within
from tawami.domain.model import Model
from tawami.estimate.goal import Goal
from tawami.estimate.level import Level, Points
from tawami.field.prolongation import coarser
from tawami.grid.grid import Grid
from tawami.step.configuration import Configuration

#: Gauss points per axis of a full cell of h/2, which integrate the residual exactly.
POINTS = 3
#: Ratio of the differences between grids below which they tell nothing, its smallest and largest value
#: that is used (orders 1 and 6), and the one that is used instead (order 4, that of smooth solutions).
IRREGULAR, SLOWEST, FASTEST, SMOOTH = 0.5, 2.0, 64.0, 16.0
#: Difference between grids that counts as round-off, relative to the absolute terms of the quantity.
ROUND_OFF = 1e-9


class DualSolutions:
    """Dual solutions for a quantity on three grids.

    With z', z and z_2 on cells of h/2, h and 2h, the solution c and one on cells of 2h, c_2, the
    differences between grids are d = -R(c; z' - z) and d_2 = -R(c_2; z - z_2). With ratio = d_2/d the
    error of the grid is d ratio/(ratio - 1) (Richardson).

    Args:
        now: The scene.
        model: Its model with a field for the volume.
        whole: The scene on its grid, with this model.
        body: Its particles.
        goal: The quantity.
        coefficients: The solution on cells of h.

    Attributes:
        fine: Places of the coefficients on cells of h/2.
        value: The quantity.
        residual: Exact residual without stabilisation on the coefficients of cells of h.
        z: The dual solution there.
        of_grid: Contributions of the coefficients of cells of h/2 to the error of the grid.
        at_round_off: Whether this error is as small as round-off.
        order: Order of this error in h; NaN if it is irregular or at round-off.
    """

    def __init__(
        self,
        now: Configuration,
        model: Model,
        whole: Level,
        body: Points,
        goal: Goal,
        coefficients: Array,
    ) -> None:
        grid = model.grid
        double = grid.halved
        half = Level(now, replace(model, grid=double), exact_points(double, model, body))
        self.fine = half.layout
        up = half.from_coarser
        at = up(coefficients)
        weights = goal.weights(half.domain, now.border)
        self.value = float(weights @ at)
        weights_here = up.transposed(weights)
        kept = now.domain.newton.kept(whole.reduction)
        self.z, again = whole.dual(weights_here, coefficients, kept)
        large = grid.with_cells(2 * grid.h, coarser(grid.cells))  # may reach beyond the grid
        twice = Level(now, replace(model, grid=large, volumes="full_cells"), body)
        down, state = whole.from_coarser, twice.smoothed(whole, coefficients)
        z, solve = twice.dual(down.transposed(weights_here), state)
        missing = twice.reduction.restricted(twice.residual(state, stabilised=True))
        state = state - twice.reduction.expanded(solve(missing))
        before = -whole.residual(down(state), stabilised=False) @ (self.z - down(z))
        residual = half.residual(at, stabilised=False)
        self.residual, start = up.transposed(residual), up(self.z)
        fine = half.dual_by_cycles(weights, at, residual, start, whole, again)
        self.of_grid = -residual * (fine - start)
        first = float(self.of_grid.sum())
        ratio = float(before) / first if first else np.inf
        used = min(max(ratio, SLOWEST), FASTEST) if ratio > IRREGULAR else SMOOTH
        self.at_round_off = abs(first) <= ROUND_OFF * float(np.abs(weights) @ np.abs(at))
        self.order = float(np.log2(ratio)) if ratio > 0 and not self.at_round_off else np.nan
        self.of_grid *= used / (used - 1)


def exact_points(grid: Grid, model: Model, particles: Points) -> Points:
    """Points that integrate exactly over the body within its border."""
    assert model.border is not None
    x, area = within(grid, model.border, POINTS)
    of = np.zeros(len(x), dtype=np.uint32)
    if particles.material.any():
        from scipy.spatial import cKDTree

        of = particles.material[cKDTree(particles.x).query(x)[1]]
    return Points(x, rings.volumes(grid, x, area), of)
