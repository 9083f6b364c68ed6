"""Whether displacement gradients of a run of small strain are still small, and its stresses exact."""

from __future__ import annotations

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.errors import ConvergenceError, SmallStrainWarning
from tawami.base.warn import warn
from tawami.domain.domain import Domain
from tawami.solve.equations import STATIC
from tawami.solve.inertia import EPSILON
from tawami.solve.newton import Converged

#: Largest displacement gradient (spectral norm) of a run of small strain: terms of second order, which
#: small strain neglects, are then a tenth of the strain.
LARGEST = 0.2
#: Deviatoric strain increment below which a law loses no digits that matter.
HARMLESS = 1.0


def check_digits(domain: Domain, step: Converged, tolerance: float) -> None:
    """Check that the stresses of a step are not round-off; a call for all ranks.

    Raises:
        ConvergenceError: They are.
    """
    lost = _digits_lost(domain, step.coefficients)
    if lost > tolerance:
        raise ConvergenceError(
            f"the strains of the step are so large that round-off is {lost:.1g} of the stresses: "
            f"expected at most {tolerance:g}, the tolerance. Nothing was changed in the particles. "
            f"{STATIC}",
            step.history,
        )


def _digits_lost(domain: Domain, coefficients: Array) -> float:
    """Round-off in the deviatoric stresses of a step, relative to the largest of these stresses.

    A law computes a stress as the trial stress, 2 mu e, less its plastic part. Beyond a limit load,
    Newton's method may follow an increment without end, of which the trial stress has all digits and the
    stress has none. A call for all ranks.

    Args:
        domain: The particles.
        coefficients: Increments of all fields at the end of a step.
    """
    comm, fields = domain.model.grid.comm, domain.layout.split(coefficients)
    gradients = domain.all_gradients(domain.model.space.vectors(fields[0]))
    # the Frobenius norm is an upper bound, and costs less
    bound = np.einsum("pij,pij->p", gradients, gradients)
    if ranks.largest(comm, float(bound.max(initial=0.0))) <= HARMLESS**2:
        return 0.0
    strains = 0.5 * (gradients + gradients.transpose(0, 2, 1))
    volume = np.trace(strains, axis1=1, axis2=2)
    strains -= volume[:, None, None] / 3 * np.eye(gradients.shape[1])
    sizes = np.sqrt(np.einsum("pij,pij->p", strains, strains))
    if ranks.largest(comm, float(sizes.max(initial=0.0))) <= HARMLESS:
        return 0.0
    trial = 2 * ranks.largest(comm, float((domain.constants["mu"] * sizes).max(initial=0.0)))
    deviators = np.zeros((len(sizes), domain.model.space.num_strains))
    with ranks.raise_together(comm):
        requests = _rust.Requests([[("s", "value", 0, None)]])
        domain.stage.evaluate(*fields, requests, [deviators])
    stress = ranks.largest(comm, float(np.linalg.norm(deviators, axis=1).max(initial=0.0)))
    return float(np.divide(EPSILON * trial, stress))


def exceeded(domain: Domain, total: Array) -> tuple[int, float] | None:
    """Number of the particle with the largest displacement gradient, and this, if it is too large.

    A call for all ranks.

    Args:
        domain: The particles.
        total: Coefficients of the displacement since the start [m].
    """
    gradients = domain.all_gradients(domain.model.space.vectors(total))
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
        f"{domain.model.form.name} neglects its square: expected up to {LARGEST:g}. Use a form of "
        "finite strain (form='u_epsv_finite'), or smaller loads",
        SmallStrainWarning,
    )
