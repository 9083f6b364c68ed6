"""Patches: lengths, sums and means, regrouping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from border.contacts import line
from numpy.testing import assert_allclose, assert_array_equal

from tawami.border.patches import Patches, patches
from tawami.border.points import BorderPoints


def joined(*parts):
    arrays = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("x", "length", "normal", "tag", "chain", "along")
    }
    return BorderPoints(names=("base",), **arrays)


@pytest.mark.parametrize(
    ("size", "count"), [(0.25, 4), (0.26, 3), (0.3, 3), (0.5, 2), (0.51, 1), (3.0, 1)]
)
def test_patches_are_equally_long_and_not_shorter_than_the_size(size, count):
    groups = patches(line((0, 0), (0.6, 0.8), 24), size)
    assert groups.count == count
    lengths = groups.sums(line((0, 0), (0.6, 0.8), 24).length)
    assert_allclose(lengths, 1 / count, atol=1 / 24)
    assert (np.diff(groups.number) >= 0).all()


def test_chains_have_their_own_patches_in_any_order_of_points():
    first, second = line((0, 0), (1, 0), 8), line((1, 0), (1, 2), 16, chain=1)
    points = joined(first, second)
    groups = patches(points, 0.25)
    assert groups.count == 4 + 8
    assert_allclose(groups.sums(points.length), 0.25)
    assert not set(groups.number[: len(first)]) & set(groups.number[len(first) :])
    order = np.random.default_rng(0).permutation(len(points))
    assert_array_equal(patches(points[order], 0.25).number, groups.number[order])


def test_parts_of_a_chain_that_are_apart_share_no_patch():
    points = line((0, 0), (1, 0), 10)
    x = points.x[:, 0]
    part = points[(x < 0.3) | (x > 0.6)]
    groups = patches(part, 0.4)
    assert_array_equal(groups.number, np.where(part.x[:, 0] < 0.5, 0, 1))


def test_a_closed_chain_is_divided_from_its_start():
    angle = 2 * np.pi * (np.arange(60) + 0.5) / 60
    x = np.column_stack([np.cos(angle), np.sin(angle)])
    zeros, length = np.zeros(60, dtype=np.int64), np.full(60, 2 * np.pi / 60)
    circle = BorderPoints(x, length, x, zeros, ("outer",), zeros, angle)
    groups = patches(circle, 1.0)
    assert_array_equal(groups.number, np.repeat(np.arange(6), 10))


def test_a_chain_of_few_points_has_no_empty_patch():
    points = replace(line((0, 0), (1, 0), 1), length=np.array([0.8, 0.1, 0.1]))
    assert set(patches(points, 0.1).number) == set(range(patches(points, 0.1).count))
    empty = patches(points[:0], 0.1)
    assert empty.count == 0
    assert empty.sums(np.zeros((0, 2))).shape == (0, 2)


def test_sums_and_means_of_vectors():
    groups = Patches(np.array([1, 0, 1]), 2)
    values = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    assert_array_equal(groups.sums(values), [[3, 4], [6, 8]])
    weights = np.array([1.0, 2.0, 3.0])
    assert_array_equal(groups.means(weights, values), [[3, 4], [4, 5]])
    assert_array_equal(groups.means(weights, values[:, 0]), [3, 4])
    assert_array_equal(groups.shares(weights), [0.25, 1, 0.75])


def test_regrouping_a_stretched_border_keeps_the_resultant():
    points = line((0, 0), (1, 0), 12)
    old = patches(points, 0.25)
    stretched = points.length * np.linspace(1.0, 3.0, len(points))
    new = patches(points, 0.25, length=stretched)
    assert (old.count, new.count) == (4, 8)
    lengths = new.sums(stretched)
    assert_allclose(lengths, lengths.mean(), atol=stretched.max())
    values = np.array([1.0, -2.0, 5.0, 3.0])
    carried = new.means(stretched, values[old.number])
    assert new.sums(stretched) @ carried == pytest.approx(old.sums(stretched) @ values)
    assert_allclose(new.means(stretched, np.ones(4)[old.number]), 1.0)
