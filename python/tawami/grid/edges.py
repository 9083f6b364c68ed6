"""Edges of the grid, their cells and functions; supports as constraints on displacements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError, SupportError
from tawami.grid.basis import Basis, values_1d
from tawami.grid.grid import Edge, Grid
from tawami.grid.space import PLANE

Component = Literal["x", "y"]
#: A part of an edge: from one line of the grid to another [m].
Interval = tuple[float, float]
#: A number, or a function of position f(x, y) on arrays.
Profile = float | Callable[[Array, Array], Any]


@dataclass(frozen=True)
class Held:
    """Coefficients that are prescribed: `indices` of one displacement component take `values`."""

    indices: Indices
    values: Array


@dataclass(frozen=True)
class PointHeld:
    """One multi-point constraint: `weights . coefficients[indices] = value`."""

    indices: Indices
    weights: Array
    value: float
    where: str
    place: tuple[float, float]


def component_index(component: str) -> int:
    """Number of a component of a vector: 0 for 'x', 1 for 'y'.

    Raises:
        InputError: Anything else.
    """
    return PLANE.axis(component)


def evaluate(profile: Profile, x: Array, y: Array, what: str) -> Array:
    """Values of a number or a function at points.

    Raises:
        InputError: The function fails, returns another shape, or returns NaN or infinity.
    """
    try:
        value = profile(x, y) if callable(profile) else profile
        values = np.broadcast_to(np.asarray(value, dtype=float), x.shape)
    except Exception as error:
        raise InputError(
            f"{what}: expected a number or a function f(x, y) on arrays of shape {x.shape}, got "
            f"{profile!r}, which gave {error!r}"
        ) from error
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        first = bad[0]
        raise InputError(
            f"{what}: {values[first]} at ({x[first]:g}, {y[first]:g}): expected a finite number"
        )
    return values


def held_edge(
    grid: Grid,
    basis: Basis,
    active: Mask,
    edge: Edge,
    component: int,
    value: Profile,
    between: Interval | None = None,
) -> Held:
    """One displacement component on an edge of the grid, the profile projected in L2.

    Only cells with particles count; functions that vanish on all of these are left out.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        active: Whether each cell holds particles, ny x nx.
        edge: Name of the edge.
        component: 0 or 1.
        value: Displacement [m] along the edge.
        between: Part of the edge [m]; all of it by default.

    Raises:
        SupportError: No cell along the edge holds particles.
    """
    axis, end = grid.edge(edge)
    along = 1 - axis
    touched = np.flatnonzero(
        np.take(active, end, axis=1 - axis) & cells_between(grid, edge, between)
    )
    if len(touched) == 0:
        raise SupportError(
            f"fix(edge='{edge}'): no cell along that edge of the grid holds particles: the support "
            "would not touch the body. Let the grid end where the body is held"
        )
    n = grid.cells[along]
    points, weights = _rust.gauss(5)
    cell, t = np.repeat(touched, 5), np.tile(points, len(touched))
    position = grid.axis_positions(along, cell, t)
    fixed = np.full_like(position, grid.upper[axis] if end else grid.origin[axis])
    x, y = (fixed, position) if axis == 0 else (position, fixed)
    prescribed = evaluate(value, x, y, f"fix(edge='{edge}')")
    values = values_1d(basis, n, cell, t)
    used = np.unique(values.indices)
    indices = 2 * edge_functions(grid, basis, edge)[used] + component
    if not callable(value) and np.ndim(value) == 0:
        return Held(indices, np.full(len(used), prescribed[0]))  # the functions add up to 1
    values = values[:, used]
    weighted = sp.diags(np.tile(weights, len(touched))) @ values
    coefficients = spsolve((weighted.T @ values).tocsc(), weighted.T @ prescribed)
    return Held(indices, coefficients)


def cells_between(grid: Grid, edge: Edge, between: Interval | None) -> Mask:
    """Mask of the cells along an edge that lie in a part of it.

    Raises:
        InputError: The part does not go from one line of the grid to a later one.
    """
    (axis,) = grid.space.other_axes(grid.edge(edge)[0])
    n = grid.cells[axis]
    if between is None:
        return np.ones(n, dtype=bool)
    ends = checks.pair(f"edge='{edge}': between", between, "positions [m]")
    low, high = (checks.number(f"edge='{edge}': between", end) for end in ends)
    found = grid.cells_between(axis, low, high)
    if found is None or found[0] >= found[1]:
        raise InputError(
            f"edge='{edge}': between = {checks.shown(between)}: expected two lines of the grid, in "
            f"order, every {grid.h:g} m from {grid.origin[axis]:g} to {grid.upper[axis]:g} m"
        )
    inside = np.zeros(n, dtype=bool)
    inside[slice(*found)] = True
    return inside


def edge_functions(grid: Grid, basis: Basis, edge: Edge) -> Indices:
    """Numbers of the displacement functions that do not vanish on an edge of the grid, along it."""
    axis, end = grid.edge(edge)
    shape = [_rust.basis_len(basis, n) for n in grid.cells]
    numbers = np.arange(np.prod(shape)).reshape(shape, order="F")
    functions: Indices = np.take(numbers, end, axis=axis)
    return functions


def held_point(
    grid: Grid,
    basis: Basis,
    active: Mask,
    point: Sequence[float],
    component: int,
    value: float,
    active_functions: Mask,
) -> PointHeld:
    """One displacement component at a point: a constraint on the interpolated value.

    A point at the border of a body that moves may come to lie in a cell without particles: the
    functions that have some stand for all, as long as they make up most of the value.

    Raises:
        InputError: The point is outside the grid.
        SupportError: The body does not reach the point.
    """
    where = f"hold(point=({point[0]:g}, {point[1]:g}))"
    location = locate_point(grid, point, where)
    i, j = divmod(int(location.cell[0]), grid.cells[0])[::-1]
    # On an edge between cells the point belongs to any of those it touches.
    a, b = location.xi[0]
    near = [(i + di, j + dj) for di in _touching(a) for dj in _touching(b)]
    nx, ny = grid.cells
    filled = [(k, m) for k, m in near if 0 <= k < nx and 0 <= m < ny and active[m, k]]
    k, m = filled[0] if filled else (i, j)
    wx = values_1d(basis, nx, k, np.clip(a + i - k, 0, 1))
    wy = values_1d(basis, ny, m, np.clip(b + j - m, 0, 1))
    width = _rust.basis_len(basis, grid.cells[0])
    functions = (wx.indices[None, :] + width * wy.indices[:, None]).ravel().astype(np.int64)
    weights = np.outer(wy.data, wx.data).ravel()
    reached = active_functions[2 * functions]
    if not filled and weights[reached].sum() < MOST:
        raise SupportError(
            f"{where}: the point lies in a cell without particles; move it into the body"
        )
    functions, weights = functions[reached], weights[reached] / weights[reached].sum()
    return PointHeld(2 * functions + component, weights, value, where, (point[0], point[1]))


#: Least share of the value at a point that functions with particles must make up.
MOST = 0.9


def _touching(t: float) -> tuple[int, ...]:
    return (0, -1) if t < 1e-9 else (0, 1) if t > 1 - 1e-9 else (0,)


def locate_point(grid: Grid, point: Sequence[float], what: str) -> _rust.Location:
    """Cell and position of one point.

    Raises:
        InputError: The point is outside the grid, or is not two finite numbers.
    """
    x = np.array([checks.point(what, point)])
    try:
        return grid.rust.locate(x)
    except InputError:
        raise InputError(f"{what}: expected a point within the grid, {grid.extent}") from None
