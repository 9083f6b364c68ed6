"""The mean stress that particles carry from step to step, as a field of the present grid.

In a mixed form the mean stress is a field, tau_m = K eps, with eps bilinear on the grid of the step.
Once the grid has been reset it is a sum of fields of many grids. Its force then does work on changes of
volume that the volume equation does not see: a body that turns gains energy. Once the particles have
travelled a tenth of a cell it is therefore projected on the present functions,

    sum_p V0_p K_p M_i (eps(x_p) - tau_m,p / K_p) = 0   for all i,   tau_m,p <- K_p eps(x_p),

for each material by itself, since tau_m / K jumps between materials. The mass is the consistent one; a
lumped one would diffuse. Where a cell has too few particles for its functions, eps passes through their
values and nothing changes.
"""

from __future__ import annotations

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.scene.domain import Domain

#: Size of the residual of the projection over that of its right-hand side, and most iterations. The part
#: that iterations do not find is lost, and rounding would make it depend on the number of ranks.
TOLERANCE, MOST_ITERATIONS = 1e-11, 200
#: Cells that the particles travel between two projections. A body at rest is never projected.
TRAVEL = 0.1


def travel(domain: Domain, moved: Array) -> float:
    """Root mean square of the distances to new positions, in cells; a call for all ranks."""
    squares = ((moved - domain.particles.x) ** 2).sum(axis=1) / domain.model.grid.h**2
    sums = ranks.sum_of(domain.model.grid.comm, np.array([squares.sum(), len(squares)]))
    return float(np.sqrt(sums[0] / max(sums[1], 1.0)))


def project(domain: Domain) -> float:
    """Replace the mean stress of the particles by its projection; a call for all ranks.

    Returns:
        Elastic energy that this takes from the particles of this rank [J per metre depth].
    """
    particles = domain.particles
    moduli, material = domain.constants["K"], particles.material
    stress = particles.stress
    strain = stress[:, :3].mean(axis=1) / moduli
    weight = moduli * particles.volume
    projected = np.zeros_like(strain)
    for number in range(len(domain.model.materials)):
        own = material == number
        projected[own] = _projection(domain, np.where(own, weight, 0.0), strain)[own]
    stress[:, :3] += (moduli * (projected - strain))[:, None]
    return float(0.5 * weight @ (strain**2 - projected**2))


def _projection(domain: Domain, weight: Array, values: Array) -> Array:
    """Weighted projection of values at particles on the bilinear functions, at the particles.

    Conjugate gradients, preconditioned by the lumped mass. Few particles in a cell make the mass
    singular; the right-hand side is in its range, so that they converge nevertheless. A regularised mass
    would dissipate a little energy in every step, and a body would never come to rest. All ranks
    have the same coefficients.
    """

    def at_particles(coefficients: Array) -> Array:
        return np.asarray(_rust.interpolate(domain.location, "bilinear", 1, coefficients)).ravel()

    def sums(of_particles: Array) -> Array:
        return domain.sums(weight, of_particles.reshape(-1, 1), "bilinear")[:, 0]

    lumped = sums(np.ones_like(values))
    inverse = np.divide(1.0, lumped, out=np.zeros_like(lumped), where=lumped > 0.0)
    residual = sums(values)
    at_found = np.zeros_like(values)
    direction = preconditioned = inverse * residual
    size = start = residual @ preconditioned
    for _ in range(MOST_ITERATIONS):
        if not size > TOLERANCE**2 * start:
            break
        at_direction = at_particles(direction)
        image = sums(at_direction)
        step = size / (direction @ image)
        at_found = at_found + step * at_direction
        residual = residual - step * image
        preconditioned = inverse * residual
        before, size = size, residual @ preconditioned
        direction = preconditioned + size / before * direction
    return at_found
