"""Borders of bodies that are joined: common parts are inside."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

GRID = tawami.Grid(MPI.COMM_WORLD, origin=(-0.13, 0.2), h=0.17, cells=(20, 18))


def box(low, high):
    return tawami.box(GRID, low, high)


def closed(body, rel=1e-6):
    """Check that the border encloses the area of the body; its points."""
    points = body.border.points(GRID, 3)
    assert points.length @ points.normal == pytest.approx([0, 0], abs=rel * points.length.sum())
    area = points.length @ (points.x * points.normal).sum(axis=1) / 2
    assert area == pytest.approx(body.volume.sum(), rel=rel)
    return points


def test_layers():
    """The interface vanishes, and the sides of both layers are one chain."""
    lower, upper = box((0.31, 0.45), (1.93, 1.2)), box((0.31, 1.2), (1.93, 2.2))
    body = lower + upper
    assert body.border.lengths == pytest.approx(
        {"bottom": 1.62, "right": 1.75, "top": 1.62, "left": 1.75}, rel=1e-14
    )
    points = closed(body)
    assert points.chain.max() == 3
    assert closed(upper + lower).chain.max() == 3


def test_a_block_on_a_layer():
    """Only the covered part of the layer's top vanishes; the bottom of the block does, with its name."""
    layer, block = box((0.31, 0.45), (1.93, 1.2)), box((0.51, 1.2), (1.23, 2.2))
    body = layer + block
    expected = {"bottom": 1.62, "right": 1.75, "top": 1.62, "left": 1.75}
    assert body.border.lengths == pytest.approx(expected, rel=1e-14)
    closed(body)
    named = tawami.polygon(GRID, [(0.51, 1.2), (1.23, 1.2), (0.8, 1.9)], names=["foot", "a", "b"])
    assert (layer + named).border.names == ("bottom", "right", "top", "left", "a", "b")
    with pytest.raises(tawami.InputError, match="no part 'foot'"):
        (layer + named).border.named("foot")


def test_several_neighbours():
    """Two blocks on one side, rounded differently, and a body in the gap between them."""
    base = box((0.3, 0.5), (2.5, 1.0))
    parts = [
        box((0.3, 1.0 + 1e-9), (1.1, 1.4)),
        box((1.1, 1.0), (1.7, 1.4)),
        box((1.7, 1.0), (2.5, 1.4)),
    ]
    body = sum([base, *parts])
    assert body.border.length.sum() == pytest.approx(2 * (2.2 + 0.9), rel=1e-7)
    closed(body)


@pytest.mark.parametrize("place", [(1.2, 1.3), (1.2137, 1.3391)])
def test_a_disc_in_a_ring(place):
    ring, disc = (tawami.disc(GRID, place, r, inner=i) for r, i in ((0.8, 0.31), (0.31, 0)))
    body = ring + disc
    assert body.border.lengths == pytest.approx({"outer": 1.6 * np.pi}, rel=1e-14)
    closed(body)
    smaller = ring + tawami.disc(GRID, place, 0.3)  # with a gap: nothing is common
    assert smaller.border.length.sum() == pytest.approx(2 * np.pi * (0.8 + 0.31 + 0.3), rel=1e-14)


def test_part_of_an_arc():
    """Three quarters of a circle meet a half circle: a quarter more of it is common."""
    disc = tawami.disc(GRID, (1.2, 1.3), 0.31).border
    ring = tawami.disc(GRID, (1.2, 1.3), 0.8, inner=0.31).border
    half = disc.where(GRID, lambda x, y: y < 1.3 + 0.31 * np.sin(0.4))
    both = ring.joined(half)
    assert both.lengths == pytest.approx(
        {"outer": 1.6 * np.pi, "inner": 0.31 * (np.pi - 0.8)}, abs=1e-9
    )


def test_many_pieces():
    """Two level sets of thousands of pieces that share a straight side; their corners are rounded."""

    def f(x, y):
        return np.hypot(x - 1.2, y - 1.4) - 0.8

    line = float(GRID.axis_positions(0, 8, 0))
    left = tawami.level_set(GRID, lambda x, y: np.maximum(f(x, y), x - line), name="west")
    right = tawami.level_set(GRID, lambda x, y: np.maximum(f(x, y), line - x), name="east")
    assert len(left.border.start) > 1000
    body = left + right
    assert body.border.length.sum() == pytest.approx(1.6 * np.pi, rel=1e-4)
    closed(body, 1e-5)


def test_short_pieces_stay():
    corners = [(0.3, 0.5), (2.1, 0.5), (2.1, 0.5 + 1e-7), (2.1, 1.4)]
    border = tawami.polyline(corners)
    assert border.outside().lengths == border.lengths
    assert len(border.lengths) == 4


def test_a_body_without_border():
    body = box((0.3, 0.5), (1.1, 1.0))
    x = np.array([[2.0, 2.0]])
    assert (body + tawami.Body(x, np.array([1e-3]))).border is None
    assert (tawami.Body(x, np.array([1e-3])) + body).border is None
    square = tawami.polyline([(1.9, 1.9), (2.1, 1.9), (2.1, 2.1), (1.9, 2.1)], names="loose")
    loose = tawami.Body(x, np.array([0.04]), border=square)
    assert loose.named("stone").border is square
    closed(body + loose)
