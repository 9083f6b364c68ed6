"""Projection of particle fields on the vertices of the grid, with the bilinear functions M_i.

    lumped        f_i = sum_p V_p M_i f_p / sum_p V_p M_i
    consistent    sum_p V_p M_i (sum_j M_j f_j - f_p) = 0

`lumped` stays within the range of the particles around a vertex. At the border of a body, where they
are on one side of the vertex, its error is of the size of the gradient times h. `consistent`, the L2
projection, is exact for bilinear fields and may overshoot. Its matrix is singular if a cell has fewer
than four particles: conjugate gradients start from `lumped` and leave modes that no particle sees.
Vertices without particles in their cells have the value NaN. `cases/costs/projection.py` measures both
errors.
"""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array
from tawami.scene.scene import Scene

Projection = Literal["lumped", "consistent"]
#: Relative residual at which conjugate gradients end, and their largest number of iterations.
SMALL, MOST = 1e-10, 200


def check_projection(method: str) -> Projection:
    """'lumped' or 'consistent'.

    Raises:
        InputError: Anything else.
    """
    return checks.choice("projection", method, get_args(Projection))  # type: ignore[no-any-return]


def vertices(scene: Scene) -> Array:
    """Corners of the cells that belong to this rank, x fastest [m]: vertices x dim."""
    window = scene.configuration.domain.layout.window
    return window.greville("bilinear")[window.vertices]


def nodal(scene: Scene, values: Array, method: Projection = "lumped") -> Array:
    """Project a field of the particles on the vertices of the grid; a call for all ranks.

    Args:
        scene: The scene with its particles.
        values: Field of the particles of this rank, particles or particles x components.
        method: 'lumped' or 'consistent'.

    Returns:
        Vertices of this rank (x fastest) or vertices x components; NaN without particles around.

    Raises:
        InputError: An unknown method.
    """
    method = check_projection(method)
    values = np.asarray(values, dtype=float)
    # a rank may be without particles: its number of columns is that of the shape
    columns = values.reshape(len(values), math.prod(values.shape[1:]))
    sums = _sums(scene, np.column_stack([np.ones(len(columns)), columns]))
    weight, right = sums[:, :1], sums[:, 1:]
    near = weight > 0
    found = np.divide(right, weight, out=np.zeros_like(right), where=near)
    if method == "consistent":
        found = _conjugate_gradients(scene, found, weight, right)
    own = scene.configuration.domain.layout.window.vertices
    return np.where(near, found, np.nan)[own].reshape(len(own), *np.shape(values)[1:])


def _sums(scene: Scene, data: Array) -> Array:
    """sum_p V_p M_i data_p, vertices x columns."""
    return scene.configuration.domain.sums(np.asarray(scene.particles.volume), data, "bilinear")


def _conjugate_gradients(scene: Scene, start: Array, weight: Array, right: Array) -> Array:
    """Consistent projection of each column, preconditioned by the lumped matrix.

    All ranks do the same iterations.
    """
    domain = scene.configuration.domain
    location, functions = domain.location, domain.layout.functions

    def dot(a: Array, b: Array) -> Array:
        return np.array([functions.dot("bilinear", *of) for of in zip(a.T, b.T, strict=True)])

    def product(f: Array) -> Array:
        at_particles = [
            _rust.interpolate(location, "bilinear", 1, np.ascontiguousarray(column))
            for column in f.T
        ]
        return _sums(scene, np.column_stack(at_particles))

    def divide(top: Array, bottom: Array) -> Array:
        return np.divide(top, bottom, out=np.zeros_like(top), where=bottom > 0)

    f, r = start.copy(), right - product(start)
    z = divide(r, np.broadcast_to(weight, r.shape))
    d, rz = z.copy(), dot(r, z)
    enough = SMALL**2 * dot(right, start)  # below this it is round-off
    for _ in range(MOST):
        if (rz <= enough).all():
            break
        q = product(d)
        step = np.where(rz > enough, divide(rz, dot(d, q)), 0.0)
        f, r = f + step * d, r - step * q
        z = divide(r, np.broadcast_to(weight, r.shape))
        before, rz = rz, dot(r, z)
        d = z + divide(rz, before) * d
    return f
