"""Full and cut cells filled with particles.

A full cell gets per_axis x per_axis particles. The part of a cut cell that a shape covers is divided
into triangles, with the points of a Gauss rule in each. Where these are more than 28, they are replaced
by at most 28 that have the same moments (`moment_fitting`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.checks import instance, room, shown, switch, whole_number
from tawami.base.errors import InputError
from tawami.base.space import lattice, tensor_product
from tawami.body.body import Body
from tawami.body.moment_fitting import fewer
from tawami.body.part import Part
from tawami.body.points import ROUND_OFF, Points, joined
from tawami.border.pieces import Border
from tawami.grid.grid import Grid

#: Default number of particles per cell and axis. With 2 the sums over cells are less exact: the error
#: under a strip load is three times as large (tests/body/test_per_axis.py).
PER_AXIS = 3
#: Largest Gauss rule along an axis.
MOST_POINTS = 1000
#: Memory of a particle while a body is filled and in the arrays of a scene [bytes].
BYTES_PER_PARTICLE = 128.0


class Filling:
    """Arguments of all shapes: they define how the cells of a grid are filled with particles.

    Attributes:
        grid: The grid.
        per_axis: Particles per full cell and axis.
        points: Their positions along an axis, in a cell from 0 to 1.
        weights: Their weights along an axis.

    Args:
        shape: Name of the shape, for error messages.
        grid: The grid.
        per_axis: Particles per full cell and axis.
        gauss: Whether they are at the Gauss points with the Gauss weights.

    Raises:
        InputError: An argument is of another type or out of its range, or memory does not suffice.
    """

    def __init__(self, shape: str, grid: Any, per_axis: int, gauss: bool) -> None:
        instance(f"{shape}: grid", grid, Grid, "a tawami.Grid")
        self.grid: Grid = grid
        self.per_axis = whole_number("per_axis", per_axis, low=1)
        self.check_memory(1)
        n = self.per_axis
        if switch("gauss", gauss):
            self.points, self.weights = _rust.gauss(
                whole_number("per_axis", n, low=1, high=MOST_POINTS)
            )
        else:
            self.points, self.weights = (np.arange(n) + 0.5) / n, np.full(n, 1 / n)

    @property
    def per_cell(self) -> int:
        """Particles per full cell."""
        return int(self.per_axis**self.grid.space.dim)

    def check_memory(self, cells: int) -> None:
        """Check that there is memory for the particles of this number of full cells.

        Raises:
            InputError: There is not enough.
        """
        what = f"per_axis = {shown(self.per_axis)} in {cells} cell{'s' if cells > 1 else ''}"
        of_rank = BYTES_PER_PARTICLE / self.grid.comm.size
        room(what, cells * self.per_cell, of_rank, "expected fewer particles")

    def in_full_cells(self, cell: Indices, material: Indices) -> Points:
        """The particles of full cells, given the numbers of cells and of their materials."""
        self.check_memory(max(len(cell), 1))
        dim = self.grid.space.dim
        corner = self.grid.cell_indices(cell)
        return Points(
            (corner[:, None] + lattice([self.points] * dim)).reshape(-1, dim),
            np.tile(tensor_product([self.weights] * dim), len(cell)),
            np.repeat(cell, self.per_cell),
            np.repeat(material, self.per_cell),
        )

    def body(
        self,
        full: Indices,
        cut: Points,
        *,
        material: Indices | None = None,
        names: tuple[str, ...] | None = None,
        border: Border | None,
        allowed: Callable[[Array], Mask] | None = None,
    ) -> Body:
        """The particles of full and of cut cells; a collective call.

        Args:
            full: Numbers of the full cells of this rank, ascending.
            cut: Points that integrate over parts of cells of this rank.
            material: Number of the material of each full cell.
            names: Names of the materials; None for a body of one material.
            border: The border of the body.
            allowed: Tells which positions (n x dim) are inside the shape; by default all are.

        Raises:
            InputError: There is no particle.
        """
        grid = self.grid
        material = np.zeros_like(full) if material is None else material
        area = ranks.total(grid.comm, len(full) + cut.weight.sum())
        with ranks.raise_together(grid.comm):
            key = cut.cell * max(len(names or ()), 1) + cut.material
            in_full = self.in_full_cells(full, material)
            in_cut, key = self._thinned(cut, key, ROUND_OFF * min(1.0, float(area)), allowed)
        parts = joined([in_full, in_cut])
        if not ranks.anywhere(grid.comm, len(parts.x) > 0):
            raise InputError("the body has no particles: expected a shape with an area")
        x, volume = grid.in_metres(parts.x), grid.space.measure(grid.h) * parts.weight
        number = None if names is None else parts.material.astype(np.uint32)
        groups = (full, np.full(len(full), self.per_cell)), np.unique(key, return_counts=True)
        part = Part.of_cells(grid, *groups)
        body = Body(x, volume, number, names or (), grid.lattice, border, part)
        return body.in_own_cells()

    def _thinned(
        self,
        points: Points,
        key: Indices,
        least: float,
        allowed: Callable[[Array], Mask] | None,
    ) -> tuple[Points, Indices]:
        """At most 28 points for each material in each cell, and their keys, ascending.

        Args:
            points: Points that integrate over parts of cells.
            key: Key of cell and material of each.
            least: Area of a part that is round-off, and gets none [cells^2].
            allowed: As in `body`.
        """
        order = np.argsort(key, kind="stable")
        starts = np.flatnonzero(np.diff(key[order], prepend=-1))
        parts, keys = [points[:0]], [key[:0]]
        ends = np.append(starts, len(order))[1:]
        points, key = points[order], key[order]
        for begin, end in zip(starts, ends, strict=True):
            x, weight = points.x[begin:end], points.weight[begin:end]
            if weight.sum() <= least:
                continue
            inside = np.ones(len(x), dtype=bool) if allowed is None else allowed(x)
            x, weight = fewer(x, weight, inside)
            first = np.full(len(x), begin)
            parts.append(Points(x, weight, points.cell[first], points.material[first]))
            keys.append(key[first])
        return joined(parts), np.concatenate(keys)
