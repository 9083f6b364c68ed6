"""Edges of the grid, their cells and functions, and profiles along them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.base.space import Counts, lattice
from tawami.base.text import position
from tawami.grid.basis import Basis
from tawami.grid.grid import Edge, Grid

Component = Literal["x", "y"]
#: A number, or a function of position f(x, y) on arrays.
Profile = float | Callable[[Array, Array], Any]


def evaluate(profile: Profile, points: Array, what: str) -> Array:
    """Values of a number or a function at points.

    Args:
        profile: A number or a function of position.
        points: Positions [m], points x dim.
        what: The input, for messages.

    Raises:
        InputError: The function fails, returns another shape, or returns NaN or infinity.
    """
    x, *others = points.T.copy()  # a function may change its arguments
    try:
        value = profile(x, *others) if callable(profile) else profile
        values = np.broadcast_to(checks.real_values(value), x.shape)
    except Exception as error:
        raise InputError(
            f"{what}: expected a number or a function f(x, y) on arrays of shape {x.shape}, got "
            f"{profile!r}, which gave {error!r}"
        ) from error
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        first = bad[0]
        raise InputError(
            f"{what}: {values[first]} at {position(points[first])}: expected a finite number"
        )
    return values


def edge_functions(grid: Grid, basis: Basis, edge: Edge) -> Indices:
    """Numbers of the displacement functions that do not vanish on an edge of the grid, along it."""
    return _at_end(basis, grid.cells, *grid.edge(edge))


@functools.lru_cache(maxsize=32)
def _at_end(basis: Basis, cells: Counts, axis: int, end: int) -> Indices:
    """Numbers of the functions that do not vanish at an end of an axis; read only."""
    shape = [_rust.basis_len(basis, n) for n in cells]
    along = [np.arange(n) for n in shape]
    along[axis] = along[axis][[end]]
    functions: Indices = lattice(along) @ np.cumprod((1, *shape[:-1]))
    functions.flags.writeable = False
    return functions


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
