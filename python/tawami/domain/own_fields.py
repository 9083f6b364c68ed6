"""The fields of a form that no law receives: a pore pressure, a temperature, a damage.

Unknowns are increments of the step. Particles carry the value of each field and its gradient, to which
accepted steps add those of the increments: a field in equilibrium stays so, as a stress does. Where
particles move, the gradient is pushed forward with the step,

    g <- (g + grad c) f^-1,   f = I + grad u,

and the field on the grid, which supports are compared with, is an affine projection of the particles:

    c_i = sum_p V_p N_i (v_p + g_p . (x_i - x_p)) / sum_p V_p N_i.
"""

from __future__ import annotations

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.domain.domain import Domain
from tawami.domain.least_squares import least_squares
from tawami.form.form import Form
from tawami.grid.basis import Basis


def carry(form: Form, particles: _rust.Particles, dim: int) -> None:
    """Give particles the columns of the fields, zero at first: value and gradient."""
    for name in form.own_fields:
        particles.carry(name, 1 + dim)


def at_particles(domain: Domain, basis: Basis, coefficients: Array) -> Array:
    """Value and gradient of a scalar field at this rank's particles, particles x (1 + dim)."""
    dim, location = domain.model.space.dim, domain.location
    flat = np.ascontiguousarray(coefficients)
    value = np.asarray(_rust.interpolate(location, basis, 1, flat))
    first = np.zeros((len(flat), dim))
    first[:, 0] = flat
    gradient = np.asarray(_rust.gradients(location, basis, first.ravel()))
    return np.hstack([value, gradient[:, :dim]])


def on_grid(domain: Domain) -> Array:
    """The fields at the particles as coefficients, 0 for other fields; a call for all ranks."""
    coefficients = np.zeros(domain.layout.size)
    particles = domain.particles
    for name in domain.model.form.own_fields:
        place = domain.layout.fields[name]
        column = particles.carried(name)
        value, gradient = column[:, 0], column[:, 1:]
        at_origin = value - (gradient * particles.x).sum(axis=1)
        data = np.column_stack([np.ones(len(value)), at_origin, gradient])
        sums = domain.sums(particles.volume, data, place.basis)
        points = domain.layout.window.greville(place.basis)
        total = sums[:, 1] + (sums[:, 2:] * points).sum(axis=1)
        coefficients[place.slice] = np.divide(
            total, sums[:, 0], out=np.zeros_like(total), where=sums[:, 0] > 0
        )
    return coefficients


def accept(domain: Domain, coefficients: Array) -> None:
    """Add the increments of a step to the fields of this rank's particles, before these move."""
    model = domain.model
    for name in model.form.own_fields:
        place = domain.layout.fields[name]
        column = domain.particles.carried(name)
        column += at_particles(domain, place.basis, coefficients[place.slice])
        if model.moves:
            u = model.space.vectors(coefficients[: domain.layout.num_displacement])
            f = (
                np.eye(model.space.dim)
                + domain.gradients(u)[:, : model.space.dim, : model.space.dim]
            )
            column[:, 1:] = np.linalg.solve(f.transpose(0, 2, 1), column[:, 1:, None])[..., 0]


def project(domain: Domain) -> None:
    """Replace the fields of the particles by their projections, as `mean_stress` does with the stress.

    After resets of the grid a field is a sum of functions of many grids. Their differences within a cell
    are invisible to the present functions, so that no equation would reduce them. A call for all ranks.
    """
    # few particles in a cell do not determine the gradient of a field there
    enough = domain.particles_per_cell[domain.location.cell] >= domain.model.space.num_vertices
    for name in domain.model.form.own_fields:
        place, column = domain.layout.fields[name], domain.particles.carried(name)
        values = np.array(column[:, 0])
        found, _ = least_squares(domain, place.basis, domain.particles.volume, values)
        column[enough] = at_particles(domain, place.basis, found)[enough]


def start(domain: Domain, name: str, values: Array) -> Array:
    """Give a field values at the particles, and the gradient of their projection on its functions.

    A call for all ranks.

    Returns:
        Coefficients of the field.
    """
    place, column = domain.layout.fields[name], domain.particles.carried(name)
    coefficients, _ = least_squares(domain, place.basis, domain.particles.volume, values)
    column[:] = at_particles(domain, place.basis, coefficients)
    column[:, 0] = values
    return coefficients
