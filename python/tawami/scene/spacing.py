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

#: Distance up to which the error of a uniform stress stays below about 10 % [cells]: with volumes of the
#: particles themselves, and with fitted ones.
OWN, FITTED = 0.7, 0.9
#: Growth of a distance that is no stretch: a body may have few particles from the start.
GROWN = 1.2
#: Share of the body that may be farther apart.
SHARE = 0.05
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
    limit, h, dim = FITTED if model.fits else OWN, model.grid.h, model.space.dim
    gradient = particles.displacement_gradient
    most = ranks.largest(model.grid.comm, float(np.abs(gradient).max(initial=0.0)))
    areas = domain.areas  # of volumes at the start of the scene
    largest = ranks.largest(model.grid.comm, float(areas.max(initial=0.0)))
    # no stretch is larger than 1 + dim |grad u|
    if np.sqrt(largest) * (1 + dim * most) <= limit * h:
        return False
    f = gradient + np.eye(dim)
    sizes, volume = np.sqrt(areas) / h, particles.volume
    found = spacings(f, sizes)
    found[found < GROWN * sizes] = 0.0
    apart, whole = ranks.sum_of(
        model.grid.comm, np.array([volume[found > limit].sum(), volume.sum()])
    )
    farthest = ranks.largest(model.grid.comm, float(found.max(initial=0.0)))
    if not apart > SHARE * whole:
        return False
    fitted = "" if model.fits else ", or Scene(..., volumes='fitted'), which serves up to 0.9 h"
    if model.grid.comm.rank == 0:
        warn(
            f"particles are up to {farthest:.2g} h apart where the body is stretched, and more than "
            f"{limit:g} h in {100 * apart / whole:.2g} % of it: the error of a uniform stress exceeds "
            "10 % from there on, and at 1 h the body separates. Expected more particles per cell "
            f"(per_axis=...){fitted}",
            QuadratureWarning,
        )
    return True
