"""Thin parts of obstacles that are given by their distance."""

from __future__ import annotations

import numpy as np
import pytest

import tawami
from tawami.border.thin import thinnest

SIZE = 0.06


def found(shape):
    return thinnest(lambda x: shape.evaluate(x).distance, (0, 0), (1, 1), SIZE)


def plate(width, angle, length=0.5):
    c, s = np.cos(angle), np.sin(angle)
    x, y = width / 2, length / 2
    corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y)]) @ [[c, s], [-s, c]]
    return tawami.rigid_polygon(np.add(corners, (0.513, 0.527)))


@pytest.mark.parametrize("angle", [0.0, 0.4])
@pytest.mark.parametrize("width", [0.01, 0.03, 0.05, 0.08, 0.12])
def test_a_plate_is_as_wide_as_it_is(width, angle):
    expected = width if width < SIZE else np.inf
    assert found(plate(width, angle)) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("angle", "is_thin"), [(10, True), (25, True), (60, False), (100, False)])
def test_a_wedge_is_thin_if_it_is_so_over_some_length(angle, is_thin):
    half = 0.6 * np.tan(np.radians(angle / 2))
    wedge = tawami.rigid_polygon([(0.5, 0.1), (0.5 + half, 0.7), (0.5 - half, 0.7)])
    assert np.isfinite(found(wedge)) == is_thin


@pytest.mark.parametrize("radius", [0.005, 0.02, 0.06, 0.3])
def test_a_disc_is_thin_if_all_of_it_is(radius):
    assert np.isfinite(found(tawami.rigid_disc((0.513, 0.48), radius))) == (2 * radius < SIZE)


def test_a_half_plane_and_a_hole_are_not_thin():
    assert found(tawami.half_plane((0.0, 0.3), (0.2, 1.0))) == np.inf
    hole = thinnest(lambda x: 0.4 - np.hypot(*(x - 0.5).T), (0, 0), (1, 1), SIZE)
    assert hole == np.inf
