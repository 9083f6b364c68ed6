"""Volumes for which the divergence theorem holds on the grid.

Particles that have moved, and evenly spaced ones in cut cells, do not integrate the gradients of the
functions exactly: a uniform pressure then causes forces, and the mean stress is noisy. With V_p the
present volumes and n dA the border, volumes V_p (1 + c_p) shall fulfil for each function w and axis i

    sum_p V_p (1 + c_p) div (w e_i)(x_p) = sum_b w(x_b) n_i dA_b,

or A c = b, with the smallest |A c - b|^2 + (DAMPING |c|)^2. The minimum is c = A^T y with
(A A^T + DAMPING^2) y = b, which conjugate gradients solve to `TOLERANCE`. In axisymmetry
div (w e_r) = w,r + w/r.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base import checks, ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.border.pieces import Border
from tawami.field.border import BorderInCells, PointsInCells
from tawami.field.layout import Layout

#: Weight of the corrections. Less damping makes them larger and the stress noisier.
DAMPING = 0.01
#: Reduction of the residual, and most iterations: 1e-2 leaves a fifth more error in the mean stress of
#: the ring at large strain, and 1e-4 changes it by less than 1 %.
TOLERANCE, ITERATIONS = 1e-3, 80
#: Largest correction of a volume.
LARGEST = 0.5

Volumes = Literal["full_cells", "own", "fitted"]


def checked(volumes: Volumes, border: Border | None) -> Volumes:
    """The choice of the volumes, checked.

    They are not fitted to the border by default: conjugate gradients amplify round-off, so that runs
    with another order of sums, as on other numbers of ranks, differ by about 1e-3 of the correction.

    Args:
        volumes: As the user gave it.
        border: The border of the body.

    Raises:
        InputError: Another value, or a body without a border.
    """
    checks.choice("volumes", volumes, get_args(Volumes))
    if volumes == "fitted" and border is None:
        raise InputError(
            "volumes='fitted': the body has no border: expected volumes='full_cells', or "
            "Body(x, volume, border=tawami.polyline(corners))"
        )
    return volumes


def corrections(
    border: BorderInCells,
    area: Array,
    location: _rust.Location,
    volume: Array,
    layout: Layout,
) -> Array:
    """Corrections c of the volumes of this rank's particles; a call for all ranks.

    Args:
        border: The points of the whole border.
        area: Their outward normals times areas [m2 per metre depth], points x dim.
        location: Cells of this rank's particles, and positions in them.
        volume: Their present volumes [m2 per metre depth].
        layout: Places of the coefficients: w are the displacement functions.
    """
    grid, basis = border.grid, layout.basis
    particles = PointsInCells(grid, location, layout.window.cells)
    thickness = grid.space.thickness(np.maximum(layout.greville, grid.h / 2))
    scale = sp.diags(1 / (grid.h * thickness))
    divergence = [sp.diags(volume) @ slope for slope in particles.slopes(basis)]
    if grid.space.hoop:
        radius = grid.positions(location)[:, 0]
        divergence[0] = divergence[0] + sp.diags(volume / radius) @ particles.values(basis)
    rows = sp.hstack([one @ scale for one in divergence]).T.tocsr()  # A

    dim, exchange = grid.space.dim, layout.functions.exchange(basis)

    def summed(of_rank: Array) -> Array:
        return np.asarray(exchange.add(of_rank.reshape(dim, -1).T.copy()).T.ravel())

    def dot(a: Array, b: Array) -> float:
        own = layout.own[: len(a)].reshape(-1, dim)[:, 0]
        mine = np.tile(own, dim)
        return ranks.total(grid.comm, float(a[mine] @ b[mine]))

    at_border = border.sums(layout.functions, basis, area)
    b = np.concatenate([scale @ of_axis for of_axis in at_border.T])
    b -= summed(rows @ np.ones(len(volume)))
    y = _conjugate_gradients(lambda y: summed(rows @ (rows.T @ y)) + DAMPING**2 * y, b, dot)
    return np.asarray(np.clip(rows.T @ y, -LARGEST, LARGEST))


def _conjugate_gradients(
    times: Callable[[Array], Array], b: Array, dot: Callable[[Array, Array], float]
) -> Array:
    """Solution of a symmetric positive system to `TOLERANCE`, with this scalar product."""
    y, r = np.zeros(len(b)), b.copy()
    p, size = r.copy(), dot(r, r)
    least = TOLERANCE**2 * size
    for _ in range(ITERATIONS):
        if size <= least:
            break
        q = times(p)
        step = size / dot(p, q)
        y += step * p
        r -= step * q
        size, before = dot(r, r), size
        p = r + (size / before) * p
    return y
