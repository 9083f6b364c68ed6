"""Projection of values at the particles on the functions of the grid."""

from __future__ import annotations

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.domain.domain import Domain
from tawami.grid.basis import Basis

#: Size of the residual of the projection over that of its right-hand side, and most iterations. The part
#: that iterations do not find is lost, and rounding would make it depend on the number of ranks.
TOLERANCE, MOST_ITERATIONS = 1e-11, 200


def least_squares(
    domain: Domain, basis: Basis, weight: Array, values: Array
) -> tuple[Array, Array]:
    """Weighted projection of values at particles on the functions of a basis; a call for all ranks.

    Conjugate gradients, preconditioned by the lumped mass. Few particles in a cell make the mass
    singular; the right-hand side is in its range, so that they converge nevertheless. A regularised mass
    would dissipate a little energy in every step, and a body would never come to rest.

    Args:
        domain: The particles.
        basis: The functions.
        weight: Weight of each particle of this rank.
        values: Their values.

    Returns:
        The coefficients in the window, and the field at the particles of this rank.
    """

    def at_particles(coefficients: Array) -> Array:
        return np.asarray(_rust.interpolate(domain.location, basis, 1, coefficients)).ravel()

    def sums(of_particles: Array) -> Array:
        return domain.sums(weight, of_particles.reshape(-1, 1), basis)[:, 0]

    def dot(a: Array, b: Array) -> float:
        return domain.layout.functions.dot(basis, a, b)

    lumped = sums(np.ones_like(values))
    inverse = np.divide(1.0, lumped, out=np.zeros_like(lumped), where=lumped > 0.0)
    residual = sums(values)
    found, at_found = np.zeros_like(residual), np.zeros_like(values)
    direction = preconditioned = inverse * residual
    size = start = dot(residual, preconditioned)
    for _ in range(MOST_ITERATIONS):
        if not size > TOLERANCE**2 * start:
            break
        at_direction = at_particles(direction)
        image = sums(at_direction)
        step = size / dot(direction, image)
        found, at_found = found + step * direction, at_found + step * at_direction
        residual = residual - step * image
        preconditioned = inverse * residual
        before, size = size, dot(residual, preconditioned)
        direction = preconditioned + size / before * direction
    return found, at_found
