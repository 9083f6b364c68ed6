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
from tawami.domain.domain import Domain

#: Distance from which the error of a uniform stress exceeds about 10 %, or 1 % with fitted volumes, and
#: grows fast [cells] (`python -m cases.extremes --only stretch`).
LIMIT = 0.9
#: The same as a growth of distances, unless volumes are fitted: distances become uneven, so that more
#: particles in a cell do not help.
DOUBLE = 2.0
#: Growth that is no stretch: a body may have few particles from the start.
GROWN = 1.2
#: Share of the body that may be farther apart.
SHARE = 0.1
#: Growth of a border, and the same relative to that of distances in the body, beyond which the border is
#: not where the particles are.
LONGER = 1.75
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


def farthest(domain: Domain, u: Array | None = None) -> tuple[float, float, float]:
    """The part of the body in which particles are too far apart, a share of its volume; their largest
    distance there [cells], and the largest growth of a distance. A call for all ranks.

    Args:
        domain: The particles.
        u: Increments of the displacement that are not in the particles yet, functions x dim [m].
    """
    model, particles = domain.model, domain.particles
    # where a material flows, particles pass each other, and F does not give their distances
    is_solid = np.array([not one.history_names for one in model.materials])
    if not (is_solid.any() and model.moves):
        return 0.0, 0.0, 1.0
    h, dim, comm = model.grid.h, model.space.dim, model.grid.comm
    areas = domain.areas  # of volumes at the start of the scene
    most = np.inf if model.volumes == "fitted" else DOUBLE
    growth = LIMIT * h / np.sqrt(ranks.largest(comm, float(areas.max(initial=0.0))))
    growth = min(growth, most)

    def near(gradient: Array, change: float) -> bool:
        """Whether a distance may exceed the limit: no stretch is larger than 1 + dim |grad u|."""
        largest = ranks.largest(comm, float(np.abs(gradient).max(initial=0.0)))
        return bool((1 + dim * largest) * (1 + dim * change) > growth)

    gradient = np.asarray(particles.displacement_gradient[:, :dim, :dim])
    change = 0.0 if u is None else 2 * ranks.largest(comm, float(np.ptp(u, axis=0).max())) / h
    if not near(gradient, change):
        return 0.0, 0.0, 1.0
    if u is not None:
        of_step = domain.gradients(u)
        gradient = gradient + of_step + of_step @ gradient
        if not near(gradient, 0.0):
            return 0.0, 0.0, 1.0
    sizes, volume = np.sqrt(areas) / h, particles.volume
    found = spacings(gradient + np.eye(dim), sizes)
    far = (found > GROWN * sizes) & (found > LIMIT) | (found > most * sizes)
    far &= is_solid[particles.material]
    apart, whole = ranks.sum_of(comm, np.array([volume[far].sum(), volume.sum()]))
    distance, times = (
        ranks.largest(comm, float(values.max(initial=0.0)))
        for values in (found[far], (found / sizes)[far])
    )
    return apart / whole, distance, times


def warned(domain: Domain, u: Array) -> bool:
    """Warn of particles that are too far apart at the end of a step; whether it did.

    A call for all ranks.

    Args:
        domain: The particles at its start.
        u: Increments of the displacement, functions x dim [m].
    """
    share, distance, growth = farthest(domain, u)
    if not share > SHARE:
        return False
    if domain.model.grid.comm.rank == 0:
        warn(
            f"{100 * share:.2g} % of the body are stretched so far that particles are up to "
            f"{distance:.2g} h apart, {growth:.2g} times as far as at the start: the stress may be "
            "wrong by more than 10 %, and the body separates where it reaches 1 h. "
            f"{advice(domain)}",
            QuadratureWarning,
        )
    return True


def outgrown(domain: Domain, growth: float) -> str:
    """Message if a border has become so much longer than the body that it has left the particles; else
    empty. A call for all ranks.

    Args:
        domain: The particles.
        growth: Largest growth of a piece of the border.
    """
    model = domain.model
    if not growth > LONGER or any(one.history_names for one in model.materials):
        return ""
    dim = model.space.dim
    f = domain.particles.displacement_gradient[:, :dim, :dim] + np.eye(dim)
    largest = float(np.linalg.norm(f, 2, axis=(1, 2)).max(initial=1.0))
    body = ranks.largest(model.grid.comm, largest)
    if not growth > LONGER * body:
        return ""
    return (
        f"a piece of the border is {growth:.2g} times as long as at the start, and the body at most "
        f"{body:.2g} times: the stretched particles leave functions of the grid near the border with "
        f"little stiffness, and loads and supports there are not reliable. {advice(domain)}"
    )


def advice(domain: Domain) -> str:
    """Advice against particles that are too far apart."""
    fitted = "" if domain.model.volumes == "fitted" else "Scene(..., volumes='fitted') and "
    return (
        f"Expected {fitted}more particles per cell (per_axis=...), or sides that begin between lines of "
        "the grid, as 0.4 h from them"
    )
