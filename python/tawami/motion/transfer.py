"""Transfers of velocity and acceleration between particles and grid.

With the lumped mass m_i = sum_p N_i m_p, x_i the Greville point of the spline, and after the step

    (m v)_i = sum_p N_i m_p (v_p + C_p (x_i - x_p))      likewise a with its gradient
    v_p += sum_i N_i (v1_i - v_i)                        FLIP; v_i before supports are imposed, so that
                                                         their impulse reaches the particles
    v_p  = sum_i N_i v1_i                                PIC
    C_p  = grad v1 f^-1                                  affine FLIP and TPIC
    C_p  = B_p D_p^-1 f^-1                               APIC (Jiang et al. 2015):
           B_p = sum_i N_i v1_i (x_i - x_p)^T,   D_p = sum_i N_i (x_i - x_p) (x_i - x_p)^T
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tawami.base.arrays import Array
from tawami.domain.domain import Domain

TransferName = Literal["affine_flip", "flip", "apic", "tpic", "pic"]


@dataclass(frozen=True)
class Transfer:
    """A transfer of velocities between particles and grid.

    Attributes:
        name: As a script chooses it.
        gradient: Source of C_p: grad v1, the moments of v1, or none.
        flip: Whether particles get the grid's change of velocity, or its velocity.
    """

    name: str
    gradient: Literal["none", "field", "moments"]
    flip: bool

    def __str__(self) -> str:
        return self.name


TRANSFERS: dict[str, Transfer] = {
    transfer.name: transfer
    for transfer in (
        Transfer("affine_flip", "field", flip=True),
        Transfer("flip", "none", flip=True),
        Transfer("apic", "moments", flip=False),
        Transfer("tpic", "field", flip=False),
        Transfer("pic", "none", flip=False),
    )
}


def to_grid(
    domain: Domain, mass: Array, fields: Sequence[tuple[Array, Array]]
) -> tuple[Array, ...]:
    """Momentum per component of each of several particle fields: functions x dim.

    Args:
        domain: The particles where they are.
        mass: Their masses [kg per metre depth].
        fields: v_p or a_p, particles x dim, each with its gradient, particles x dim x dim.
    """
    points, at = _positions(domain)
    space, columns = domain.model.space, list[Array]()
    for values, gradient in fields:
        at_origin = values - np.einsum("pij,pj->pi", gradient, at)
        columns += [at_origin, gradient.reshape(-1, space.dim**2)]
    sums = np.split(domain.sums(mass, np.hstack(columns)), len(fields), axis=1)
    moments = (np.einsum("ikl,il->ik", space.tensors(s[:, space.dim :]), points) for s in sums)
    return tuple(s[:, : space.dim] + moment for s, moment in zip(sums, moments, strict=True))


def gradient_of(transfer: Transfer, domain: Domain, field: Array, back: Array) -> Array:
    """C_p of a field of the grid at the end of the step: particles x dim x dim.

    Args:
        transfer: Kind of transfer.
        domain: The particles where they were at the start of the step.
        field: v1 or a1, functions x dim.
        back: f^-1, f = I + grad u of the step.
    """
    if transfer.gradient == "none":
        return np.zeros_like(back)
    gradient = domain.gradients(field)
    if transfer.gradient == "moments":
        spread = _moments(domain, None)
        # at the ends of the grid, and on its lines with bilinear functions, D_p is singular
        enough = np.linalg.det(spread) > 1e-8 * domain.model.grid.h ** (2 * domain.model.space.dim)
        moments = _moments(domain, field)[enough]
        gradient[enough] = moments @ np.linalg.inv(spread[enough])
    return np.asarray(gradient @ back)


def _positions(domain: Domain) -> tuple[Array, Array]:
    """x_i and x_p [m] from the corner of the grid.

    x_p is where the functions are evaluated: moving particles keep a small distance from the sides of
    cells.
    """
    points = domain.layout.greville - np.asarray(domain.model.grid.origin)
    return points, domain.at_particles(points)


def _moments(domain: Domain, field: Array | None) -> Array:
    """sum_i N_i field_i (x_i - x_p)^T; the field is x_i - x_p where none is given."""
    points, at = _positions(domain)
    given = points if field is None else field
    mean = at if field is None else domain.at_particles(field)
    columns = [domain.at_particles(given * points[:, [k]]) for k in range(points.shape[1])]
    return np.asarray(np.stack(columns, axis=-1) - mean[:, :, None] * at[:, None, :])
