"""Whether the displacement gradients of a run of small strain are still small."""

from __future__ import annotations

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import SmallStrainWarning
from tawami.base.warn import warn
from tawami.scene.domain import Domain

#: Largest displacement gradient (spectral norm) of a run of small strain: terms of second order, which
#: small strain neglects, are then a tenth of the strain.
LARGEST = 0.2


def exceeded(domain: Domain, total: Array) -> tuple[int, float] | None:
    """Number of the particle with the largest displacement gradient, and this, if it is too large.

    A call for all ranks.

    Args:
        domain: The particles.
        total: Coefficients of the displacement since the start [m].
    """
    gradients = domain.gradients(domain.model.space.vectors(total))
    # the Frobenius norm is an upper bound, and costs less
    bound = np.einsum("pij,pij->p", gradients, gradients)
    suspects = np.flatnonzero(bound > LARGEST**2)
    sizes = np.linalg.norm(gradients[suspects], 2, axis=(1, 2))
    worst = sizes.argsort()[-1:]  # empty on a rank without any
    sizes = ranks.allgathered(domain.model.grid.comm, sizes[worst])
    numbers = ranks.allgathered(domain.model.grid.comm, domain.particles.number[suspects[worst]])
    if sizes.max(initial=0.0) <= LARGEST:
        return None
    return int(numbers[sizes.argmax()]), float(sizes.max())


def warn_of(domain: Domain, number: int, size: float) -> None:
    """Warn of a particle and its displacement gradient."""
    if domain.model.grid.comm.rank:
        return
    warn(
        f"small strain: the displacement gradient of particle {number} is {size:.3g}, and form "
        f"{domain.model.form.name} neglects its square: expected up to {LARGEST:g}. Take a form of "
        "finite strain (form='u_epsv_finite'), or smaller loads",
        SmallStrainWarning,
    )
