"""The error of a quantity by dual-weighted residuals, split by its sources (docs: error)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base import checks, html
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.space import lattice
from tawami.estimate import estimable
from tawami.estimate.dual_solutions import DualSolutions, exact_points
from tawami.estimate.goal import Goal
from tawami.estimate.level import Level, Points, with_volume
from tawami.field.layout import Layout
from tawami.grid.basis import greville
from tawami.grid.grid import Grid
from tawami.picture import style
from tawami.picture.figure import lay_out, shown_axes
from tawami.picture.particles import Squares, draw_border, draw_frame, scale_of, size_of
from tawami.quantities.outline import Outline
from tawami.quantities.presentation import corners_of
from tawami.step.configuration import Configuration

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class ErrorEstimate:
    """The estimated error of a quantity, exact minus computed value.

    Attributes:
        goal: The quantity.
        value: Its computed value, in its unit.
        parts: The error by source: 'grid', 'particles' (as quadrature), 'stabilisation', 'Newton'.
        order: Observed order of convergence with h of the part 'grid'; NaN if it is irregular or if this
            part is as small as round-off. Near or below 0 the quantity has no limit.
        cells: Contributions of the cells to each part, ny x nx.
    """

    goal: Goal
    value: float
    parts: Mapping[str, float]
    order: float
    cells: Mapping[str, Array] = field(repr=False)
    _at_round_off: bool = field(repr=False)
    _grid: Grid = field(repr=False)
    _outline: Outline | None = field(repr=False)

    @property
    def error(self) -> float:
        """The estimated error: the sum of its parts."""
        return float(sum(self.parts.values()))

    @property
    def _order(self) -> str:
        """The order in words."""
        if self._at_round_off:
            return "at round-off"
        return "irregular" if np.isnan(self.order) else f"{self.order:.1f}"

    def __repr__(self) -> str:
        parts = ", ".join(f"{name} {part:.2g}" for name, part in self.parts.items())
        return (
            f"ErrorEstimate({self.goal.name} = {self.value:.6g} {self.goal.unit}, error "
            f"{self.error:.2g} {self.goal.unit}: {parts}; order {self._order})"
        )

    def _repr_html_(self) -> str:
        rows = {"value": f"{self.value:.6g} {self.goal.unit}"}
        rows["error"] = f"{self.error:.2g} {self.goal.unit}"
        rows |= {name: f"{part:.2g} {self.goal.unit}" for name, part in self.parts.items()}
        return html.table(f"Error of {self.goal.name}", rows | {"order": self._order})

    @style.used()
    def plot(self, part: str | None = None, axes: Axes | None = None) -> Axes:
        """Draw the contributions of the cells.

        Args:
            part: One of `parts`; their sum by default.
            axes: Of matplotlib; in a new figure of pyplot by default.

        Raises:
            InputError: No such part.
            MissingDependencyError: matplotlib is not installed.
        """
        if part is not None:
            checks.choice("part", part, tuple(self.cells))
        values = sum(self.cells.values()) if part is None else self.cells[part]
        grid, corners, new = self._grid, corners_of(self._grid), axes is None
        axes = axes or shown_axes(*size_of(corners.lower, corners.upper))
        draw_frame(axes, corners.lower, corners.upper, corners)
        some = np.flatnonzero(np.any([v.ravel() for v in self.cells.values()], axis=0))
        shown = np.ravel(values)[some]
        name = f"error of {self.goal.name}" + ("" if part is None else f", {part}")
        squares = Squares(axes, scale_of("contribution of a cell", self.goal.unit, [shown]))
        centres = grid.in_metres(lattice([np.arange(n) for n in grid.cells]) + 0.5)
        squares.show(centres[some], grid.h, shown)
        if self._outline is not None:
            draw_border(axes, self._outline.sides(0.0))
        (squares.add_bar if new else squares.add_bar_beside)(axes)
        axes.set_title(name)
        if new:
            lay_out(axes.get_figure(root=True))
        return axes


def estimate(now: Configuration, goal: Any, coefficients: Array, load: float) -> ErrorEstimate:
    """Estimate the error of a quantity of a static solution of small strain, on one rank.

    Args:
        now: The scene.
        goal: The quantity.
        coefficients: The solution, of all fields since the start.
        load: Share of the loads that it is in equilibrium with; NaN in dynamics.

    Raises:
        InputError: No such quantity, a point outside the body, a body without a border, or a scene that
            has changed since.
        NotModelledError: A solution in motion or at finite strain, or a scene with walls, contact, more
            fields, flow in several steps, ...
    """
    if not isinstance(goal, Goal):
        raise InputError(
            f"error({checks.shown(goal)}): expected a quantity, as "
            "tawami.Goal.displacement((2, 0), 'y') or tawami.Goal.mean_stress()"
        )
    estimable.check(now, coefficients, load)
    layout = now.domain.layout
    particles, model = now.domain.particles, with_volume(now.model)
    body = Points(*map(np.array, (particles.x, particles.volume, particles.material)))
    own = Level(now, now.model, body)
    form, plain = (own.residual(coefficients, stabilised=s) for s in (True, False))
    estimable.check_state(own, coefficients, form, plain)
    at = coefficients if model is now.model else own.with_volume(model.form, coefficients)
    exact = replace(model, volumes="own")
    whole = Level(now, exact, exact_points(model.grid, exact, body))
    dual = DualSolutions(now, exact, whole, body, goal, at)
    z = dual.z[: layout.size]
    of_particles = -dual.residual * dual.z
    of_particles[: layout.size] += plain * z
    parts = {
        "grid": (dual.fine, dual.of_grid),
        "particles": (whole.layout, of_particles),
        "stabilisation": (layout, (form - plain) * z),
        "Newton": (layout, -form * z),
    }
    points = now.border.points
    return ErrorEstimate(
        goal,
        dual.value,
        {name: float(values.sum()) for name, (_, values) in parts.items()},
        dual.order,
        {name: _in_cells(now.model.grid, *part) for name, part in parts.items()},
        dual.at_round_off,
        now.model.grid,
        None if points is None else Outline(points, now.domain, coefficients),
    )


def _in_cells(grid: Grid, layout: Layout, values: Array) -> Array:
    """Sums over the functions with their Greville points in each cell of a grid, ny x nx."""
    total = np.zeros(grid.num_cells)
    for place in layout.fields.values():
        points = grid.in_cells(greville(place.basis, *layout.grid.lattice))
        sums = values[place.slice].reshape(-1, place.components).sum(axis=1)
        total += np.bincount(grid.cell_numbers(grid.cell_at(points)), sums, grid.num_cells)
    return total.reshape(grid.cells[::-1])
