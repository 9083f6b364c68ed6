"""Moments of bodies and of polygons, to compare: area, first moments, second moments (xx, yy, xy)."""

from __future__ import annotations

import numpy as np

import tawami


def of_particles(body: tawami.Body, chosen: object = slice(None)) -> np.ndarray:
    """Sums over some of the particles."""
    (x, y), volume = body.x[chosen].T, body.volume[chosen]
    return np.array([(volume * f).sum() for f in (1, x, y, x * x, y * y, x * y)])


def of_polygons(corners: np.ndarray) -> np.ndarray:
    """Sums over the sides of polygons, n x corners x 2, by Green's theorem."""
    x, y = np.moveaxis(corners, -1, 0)
    x1, y1 = np.roll(x, -1, axis=-1), np.roll(y, -1, axis=-1)
    c = x * y1 - x1 * y
    c = c * np.sign(c.sum(axis=-1, keepdims=True))  # either orientation
    sums = [c / 2, (x + x1) * c / 6, (y + y1) * c / 6,
            (x**2 + x * x1 + x1**2) * c / 12, (y**2 + y * y1 + y1**2) * c / 12,
            (x * y1 + 2 * x * y + 2 * x1 * y1 + x1 * y) * c / 24]  # fmt: skip
    return np.array([part.sum() for part in sums])


def of_ring(centre: tuple[float, float], radius: float, inner: float) -> np.ndarray:
    """Closed form for a ring."""
    (x, y), area = centre, np.pi * (radius**2 - inner**2)
    own = np.pi / 4 * (radius**4 - inner**4)
    return np.array(
        [area, area * x, area * y, own + area * x * x, own + area * y * y, area * x * y]
    )
