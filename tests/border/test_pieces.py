"""The border of a body: points that integrate over it, its parts, and borders that are joined."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

GRID = tawami.Grid(MPI.COMM_WORLD, origin=(-0.13, 0.2), h=0.17, cells=(20, 18))
CORNERS = np.array([[0.1, 0.5], [2.3, 0.4], [2.1, 2.7], [1.3, 1.1], [0.2, 2.3]])
MIDDLE, RADIUS = (1.2137, 1.3391), 0.8123


def polyline(**options):
    return tawami.polyline(CORNERS, **options)


def circle(place=MIDDLE, radius=RADIUS, **options):
    return tawami.disc(GRID, place, radius, **options).border


def integral(points, values=1.0):
    return (np.asarray(values).T * points.length).sum(axis=-1)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_gauss_points_on_slanted_pieces(count):
    """Exact for degree 2 count - 1 along a straight piece, between any lines of the grid."""
    a, b = np.array([0.05, 0.31]), np.array([2.9, 1.83])
    points = tawami.polyline([a, b], closed=False).points(GRID, count)
    degree = 2 * count - 1
    share = np.polynomial.Polynomial([a[0], b[0] - a[0]]) ** degree
    exact = np.linalg.norm(b - a) * share.integ()(1.0)
    error = integral(points, points.x[:, 0] ** degree) / exact - 1
    assert abs(error) < 1e-9  # short parts have fewer points
    assert np.ptp(points.normal, axis=0) == pytest.approx(0, abs=1e-13)
    assert points.normal[0] @ (b - a) == pytest.approx(0, abs=1e-13)
    (dx, dy), (nx, ny) = b - a, points.normal[0]
    assert dx * ny - dy * nx < 0  # on the right of the way


@pytest.mark.parametrize("radius", [0.05, 0.17, 0.6, RADIUS])
def test_points_on_arcs(radius):
    """Length, normals and second moments of a circle to round-off, however coarse the grid."""
    points = circle(radius=radius).points(GRID, 3)
    away = points.x - MIDDLE
    assert np.linalg.norm(away, axis=1) == pytest.approx(radius, rel=1e-14)
    assert points.normal == pytest.approx(away / radius, abs=1e-12)
    assert points.length.sum() == pytest.approx(2 * np.pi * radius, rel=1e-14)
    assert integral(points, points.normal) == pytest.approx([0, 0], abs=1e-14)
    second = integral(points, away[:, 0] ** 2), integral(points, away.prod(axis=1))
    assert second == pytest.approx((np.pi * radius**3, 0), abs=1e-12)


@pytest.mark.parametrize("border", [polyline(), circle(), circle(inner=0.31)])
def test_parts_lie_between_lines(border):
    parts = border.at_lines(GRID)
    assert parts.length.sum() == pytest.approx(border.length.sum(), rel=1e-14)
    cell = GRID.in_cells(parts.at(np.arange(len(parts.start)), np.full(len(parts.start), 0.5)))
    ends = GRID.in_cells(np.stack([parts.start, parts.end]))
    assert (ends > np.floor(cell) - 1e-12).all()
    assert (ends < np.floor(cell) + 1 + 1e-12).all()


def test_points_on_a_line_of_the_grid_stay_there():
    line = float(GRID.axis_positions(0, 7, 0))
    border = tawami.polyline([(line, 0.3), (line, 2.9)], closed=False)
    assert (border.points(GRID, 3).x[:, 0] == line).all()


def test_short_parts_have_fewer_points():
    """With fewer than three, sums of splines over the border would not be exact."""
    size = GRID.h / np.array([200, 20, 3])
    x = GRID.origin[0] + 0.3 * GRID.h + np.array([0, *np.cumsum(size)])
    corners = np.column_stack([x, np.full(4, 0.25)])
    points = tawami.polyline(corners, closed=False).points(GRID, 5)
    assert [(points.tag == k).sum() for k in range(3)] == [3, 3, 5]


def test_chains():
    """A circle is one chain, each side of a polygon another; distances are along the border."""
    ring = circle(inner=0.31).points(GRID, 3)
    assert ring.chain.max() == 1
    for k, radius in enumerate((RADIUS, 0.31)):
        along = ring.along[ring.chain == k]
        assert (np.diff(along) > 0).all()
        turn = np.unwrap(np.arctan2(*(ring.x[ring.chain == k] - MIDDLE).T[::-1]))
        assert along == pytest.approx(radius * np.abs(turn), abs=1e-12)
    sides = polyline().points(GRID, 3)
    assert (np.diff(sides.chain) >= 0).all()
    for k, (a, name) in enumerate(zip(CORNERS, "01234", strict=True)):
        mine = sides[sides.chain == k]
        assert {mine.names[tag] for tag in mine.tag} == {name}
        assert mine.along == pytest.approx(np.linalg.norm(mine.x - a, axis=1), abs=1e-12)


def test_corners_and_names_end_chains():
    """Below 20 degrees there is no corner; another name ends a chain too."""
    turns = np.radians([0, 15, 30, 55])
    x = np.cumsum([(0.3, 0.5), *(0.4 * np.array([np.cos(t), np.sin(t)]) for t in turns)], axis=0)
    one = tawami.polyline(x, names="side", closed=False).points(GRID, 3)
    assert one.chain.max() == 1
    assert one.along.max() == pytest.approx(1.2, abs=0.02)
    two = tawami.polyline(x, names=["a", "a", "b", "b"], closed=False).points(GRID, 3)
    assert two.chain.max() == 2


def test_clockwise_corners_are_reversed():
    border = polyline(names=["a", "b", "c", "d", "e"])
    other = tawami.polyline([*CORNERS[::-1], CORNERS[-1]], names=["d", "c", "b", "a", "e"])
    assert other.lengths == pytest.approx(border.lengths, rel=1e-14)
    for one in (border, other):
        points = one.points(GRID, 3)
        area = integral(points, (points.x * points.normal).sum(axis=1)) / 2
        x, y = CORNERS.T
        assert area == pytest.approx(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)), rel=1e-13)
    assert polyline(names={1: "wall"}).names == ("0", "wall", "2", "3", "4")
    assert (
        repr(polyline(names="wall")) == f"Border(5 pieces, {border.length.sum():g} m: wall "
        f"{border.length.sum():g} m)"
    )


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.9])
def test_where_splits_a_circle(turn):
    """The part on one side of a line at any angle, to 1e-12."""
    c, s = np.cos(turn), np.sin(turn)
    part = circle().where(GRID, lambda x, y: c * (x - MIDDLE[0]) + s * (y - MIDDLE[1]) > 0.4)
    exact = 2 * RADIUS * np.arccos(0.4 / RADIUS)
    assert part.lengths["outer"] == pytest.approx(exact, abs=1e-12)
    resultant = integral(part.points(GRID, 3), part.points(GRID, 3).normal)
    assert resultant == pytest.approx(2 * np.sqrt(RADIUS**2 - 0.16) * np.array([c, s]), abs=1e-12)


@pytest.mark.parametrize("limit", [0.7123, float(GRID.axis_positions(0, 5, 0))])
def test_where_splits_straight_pieces(limit):
    """Inside of a cell, and at a line of the grid."""
    part = tawami.box(GRID, (0.2, 0.5), (2.1, 1.4)).border.where(GRID, lambda x, y: x < limit)
    expected = {"bottom": limit - 0.2, "right": 0, "top": limit - 0.2, "left": 0.9}
    assert part.lengths == pytest.approx(expected, abs=1e-12)
    assert part.where(GRID, lambda x, y: False).lengths["left"] == 0
    assert part.where(GRID, lambda x, y: True).lengths == pytest.approx(part.lengths, abs=1e-12)


@pytest.mark.parametrize(
    ("f", "message"),
    [
        ("right", "where = 'right': expected a function"),
        (lambda x, y: x.nothing, None),
        (lambda x, y: bool(x > 1), r"failed on arrays .* expected f\(x, y\) -> mask"),
        (lambda x, y: (x > 1)[:3], r"an array of shape \(3,\): expected"),
        (lambda x, y: x - 1, "returned float64: expected a mask of True and False"),
    ],
)
def test_wrong_functions(f, message):
    kind = AttributeError if message is None else tawami.InputError
    with pytest.raises(kind, match=message):
        polyline().where(GRID, f)


def test_parts_by_name():
    border = polyline(names=["base", "side", "base", "top", "top"])
    assert border.named("top").lengths["top"] == pytest.approx(border.lengths["top"])
    both = border.named(["base", "side"])
    assert both.length.sum() == pytest.approx(border.lengths["base"] + border.lengths["side"])
    with pytest.raises(
        tawami.InputError,
        match="no part 'bse': expected one of 'base', 'side', 'top'; did you mean 'base'",
    ):
        border.named("bse")
    for wrong in (3, [], None):
        with pytest.raises(tawami.InputError, match="expected one or more of its names, 'base'"):
            border.named(wrong)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"names": ["a"]}, "names = 1 names: expected one for each of the 5 sides"),
        ({"names": {5: "a"}}, "names for side 5: expected numbers of sides, from 0 to 4"),
        ({"names": ["a", "b", "c", "d", ""]}, "names has '': expected names"),
        ({"closed": 1}, "closed = 1: expected True or False"),
    ],
)
def test_wrong_polylines(options, message):
    with pytest.raises(tawami.InputError, match=message):
        polyline(**options)
    with pytest.raises(
        tawami.InputError, match=r"shape \(2, 2\): expected 3 or more finite points"
    ):
        tawami.polyline(CORNERS[:2])
    with pytest.raises(tawami.InputError, match="its corners coincide"):
        tawami.polyline([(1, 1)] * 3, closed=False)
    with pytest.raises(tawami.InputError, match="its corners are on a line: expected an area"):
        tawami.polyline([(1, 1), (2, 2), (3, 3)])
    with pytest.raises(tawami.InputError, match="3 or more finite points"):
        tawami.polyline([(1, 1), (2, np.inf), (3, 3)])


def test_the_axis_is_no_border():
    """A half disc on the axis: the integral of 2 pi r over its arc is the area of a sphere."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(6, 8), geometry="axisymmetric")
    points = tawami.disc(grid, (0, 1), 0.9).border.points(grid, 3)
    assert integral(points, grid.space.thickness(points.x)) == pytest.approx(
        4 * np.pi * 0.81, rel=1e-13
    )
    cylinder = tawami.box(grid, (0, 0.3), (1.1, 1.9)).border.points(grid, 3)
    exact = 2 * np.pi * 1.1 * 1.6 + 2 * np.pi * 1.1**2
    assert integral(cylinder, grid.space.thickness(cylinder.x)) == pytest.approx(exact, rel=1e-13)
