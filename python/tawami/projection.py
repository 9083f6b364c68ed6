"""Particle fields on the vertices of the grid, for smooth pictures: on the bilinear functions M_i.

    mean      f_i = sum_p V_p M_i f_p / sum_p V_p M_i
    linear    f_i = a of the a, b that minimise sum_p V_p M_i (f_p - a - b . (x_p - x_i))^2

`mean` (lumped projection) stays within the range of the particles around a vertex and is exact for
constants; at the border of a body, where particles stand on one side of the vertex, it is off by the
slope. `linear` (moving least squares) is exact for linear fields, also there, and may overshoot. The
consistent L2 projection is neither local nor regular where a cell holds fewer than four particles.
Vertices without particles in their cells have no value: NaN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
import numpy.typing as npt

from tawami.errors import InputError

if TYPE_CHECKING:
    from tawami.scene import Scene

Array = npt.NDArray[np.float64]
Projection = Literal["mean", "linear"]
#: Least eigenvalue of the particles' second moments about their centre, in h^2, from which a vertex has
#: a slope: below, they stand on one spot or in a row.
SPREAD = 1e-3


def check_projection(method: str) -> Projection:
    """'mean' or 'linear'.

    Raises:
        InputError: Anything else.
    """
    for known in get_args(Projection):
        if method == known:
            return known  # type: ignore[no-any-return]
    raise InputError(
        f"projection = {method!r}: expected one of {', '.join(map(repr, get_args(Projection)))}"
    )


def vertices(scene: Scene) -> Array:
    """Corners of the cells, x fastest [m]: vertices x 2."""
    grid = scene.grid
    x, y = (
        grid.axis_positions(axis, np.arange(number + 1), 0.0)
        for axis, number in enumerate(grid.cells)
    )
    return np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])


def nodal(scene: Scene, values: Array, method: Projection = "mean") -> Array:
    """A field of the particles on the vertices of the grid; a call for all ranks.

    Args:
        scene: The scene with its particles where they are.
        values: Of this rank's particles, particles or particles x components.
        method: 'mean' or 'linear'.

    Returns:
        Vertices (x fastest), by components where there are any; NaN where no particle is near.

    Raises:
        InputError: An unknown method.
    """
    method = check_projection(method)
    columns = np.asarray(values, dtype=float).reshape(len(scene.particles), -1)
    on_vertices = _mean(scene, columns) if method == "mean" else _linear(scene, columns)
    return on_vertices.reshape(-1, *np.shape(values)[1:])


def _sums(scene: Scene, data: Array) -> Array:
    """sum_p V_p M_i data_p, vertices x columns."""
    return scene.attached.sums(np.asarray(scene.particles.volume), data, "bilinear")


def _mean(scene: Scene, values: Array) -> Array:
    sums = _sums(scene, np.column_stack([np.ones(len(values)), values]))
    weight = np.where(sums[:, :1] > 0, sums[:, :1], np.nan)
    return np.asarray(sums[:, 1:] / weight)


def _linear(scene: Scene, values: Array) -> Array:
    """By moments about the corner of the grid in cells, then about the centre of what is around."""
    grid = scene.grid
    x = (np.asarray(scene.particles.x) - grid.origin) / grid.h
    n, k = len(values), values.shape[1]
    one, xy = np.ones((n, 1)), x[:, [0]] * x[:, [1]]
    slopes = (values[:, :, None] * x[:, None, :]).reshape(n, -1)
    sums = _sums(scene, np.column_stack([one, x, x**2, xy, values, slopes]))
    sums = sums / np.where(sums[:, :1] > 0, sums[:, :1], np.nan)
    centre, mean = sums[:, 1:3], sums[:, 6 : 6 + k]
    second = np.stack([sums[:, [3, 5]], sums[:, [5, 4]]], axis=1)
    second = second - centre[:, :, None] * centre[:, None, :]
    mixed = sums[:, 6 + k :].reshape(-1, k, 2) - mean[:, :, None] * centre[:, None, :]
    offset = (vertices(scene) - grid.origin) / grid.h - centre
    known = np.isfinite(centre).all(axis=1)
    spread = np.zeros(len(known))
    spread[known] = np.linalg.eigvalsh(second[known])[:, 0]
    sure = spread > SPREAD
    found = mean.copy()
    slope = np.linalg.solve(second[sure], mixed[sure].transpose(0, 2, 1))
    found[sure] += np.einsum("ij,ijk->ik", offset[sure], slope)
    return np.asarray(found)
