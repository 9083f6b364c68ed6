"""Distances between particles that the deformation moves apart, compared with the cells.

Particles are points of integration. At finite strain their distance grows with the body, while the cells
stay: a uniform stress is no longer integrated exactly, and where the distance reaches a cell the body
separates into rows of particles (documentation, Limits).
"""

from __future__ import annotations

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import QuadratureWarning
from tawami.base.warn import warn
from tawami.scene.domain import Domain

#: Distance from which the error of a uniform stress exceeds about 10 %, or 1 % with fitted volumes, and
#: grows fast [cells] (`python -m cases.extremes --only stretch`).
LIMIT = 0.9
#: Growth that is no stretch: a body may have few particles from the start.
GROWN = 1.2
#: Share of the body that may be farther apart.
SHARE = 0.1
#: Steps of the reduction of a lattice.
REDUCTIONS = 8


def spacings(f: Array, size: Array) -> Array:
    """Distances in lattices that are deformed: the longer vector of the reduced basis (Gauss).

    A shear by whole distances leaves a lattice as it is, unlike a stretch.

    Args:
        f: Deformation gradients in the plane, particles x 2 x 2.
        size: Distance in each lattice before the deformation [m], along both axes.
    """
    short, long = f[:, :, 0] * size[:, None], f[:, :, 1] * size[:, None]
    for _ in range(REDUCTIONS):
        swap = (np.einsum("pi,pi->p", short, short) > np.einsum("pi,pi->p", long, long))[:, None]
        short, long = np.where(swap, long, short), np.where(swap, short, long)
        along = np.einsum("pi,pi->p", short, long) / np.einsum("pi,pi->p", short, short)
        long = long - np.rint(along)[:, None] * short
    return np.asarray(np.sqrt(np.maximum((short**2).sum(axis=1), (long**2).sum(axis=1))))


def warned(domain: Domain) -> bool:
    """Warn of particles that are too far apart; whether it did. A call for all ranks."""
    model, particles = domain.model, domain.particles
    # where a material flows, particles pass each other, and F does not give their distances
    is_solid = np.array([not one.history_names for one in model.materials])
    if not is_solid.any():
        return False
    h, dim = model.grid.h, model.space.dim
    gradient = particles.displacement_gradient
    most = ranks.largest(model.grid.comm, float(np.abs(gradient).max(initial=0.0)))
    areas = domain.areas  # of volumes at the start of the scene
    largest = ranks.largest(model.grid.comm, float(areas.max(initial=0.0)))
    # no stretch is larger than 1 + dim |grad u|
    if np.sqrt(largest) * (1 + dim * most) <= LIMIT * h:
        return False
    f = gradient[:, :dim, :dim] + np.eye(dim)
    sizes, volume = np.sqrt(areas) / h, particles.volume
    found = spacings(f, sizes)
    far = is_solid[particles.material] & (found > GROWN * sizes) & (found > LIMIT)
    sums = np.array([volume[far].sum(), volume.sum()])
    apart, whole = ranks.sum_of(model.grid.comm, sums)
    farthest, growth = (
        ranks.largest(model.grid.comm, float(values.max(initial=0.0)))
        for values in (found[far], (found / sizes)[far])
    )
    if not apart > SHARE * whole:
        return False
    fitted = "" if model.fits else " or Scene(..., volumes='fitted')"
    if model.grid.comm.rank == 0:
        warn(
            f"{100 * apart / whole:.2g} % of the body are stretched so far that particles are up to "
            f"{farthest:.2g} h apart, {growth:.2g} times as far as at the start: the stress may be "
            "wrong by more than 10 %, and the body separates where it reaches 1 h. Expected more "
            f"particles per cell (per_axis=...){fitted}",
            QuadratureWarning,
        )
    return True
