"""The error of a quantity by dual-weighted residuals, split by its sources (docs: error)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base import checks, html
from tawami.base.arrays import Array
from tawami.base.errors import InputError, NotModelledError
from tawami.base.space import lattice
from tawami.body import rings
from tawami.body.within import within
from tawami.field.border import PointsInCells
from tawami.field.layout import Layout
from tawami.grid.basis import greville
from tawami.grid.grid import Grid
from tawami.particles import placement
from tawami.picture import style
from tawami.picture.figure import lay_out, shown_axes
from tawami.picture.particles import Squares, draw_border, draw_frame, scale_of, size_of
from tawami.scene.configuration import Configuration
from tawami.scene.goal import Goal
from tawami.scene.level import Level, Points, coarser, prolongation, with_volume
from tawami.scene.load import Forces
from tawami.scene.model import Model
from tawami.scene.outline import Outline
from tawami.scene.presentation import corners_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Gauss points per axis of a full cell, which integrate the residual exactly.
POINTS = 3
#: Ratio of the differences between grids below which they tell nothing, its smallest and largest value
#: that is used (orders 1 and 6), and the one that is used instead (order 4, that of smooth solutions).
IRREGULAR, SLOWEST, FASTEST, SMOOTH = 0.5, 2.0, 64.0, 16.0
#: Forces out of balance, relative to the loads, above which the state has another history.
SAME_STATE = 1e-3


@dataclass(frozen=True)
class ErrorEstimate:
    """The estimated error of a quantity, exact minus computed value.

    Attributes:
        goal: The quantity.
        value: Its computed value, in its unit.
        parts: The error by source: 'grid', 'particles' (as quadrature), 'stabilisation', 'Newton'.
        order: Observed order of convergence with h of the part 'grid'; NaN if it is irregular. Near or
            below 0 the quantity has no limit.
        cells: Contributions of the cells to each part, ny x nx.
    """

    goal: Goal
    value: float
    parts: Mapping[str, float]
    order: float
    cells: Mapping[str, Array] = field(repr=False)
    _grid: Grid = field(repr=False)
    _outline: Outline | None = field(repr=False)

    @property
    def error(self) -> float:
        """The estimated error: the sum of its parts."""
        return float(sum(self.parts.values()))

    def __repr__(self) -> str:
        parts = ", ".join(f"{name} {part:.2g}" for name, part in self.parts.items())
        return (
            f"ErrorEstimate({self.goal.name} = {self.value:.6g} {self.goal.unit}, error "
            f"{self.error:.2g} {self.goal.unit}: {parts}; order {self.order:.1f})"
        )

    def _repr_html_(self) -> str:
        rows = {"value": f"{self.value:.6g} {self.goal.unit}"}
        rows["error"] = f"{self.error:.2g} {self.goal.unit}"
        rows |= {name: f"{part:.2g} {self.goal.unit}" for name, part in self.parts.items()}
        return html.table(f"Error of {self.goal.name}", rows | {"order": f"{self.order:.1f}"})

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
    """The error of a quantity of a static solution; see `Solution.error`.

    Args:
        now: The scene.
        goal: The quantity.
        coefficients: The solution, of all fields since the start.
        load: Share of the loads that it is in equilibrium with; NaN in dynamics.
    """
    if not isinstance(goal, Goal):
        raise InputError(
            f"error({checks.shown(goal)}): expected a quantity, as "
            "tawami.Goal.displacement((2, 0), 'y') or tawami.Goal.mean_stress()"
        )
    _check(now, coefficients, load)
    arrays, model = placement.gathered(now.model.grid, now.domain.particles), with_volume(now.model)
    particles = Points(
        arrays["x"], arrays["volume"].ravel(), arrays["material"].ravel().astype("u4")
    )
    own = Level(now, now.model, particles)
    form, plain = (own.residual(coefficients, stabilised=s) for s in (True, False))
    _check_state(own, form, plain)
    body = _exact(now.model, particles)
    exact = Level(now, model, body)
    at = coefficients if model is now.model else _with_volume(own, exact, coefficients)
    weights = goal.weights(exact.domain, now.border)
    z, n = exact.dual(weights, at), len(form)
    residual = exact.residual(at, stabilised=False)
    of_particles = -residual * z
    of_particles[:n] += plain * z[:n]
    first = -float(residual @ z)
    on_grid, ratio = _of_grid(now, exact, body, at, weights, z, first)
    parts = {
        "grid": (exact.layout, on_grid),
        "particles": (exact.layout, of_particles),
        "stabilisation": (own.layout, (form - plain) * z[:n]),
        "Newton": (own.layout, -form * z[:n]),
    }
    return ErrorEstimate(
        goal,
        float(weights @ at),
        {name: float(values.sum()) for name, (_, values) in parts.items()},
        float(np.log2(ratio)) if ratio > 0 else np.nan,
        {name: _in_cells(*part) for name, part in parts.items()},
        now.model.grid,
        None
        if now.border.points is None
        else Outline(now.border.points, now.domain, own.layout.split(coefficients)[0]),
    )


def _of_grid(
    now: Configuration,
    exact: Level,
    body: Points,
    at: Array,
    weights: Array,
    z: Array,
    first: float,
) -> tuple[Array, float]:
    """Contributions of the coefficients to the error of the grid, and the ratio of its differences.

    With the errors e, e_2, e_4 of the computed value by the dual solutions on cells of h, 2h and 4h, that
    of the grid is (e - e_2)/(ratio - 1), ratio = (e_2 - e_4)/(e - e_2) (Richardson).

    Args:
        now: The scene.
        exact: It on its grid, with exact integrals.
        body: The particles of this.
        at: The solution.
        weights: Derivative of the quantity.
        z: The dual solution.
        first: e.
    """
    level, state, of_level, up = exact, at, weights, None
    errors, local = [first], list[Array]()
    for _ in range(2):
        model = replace(exact.domain.model, grid=coarser(level.domain.model.grid))
        coarse, down = Level(now, model, body), prolongation(level.layout)
        state, of_level = coarse.nearest(level.layout, down, state), down.T @ of_level
        up = down if up is None else up @ down
        here, of_coarse = up @ state, up @ coarse.dual(of_level, state)
        residual = exact.residual(here, stabilised=False)
        errors.append(float(weights @ (here - at) - residual @ of_coarse))
        local.append(-residual * (z - of_coarse))
        level = coarse
    fine, before = -np.diff(errors)
    ratio = before / fine if fine else np.inf
    used = min(max(ratio, SLOWEST), FASTEST) if ratio > IRREGULAR else SMOOTH
    found, size = local[0] / (used - 1), np.abs(local[0])
    missing = fine / (used - 1) - found.sum()
    return found + missing * size / max(size.sum(), np.finfo(float).tiny), float(ratio)


def _exact(model: Model, particles: Points) -> Points:
    """Points that integrate exactly over the body within its border."""
    assert model.border is not None
    body = within(model.grid, model.border, POINTS)
    of = np.zeros(len(body.x), dtype=np.uint32)
    if particles.material.any():
        from scipy.spatial import cKDTree

        of = particles.material[cKDTree(particles.x).query(body.x)[1]]
    return Points(body.x, rings.volumes(model.grid, body.x, body.volume), of)


def _check(now: Configuration, coefficients: Array, load: float) -> None:
    """Check that the error of a solution can be estimated.

    Raises:
        InputError: The solution is not static or not that of the scene now, or the body has no border.
        NotModelledError: The scene has something that is not modelled here.
    """
    model = now.model
    if np.isnan(load):
        raise NotModelledError(
            "error(...) of a solution in motion: expected that of a static scene"
        )
    if model.moves:
        raise NotModelledError(
            f"error(...) with form {model.form.name}: expected a form of small strain: at finite strain "
            "each step has a body of its own"
        )
    if now.total is not coefficients:
        raise InputError(
            "error(...): the scene has changed since this solution: expected the call before the next "
            "solve()"
        )
    absent = {
        "fields without a role": model.form.own_fields,
        "data of particles": model.form.data or model.in_space,
        "sums over the border": model.compiled.border,
        "walls": now.supports.walls,
        "obstacles": now.obstacles.all,
        "forces on particles": any(isinstance(load, Forces) for load in now.loads.all),
        "removed particles": now.left or now.loads.unbalanced is not None,
        "a load that is applied in part": load != 1.0,
    }
    for what, found in absent.items():
        if found:
            raise NotModelledError(
                f"error(...): the scene has {what}: expected displacement and volume as fields, "
                "supports, tractions, pressures and gravity"
            )
    if model.border is None:
        raise InputError(
            "error(...): the body has no border, within which the equations are integrated: expected "
            "Body(x, volume, border=tawami.polyline(corners))"
        )


def _check_state(own: Level, form: Array, plain: Array) -> None:
    """Check that particles which were never loaded are in equilibrium at the solution.

    Raises:
        NotModelledError: They are not.
    """
    if own.on_patches:
        raise NotModelledError(
            f"error(...): {own.on_patches[0].support} holds a border inside of cells: expected supports "
            "on edges of the grid, or hold(...)"
        )
    n, tolerance = own.layout.num_displacement, own.domain.newton.numerics.tolerance
    size = max(np.linalg.norm((plain + own.external)[:n]), np.linalg.norm(own.external[:n]))
    if (
        np.linalg.norm(own.reduction.restricted(form)[own.reduction.of_displacement])
        > max(SAME_STATE, 10 * tolerance) * size
    ):
        raise NotModelledError(
            "error(...): the stress is not the law's response to the displacement under the present "
            "loads: expected a scene without initial stress, flow in one step, and loads and supports "
            "as they were in solve()"
        )


def _with_volume(own: Level, exact: Level, u: Array) -> Array:
    """All coefficients with the volumetric strain, as its mean around each function."""
    domain, place = own.domain, exact.layout.volumetric
    assert place is not None
    location, grid = domain.location, domain.model.grid
    if domain.model.form.kinematics.volume_at_centre:
        location = grid.rust.place(location.cell, np.full_like(np.asarray(location.xi), 0.5))
    vectors = grid.space.vectors(u)
    slopes = PointsInCells(grid, location).slopes(domain.layout.basis)
    strain = sum(slope @ along for slope, along in zip(slopes, vectors.T, strict=True))
    columns = np.column_stack([strain, np.ones(len(strain))])
    sums, volume = domain.sums(domain.particles.volume, columns, place.basis).T
    return np.concatenate([u, np.divide(sums, volume, out=np.zeros_like(sums), where=volume > 0)])


def _in_cells(layout: Layout, values: Array) -> Array:
    """Sums over the functions with their Greville points in each cell, ny x nx."""
    grid, total = layout.grid, np.zeros(layout.grid.num_cells)
    for place in layout.fields.values():
        points = grid.in_cells(greville(place.basis, *grid.lattice))
        sums = values[place.slice].reshape(-1, place.components).sum(axis=1)
        total += np.bincount(grid.cell_numbers(grid.cell_at(points)), sums, grid.num_cells)
    return total.reshape(grid.cells[::-1])
