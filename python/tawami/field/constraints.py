"""Supports as linear constraints on the coefficients of the displacement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from tawami import _rust
from tawami.base.arrays import Array, Indices
from tawami.base.errors import SupportError
from tawami.base.space import Position, lattice, tensor_product
from tawami.base.text import position
from tawami.field.coefficients import Place
from tawami.field.layout import Layout
from tawami.grid.basis import functions_on, values_1d
from tawami.grid.edges import Profile, edge_functions, evaluate, locate_point
from tawami.grid.grid import Edge, Grid

#: Points of the Gauss rule along a cell of an edge, for the projection of profiles.
POINTS = 5
#: Distance from a side of a cell below which a point lies on it [cells].
ON_SIDE = 1e-9
#: Least share of the value at a point that functions with particles must make up.
LEAST_SHARE = 0.9


@dataclass(frozen=True)
class Held:
    """Prescribed coefficients.

    Attributes:
        indices: The coefficients, all of one component of a field, by their numbers in the whole grid.
        values: Their values [m], or in the unit of the field.
        where: Name of the support, for messages.
    """

    indices: Indices
    values: Array
    where: str = "a support"


@dataclass(frozen=True)
class PointHeld:
    """A multi-point constraint: `weights . coefficients[indices] = value`.

    Attributes:
        indices: Coefficients of one displacement component, by their numbers in the whole grid.
        weights: Values of their functions at the point.
        value: Displacement of the point [m].
        where: Name of the support, for messages.
        place: The point [m].
    """

    indices: Indices
    weights: Array
    value: float
    where: str
    place: Position


def held_edge(
    grid: Grid,
    place: Place,
    edge: Edge,
    touched: Indices,
    component: int,
    value: Profile,
    where: str,
) -> Held:
    """Prescribe a component of a field on an edge of the grid.

    A profile is projected in L2. Functions that vanish on all touched cells are left out.

    Args:
        grid: The grid.
        place: Place of the field among the coefficients of the whole grid.
        edge: Name of the edge.
        touched: Numbers along the edge of the cells where the body touches it.
        component: Number of the component.
        value: Value along the edge [m], or in the unit of the field.
        where: The support, for messages.
    """
    axis, _ = grid.edge(edge)
    along = 1 - axis
    used = functions_on(place.basis, grid.cells[along], touched)
    functions = edge_functions(grid, place.basis, edge)[used]
    indices = place.start + place.components * functions + component
    if not callable(value) and np.ndim(value) == 0:
        return Held(indices, np.full(len(used), float(value)))  # the functions add up to 1
    points, weights = _rust.gauss(POINTS)
    cell, t = np.repeat(touched, POINTS), np.tile(points, len(touched))
    position = grid.axis_positions(along, cell, t)
    fixed = np.full_like(position, grid.line_of_edge(edge))
    x = np.stack([fixed, position] if axis == 0 else [position, fixed], axis=-1)
    values = values_1d(place.basis, grid.cells[along], cell, t)[:, used]
    weighted = sp.diags(np.tile(weights, len(touched))) @ values
    prescribed = evaluate(value, x, where)
    coefficients = spsolve((weighted.T @ values).tocsc(), weighted.T @ prescribed)
    return Held(indices, coefficients)


def held_point(layout: Layout, point: Sequence[float], component: int, value: float) -> PointHeld:
    """Prescribe a displacement component at a point; a collective call.

    A point at the border of a moving body may reach a cell without particles. Then the functions with
    particles replace all, if they make up most of the value at the point.

    Args:
        layout: Places of the coefficients.
        point: The point [m].
        component: Number of the component.
        value: Its displacement [m].

    Raises:
        InputError: The point is outside the grid.
        SupportError: The body does not reach the point.
    """
    grid, basis, where = layout.grid, layout.basis, f"hold(point={position(point)})"
    location = locate_point(grid, point, where)
    cell = np.unravel_index(int(location.cell[0]), grid.cells, order="F")
    xi = location.xi[0]
    # on a side between cells, the point belongs to each of them
    near = [np.add(cell, shift) for shift in product(*map(_touching, xi))]
    inside = [c for c in near if (c >= 0).all() and (c < grid.cells).all()]
    filled = [
        c
        for c, is_active in zip(inside, layout.has_particles(np.array(inside)), strict=True)
        if is_active
    ]
    chosen = filled[0] if filled else np.array(cell)
    along = [
        values_1d(basis, n, k, np.clip(t + i - k, 0, 1))
        for n, i, k, t in zip(grid.cells, cell, chosen, xi, strict=True)
    ]
    strides = np.cumprod([1, *(_rust.basis_len(basis, n) for n in grid.cells[:-1])])
    functions = lattice([values.indices for values in along]).astype(np.int64) @ strides
    weights = tensor_product([values.data for values in along])
    dim = grid.space.dim
    reached = layout.at(layout.active.astype(float), dim * functions) > 0
    if not filled and weights[reached].sum() < LEAST_SHARE:
        raise SupportError(
            f"{where}: the point lies in a cell without particles; move it into the body"
        )
    functions, weights = functions[reached], weights[reached] / weights[reached].sum()
    return PointHeld(dim * functions + component, weights, value, where, (point[0], point[1]))


def _touching(t: float) -> tuple[int, ...]:
    """Offsets of the cells that a position within a cell touches along one axis."""
    return (0, -1) if t < ON_SIDE else (0, 1) if t > 1 - ON_SIDE else (0,)
