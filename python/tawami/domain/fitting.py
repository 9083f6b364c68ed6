"""Volumes in the integrals of a form: those of the particles, or corrected ones."""

from __future__ import annotations

import numpy as np

from tawami.base.errors import SupportError
from tawami.domain.border import SceneBorder
from tawami.domain.domain import Domain
from tawami.field import fitted_volumes, full_cells


def fit(domain: Domain, border: SceneBorder) -> None:
    """Let the form integrate with the volumes that the scene asks for.

    Where a part of the border has no particles near it, as after a body broke, volumes are not fitted.
    A call for all ranks.

    Args:
        domain: The particles.
        border: The border of the body.
    """
    particles, points, model = domain.particles, border.points, domain.model
    volume = np.array(particles.volume)
    if model.volumes != "own" and not model.moves:
        w = full_cells.factors(model.grid, domain.location, volume, particles.material)
        if (w != 1).any():
            volume *= w
            domain.assembly.integrate_with(volume)
    if points is None or model.volumes != "fitted":
        return
    try:
        cells = points.cells(domain)
    except SupportError:
        return
    now = volume
    if model.moves:
        gradient = np.asarray(particles.displacement_gradient)
        now = volume * np.linalg.det(np.eye(gradient.shape[-1]) + gradient)
    area = points.area * model.space.thickness(points.x)[:, None]
    c = fitted_volumes.corrections(cells, area, domain.location, now, domain.layout)
    domain.assembly.integrate_with(volume * (1 + c))
