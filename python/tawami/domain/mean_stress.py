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

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.domain.domain import Domain
from tawami.domain.least_squares import least_squares

#: Cells that the particles travel between two projections. A body at rest is never projected.
TRAVEL = 0.1


class Travel:
    """Distance of the particles since the last projection.

    Attributes:
        cells: Sum over the steps of the root mean square of the distances [cells].
    """

    def __init__(self) -> None:
        self.cells = 0.0

    def must_project(self, domain: Domain, moved: Array) -> bool:
        """Add the way to new positions, and whether mean stress and fields must be projected there.

        A call for all ranks.
        """
        form = domain.model.form
        if not form.kinematics.has_eps_v and not form.own_fields:
            return False
        squares = ((moved - domain.particles.x) ** 2).sum(axis=1) / domain.model.grid.h**2
        sums = ranks.sum_of(domain.model.grid.comm, np.array([squares.sum(), len(squares)]))
        self.cells += float(np.sqrt(sums[0] / max(sums[1], 1.0)))
        if self.cells <= TRAVEL:
            return False
        self.cells = 0.0
        return True


def project(domain: Domain) -> float:
    """Replace the mean stress of the particles by its projection; a call for all ranks.

    Returns:
        Elastic energy that this takes from the particles of this rank [J per metre depth].
    """
    if not domain.model.form.kinematics.has_eps_v:
        return 0.0
    particles = domain.particles
    moduli, material = domain.constants["K"], particles.material
    stress = particles.stress
    strain = stress[:, :3].mean(axis=1) / moduli
    weight = moduli * particles.volume
    projected = np.zeros_like(strain)
    for number in range(len(domain.model.materials)):
        own = material == number
        own_weight = np.where(own, weight, 0.0)
        projected[own] = least_squares(domain, "bilinear", own_weight, strain)[1][own]
    stress[:, :3] += (moduli * (projected - strain))[:, None]
    return float(0.5 * weight @ (strain**2 - projected**2))
