"""The border of a level set: its pieces in order, closed along the edges of the grid."""

from __future__ import annotations

from typing import Any

import numpy as np

from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.border import chains
from tawami.border.curves import Curves
from tawami.border.pieces import Border
from tawami.border.polyline import straight
from tawami.grid.grid import EDGES, Grid

#: Pieces shorter than this, and ends nearer than that [cells], are round-off.
SHORT, NEAR = 1e-10, 1e-8
#: Edges of the grid, counter-clockwise from the lower left corner.
AROUND = ("bottom", "right", "top", "left")


def outline(grid: Grid, pieces: Array, name: str, covered: bool) -> Border:
    """The border of a level set.

    Args:
        grid: The grid.
        pieces: Straight pieces [cells], with the body on the left, n x 2 x 2; in any order.
        name: Name of the border; parts on edges of the grid have the names of these.
        covered: Whether the body holds the lower left corner of the grid.

    Raises:
        InputError: The pieces do not close.
    """
    line = np.rint(pieces)
    pieces = np.where(np.abs(pieces - line) < SHORT, line, pieces)
    pieces = pieces[np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1) > SHORT]
    start, end = pieces[:, 0].copy(), pieces[:, 1]
    following = _followers(start, end)
    joined = following >= 0
    start[following[joined]] = end[joined]  # exactly closed
    first = np.ones(len(start), dtype=bool)
    first[following[joined]] = False
    gaps = _gaps(grid, end[~joined], start[first])
    edges, names = _along_edges(grid, end[~joined], start[first], covered)
    start = np.concatenate([start, gaps[:, 0], edges[:, 0]])
    end = np.concatenate([end, gaps[:, 1], edges[:, 1]])
    order, _ = chains.chained(_followers(start, end))
    named = np.array([name] * (len(start) - len(names)) + names)[order]
    x, after = (grid.in_metres(part[order]) for part in (start, end))
    return straight(x, after, named.tolist(), (name, *EDGES))


def _followers(start: Array, end: Array) -> Any:
    return chains.followers(Curves(start, end, np.zeros(len(start))), NEAR)


def _on_edge(grid: Grid, x: Array) -> Any:
    """Mask of positions [cells] on edges of the grid."""
    return (np.minimum(x, grid.cells - x) < NEAR).any(axis=1)


def _gaps(grid: Grid, ends: Array, starts: Array) -> Array:
    """Pieces between open ends inside of the grid and the nearest open starts.

    There are such where the border crosses a side of a square twice, which one of the two squares does
    not see.
    """
    from scipy.optimize import linear_sum_assignment

    a, b = (x[~_on_edge(grid, x)] for x in (ends, starts))
    distance = np.linalg.norm(a[:, None] - b, axis=2)
    pairs = zip((a, b), linear_sum_assignment(distance), strict=True)
    return np.stack([x[k] for x, k in pairs], axis=1)


def _along_edges(grid: Grid, ends: Array, starts: Array, covered: bool) -> tuple[Array, list[str]]:
    """Pieces along edges of the grid, n x 2 x 2, from open ends to the next open starts, with names.

    Places are measured along the edges, counter-clockwise from the lower left corner.
    """
    nx, ny = grid.cells
    corner = np.array([[0, 0], [nx, 0], [nx, ny], [0, ny], [0, 0]], dtype=float)
    at = np.cumsum([0.0, nx, ny, nx, ny])
    around = at[-1]
    leave, enter = (np.sort(_places(grid, x[_on_edge(grid, x)])) for x in (ends, starts))
    if not len(leave) and not len(enter) and covered:
        leave, enter = at[:1], at[-1:]
    elif len(enter) and len(leave) and enter[0] < leave[0]:
        enter = np.append(enter[1:], enter[0] + around)
    if len(leave) != len(enter) or (enter < leave).any() or (enter[:-1] > leave[1:]).any():
        raise InputError(
            "level_set: its border crosses an edge of the grid at places that the samples do not show: "
            "use more samples, or a larger grid"
        )
    pieces, names = list[Array](), list[str]()
    every = np.concatenate([at, at[1:] + around])
    for low, high in zip(leave, enter, strict=True):
        cuts = np.unique([low, *every[(every > low) & (every < high)], high])
        edge = np.searchsorted(at, (cuts[:-1] + cuts[1:]) / 2 % around) - 1
        names += [AROUND[k] for k in edge]
        x = np.stack([np.interp(cuts % around, at, c) for c in corner.T], axis=1)
        pieces.append(np.stack([x[:-1], x[1:]], axis=1))
    return np.concatenate([np.empty((0, 2, 2)), *pieces]), names


def _places(grid: Grid, x: Array) -> Array:
    """Places along the edges of the grid of positions on them, measured as above [cells]."""
    nx, ny = grid.cells
    on = [x[:, 1] < NEAR, nx - x[:, 0] < NEAR, ny - x[:, 1] < NEAR]
    places = [x[:, 0], nx + x[:, 1], 2 * nx + ny - x[:, 0]]
    return np.asarray(np.select(on, places, 2 * (nx + ny) - x[:, 1]))
