"""Volumes of the particles that fit the border of the body, for the integrals of a form."""

from __future__ import annotations

import numpy as np

from tawami.base.errors import SupportError
from tawami.field import fitted_volumes, full_cells
from tawami.scene.border import SceneBorder
from tawami.scene.domain import Domain


def fit(domain: Domain, border: SceneBorder) -> None:
    """Let the form integrate with fitted volumes if the scene asks for them.

    Where a part of the border has no particles near it, as after a body broke, volumes are not fitted.
    A call for all ranks.

    Args:
        domain: The particles.
        border: The border of the body.
    """
    particles, points, model = domain.particles, border.points, domain.model
    if points is None or not model.fits:
        return
    try:
        cells = points.cells(domain)
    except SupportError:
        return
    now = volume = np.array(particles.volume)
    if model.moves:
        gradient = np.asarray(particles.displacement_gradient)
        now = volume * np.linalg.det(np.eye(gradient.shape[-1]) + gradient)
    else:
        now = volume = volume * full_cells.factors(
            model.grid, domain.location, volume, particles.material
        )
    area = points.area * model.space.thickness(points.x)[:, None]
    c = fitted_volumes.corrections(cells, area, domain.location, now, domain.layout)
    domain.assembly.integrate_with(volume * (1 + c))
