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
from typing import Literal

import numpy as np
import scipy.sparse as sp

from tawami.base import checks, ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.border.pieces import Border
from tawami.field.border import PointsInCells
from tawami.grid.basis import Basis, greville

#: Weight of the corrections. Less damping makes them larger and the stress noisier.
DAMPING = 0.01
#: Reduction of the residual, and most iterations: 1e-2 leaves a fifth more error in the mean stress of
#: the ring at large strain, and 1e-4 changes it by less than 1 %.
TOLERANCE, ITERATIONS = 1e-3, 80
#: Largest correction of a volume.
LARGEST = 0.5

Volumes = Literal["fitted", "own"]


def chosen(volumes: Volumes, border: Border | None) -> bool:
    """Whether volumes are fitted.

    They are not by default: conjugate gradients amplify round-off, so that runs with another order of
    sums, as on other numbers of ranks, differ by about 1e-3 of the correction.

    Args:
        volumes: As the user gave it.
        border: The border of the body.

    Raises:
        InputError: Another value, or a body without a border.
    """
    if checks.choice("volumes", volumes, ("own", "fitted")) == "own":
        return False
    if border is None:
        raise InputError(
            "volumes='fitted': the body has no border: expected volumes='own', or "
            "Body(x, volume, border=tawami.polyline(corners))"
        )
    return True


def corrections(
    border: PointsInCells, area: Array, particles: PointsInCells, volume: Array, basis: Basis
) -> Array:
    """Corrections c of the volumes of this rank's particles; a call for all ranks.

    Args:
        border: The points of the whole border.
        area: Their outward normals times areas [m2 per metre depth], points x dim.
        particles: The particles.
        volume: Their present volumes [m2 per metre depth].
        basis: Whose functions w are.
    """
    grid = border.grid
    thickness = grid.space.thickness(np.maximum(greville(basis, *grid.lattice), grid.h / 2))
    scale = sp.diags(1 / (grid.h * thickness))
    divergence = [sp.diags(volume) @ slope for slope in particles.slopes(basis)]
    if grid.space.hoop:
        radius = grid.positions(particles.location)[:, 0]
        divergence[0] = divergence[0] + sp.diags(volume / radius) @ particles.values(basis)
    rows = sp.hstack([one @ scale for one in divergence]).T.tocsr()  # A

    def summed(of_rank: Array) -> Array:
        return np.asarray(ranks.sum_of(grid.comm, np.ascontiguousarray(of_rank)))

    at_border = border.values(basis).T @ area
    b = np.concatenate([scale @ of_axis for of_axis in at_border.T])
    b -= summed(rows @ np.ones(len(volume)))
    y = _conjugate_gradients(lambda y: summed(rows @ (rows.T @ y)) + DAMPING**2 * y, b)
    return np.asarray(np.clip(rows.T @ y, -LARGEST, LARGEST))


def _conjugate_gradients(times: Callable[[Array], Array], b: Array) -> Array:
    """Solution of a symmetric positive system to `TOLERANCE`, the same on all ranks."""
    y, r = np.zeros(len(b)), b.copy()
    p, size = r.copy(), float(r @ r)
    least = TOLERANCE**2 * size
    for _ in range(ITERATIONS):
        if size <= least:
            break
        q = times(p)
        step = size / float(p @ q)
        y += step * p
        r -= step * q
        size, before = float(r @ r), size
        p = r + (size / before) * p
    return y
