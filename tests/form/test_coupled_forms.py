"""Shipped forms with fields of their own: tangents, and closed forms of small problems."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import COUPLED

import tawami


def prepared(scene: tawami.Scene) -> tawami.Scene:
    """The scene with the data of its form, and old fields that vary."""
    scene.gravity((0.3, -0.2))
    for name in scene.form.data:
        scene.data(name, lambda x, y: 1.0 + 0.1 * x)
    for name in scene.form.own_fields:
        scene.initial(name, lambda x, y: 0.2 + 0.1 * x * y)
    return scene


@pytest.mark.parametrize("name", COUPLED)
def test_the_tangent_is_the_difference_of_residuals(random_scene, name):
    scene = prepared(random_scene(density=1.0, **COUPLED[name]))
    random = np.random.default_rng(1)
    c, d = 0.02 * random.standard_normal((2, scene.num_coefficients))
    step = 1e-4
    ends = [scene.residual(c + sign * step * d, dt=0.3) for sign in (1, -1)]
    difference = (ends[0] - ends[1]) / (2 * step)
    predicted = scene.tangent(c, dt=0.3) @ d
    assert np.abs(difference - predicted).max() < 1e-7 * np.abs(predicted).max()
