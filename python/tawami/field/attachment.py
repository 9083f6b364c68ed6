"""A compiled form attached to the active cells of a grid, as both assemblies use it."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Mask
from tawami.base.timing import Stopwatch
from tawami.fem.rules import Rule, rule_points
from tawami.field.cut_cells import Side, full_cells, sides
from tawami.field.layout import Layout
from tawami.form.compilation import CompiledForm
from tawami.form.integral import Integral
from tawami.grid.basis import Basis
from tawami.grid.grid import Grid

#: Sum over the particles of a spline below which round-off of the assembly hides its stiffness: that of
#: a particle 4e-7 of a cell inside the support. Such a spline follows its neighbour, as if the particle
#: had not arrived. A ghost penalty gives the displacement a stiffness instead. Lagrange functions need
#: no tie: their gradients do not vanish with them, and biquadratic ones have negative sums as well.
UNRESOLVED = 1e-13


class Attachment:
    """A compiled form on the active cells of a grid.

    Args:
        grid: The grid.
        compiled: The form.
        basis: Basis of the displacement.
        location: Cells and positions of this rank's particles.
        volume: Their volumes [m2 per metre depth].
        parameters: Parameters of the form (alpha, ...).
        stopwatch: Measures the time of each stage.

    Attributes:
        active: Whether each cell of the rank's window holds particles, on any rank, ny x nx.
        layout: Places of the coefficients.
        sides: Sides of partially filled cells of this rank, if the form has a ghost penalty.
        has_sides: Whether any rank has such a side.
        points: Indices along the axes of the points of each rule; none for means over cells.
        values: Values of h, time, dt, b and the parameters of the form; :meth:`change` replaces them.
        version: A number that changes with them.
        start: Coefficients at the start of a step, where particles do not move, without the volumetric
            field, whose equation is one of increments. The ghost penalty acts on their sum with the
            increments, as stress does, so that its forces do not fade from step to step.
    """

    def __init__(
        self,
        grid: Grid,
        compiled: CompiledForm,
        basis: Basis,
        location: _rust.Location,
        volume: Array,
        parameters: Mapping[str, float],
        stopwatch: Stopwatch,
    ) -> None:
        self.grid, self.compiled, self.stopwatch = grid, compiled, stopwatch
        self.location, self.volume = location, volume
        dim = grid.space.dim
        self.values: dict[str, Any] = {"h": grid.h, "time": 0.0, "dt": 0.0, "b": np.zeros(dim)}
        self.values |= parameters
        self.version = 0
        self.start: Array | None = None
        window = grid.window
        active: Mask = np.zeros(len(window.rank_of_cell), dtype=bool)
        active[location.active] = True
        self.active = window.of_cells.update(active).reshape(window.cells[::-1])
        self.layout = Layout(grid, basis, compiled.form.fields, self.active.ravel())
        self.sides: list[Side] = []
        if compiled.penalises:
            moves = compiled.form.strain.finite
            full = None if moves else full_cells(grid, location, volume)
            self.sides = list(sides(window, self.active, full))
        self.has_sides = ranks.anywhere(grid.comm, self.sides)
        weak = [
            name
            for name, place in self.layout.fields.items()
            if place.basis == "quadratic_spline" and (place.start > 0 or not self.has_sides)
        ]
        if weak:
            once = np.ones(len(volume))
            sums = self.layout.functions.sums(location, once, once[:, None], "quadratic_spline")
            self.layout.tie(weak, sums[:, 0], UNRESOLVED)
        self.points: dict[Rule, list[tuple[int, ...]]] = {
            rule: _point_indices(rule) for rule in compiled.densities
        }

    def constants(self, integral: Integral) -> Array:
        """Values of the constants that an integral names, one after the other."""
        values = [np.ravel(self.values[name]) for name in integral.constants]
        return np.asarray(np.concatenate([np.zeros(0), *values]), dtype=float)

    def change(self, values: Mapping[str, Any]) -> None:
        """Replace values of constants."""
        if any(np.any(self.values[name] != value) for name, value in values.items()):
            self.values |= values
            self.version += 1

    def begin(self, total: Array | None) -> None:
        """Begin a step where particles do not move, with all coefficients since the start."""
        self.start = None if total is None else np.array(total)
        if self.start is not None and self.layout.volumetric is not None:
            self.start[self.layout.volumetric.slice] = 0.0


@functools.lru_cache(maxsize=32)
def _point_indices(rule: Rule) -> list[tuple[int, ...]]:
    """Indices along each axis, in the rule of one axis, of each point of a rule of dolfinx."""
    if rule == "mean":
        return []
    points = rule_points(rule)
    along = np.array([0.0, 1.0])
    if rule != "vertex":
        along, _ = _rust.gauss(round(len(points) ** (1 / points.shape[1])))
    distance = np.abs(points[:, :, None] - along[None, None, :])
    if distance.min(axis=2).max() > 1e-12:
        raise RuntimeError("internal: dolfinx' quadrature is not the tensor Gauss rule")
    return [tuple(map(int, index)) for index in distance.argmin(axis=2)]
