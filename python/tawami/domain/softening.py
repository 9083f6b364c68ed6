"""Whether a law in NumPy or a clay of a scene softens, so that results depend on the grid."""

from __future__ import annotations

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import SofteningWarning
from tawami.base.warn import warn
from tawami.domain.domain import Domain
from tawami.particles.numpy_stage import NumpyStage

#: Eigenvalue, and asymmetry, of a tangent that are ignored, relative to the shear modulus.
IGNORED = 1e-6


#: The history variable whose fall is softening, and share by which it may fall by round-off.
YIELD_PRESSURE, FALLS = "preconsolidation", 1e-6


def warned(domain: Domain, coefficients: Array) -> bool:
    """Warn of the particle that softens most, if any does; arguments as of `_found`."""
    soft, fallen = _found(domain, coefficients), _fallen(domain, coefficients)
    if soft is not None:
        number, least = soft
        _warn_of(
            domain,
            f"the tangent of particle {number} has the eigenvalue {least:.3g} Pa, expected none below 0",
        )
    elif fallen is not None:
        number, share = fallen
        _warn_of(
            domain,
            f"the {YIELD_PRESSURE} pressure of particle {number} fell by {100 * share:.2g} % in a step, "
            "because its clay expands dry of critical",
        )
    return soft is not None or fallen is not None


def _fallen(domain: Domain, coefficients: Array) -> tuple[int, float] | None:
    """Number of the particle whose yield pressure falls most, and the share; see `_found`."""
    particles, comm = domain.particles, domain.model.grid.comm
    if YIELD_PRESSURE not in particles.history_names:
        return None
    new = np.zeros((len(particles), 1))
    with ranks.raise_together(comm):
        requests = _rust.Requests([[(f"history:{YIELD_PRESSURE}", "value", 0, None)]])
        domain.stage.evaluate(*domain.layout.split(coefficients), requests, [new])
    old = particles.history(YIELD_PRESSURE)
    share = np.where(old > 0, 1 - new[:, 0] / np.where(old > 0, old, 1.0), 0.0)
    worst = share.argsort()[-1:]  # empty on a rank without particles
    numbers = ranks.allgathered(comm, particles.number[worst])
    share = ranks.allgathered(comm, share[worst])
    if share.max(initial=0.0) <= FALLS:
        return None
    return int(numbers[share.argmax()]), float(share.max())


def _found(domain: Domain, coefficients: Array) -> tuple[int, float] | None:
    """Number of the particle that softens most, and the least eigenvalue of its tangent [Pa].

    A tangent without symmetry is ignored: the law may be non-associated. A call for all ranks.

    Args:
        domain: The particles.
        coefficients: Increments of all fields at the end of a step.
    """
    stage, comm = domain.stage, domain.model.grid.comm
    if not isinstance(stage, NumpyStage):
        return None
    with ranks.raise_together(comm):
        tangent = stage.tangent(*domain.layout.split(coefficients))
    limit = IGNORED * domain.responses.largest_mu
    odd = np.abs(tangent - tangent.transpose(0, 2, 1)).max(axis=(1, 2), initial=0.0)
    tangent[odd > limit] = 0.0
    least = np.linalg.eigvalsh(tangent)[:, 0]
    worst = least.argsort()[:1]  # empty on a rank without particles
    numbers = ranks.allgathered(comm, domain.particles.number[worst])
    least = ranks.allgathered(comm, least[worst])
    if least.min(initial=0.0) >= -limit:
        return None
    return int(numbers[least.argmin()]), float(least.min())


def _warn_of(domain: Domain, reason: str) -> None:
    """Warn of a softening material."""
    if domain.model.grid.comm.rank:
        return
    warn(
        f"the material softens: {reason}. Strain will localise in bands as wide as a cell, so the load "
        "and the energy beyond the peak depend on the grid: scale the slope of softening with h, or "
        "compare several h",
        SofteningWarning,
    )
