"""Borders of all shapes: closed, with the right lengths and names; boxes at any place."""

from __future__ import annotations

import meshio
import moments
import numpy as np
import pytest
import shapely
from mpi4py import MPI

import tawami

GRID = tawami.Grid(MPI.COMM_WORLD, origin=(-0.13, 0.2), h=0.17, cells=(20, 18))
PLACES = [(1.2137, 1.3391), (1.57, 1.9), tuple(GRID.in_metres(np.array([9.0, 7.5])))]
ANGLES = [0.0, 0.4, np.pi / 4, 1.83]
#: An L, as corners around the origin.
SHAPE = np.array([[-0.5, -0.6], [0.6, -0.6], [0.6, 0.1], [0.1, 0.1], [0.1, 0.7], [-0.5, 0.7]])


def turned(place, angle, shape=SHAPE):
    c, s = np.cos(angle), np.sin(angle)
    return shape @ np.array([[c, s], [-s, c]]) + place


def check(body, length=None, count=3):
    """Sum n dA = 0 and sum x.n dA = 2 area, for the area of the particles; the border's length."""
    points = body.border.points(body_grid(body), count)
    size = points.length.sum()
    assert points.length @ points.normal == pytest.approx([0, 0], abs=1e-12 * size)
    area = points.length @ (points.x * points.normal).sum(axis=1) / 2
    assert area == pytest.approx(body.volume.sum(), rel=1e-12)
    if length is not None:
        assert size == pytest.approx(length, rel=1e-12)
    return points


def body_grid(body):
    origin, h, cells = body.lattice
    return tawami.Grid(MPI.COMM_WORLD, origin=origin, h=h, cells=cells)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("angle", ANGLES)
def test_polygons(place, angle):
    corners = turned(place, angle)
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    hole = turned(place, angle, 0.2 * SHAPE - [0.2, 0.3])
    body = tawami.polygon(GRID, corners, holes=[hole])
    check(body, 1.2 * sides.sum())
    lengths = np.concatenate([sides, 0.2 * sides])
    assert body.border.names == tuple(map(str, range(12)))
    assert list(body.border.lengths.values()) == pytest.approx(lengths, rel=1e-12)
    other = tawami.polygon(GRID, corners[::-1], names=list("abcdef"))
    assert list(other.border.lengths.values()) == pytest.approx(sides[[4, 3, 2, 1, 0, 5]])
    check(other, sides.sum())
    names = {0: "base", 3: "step", 6: "well"}
    named = tawami.polygon(GRID, corners, holes=[hole], names=names).border
    expected = {"base": sides[0], "step": sides[3], "well": 0.2 * sides[0]}
    assert {name: named.lengths[name] for name in expected} == pytest.approx(expected)


def test_geometries_of_shapely():
    """Sides follow the coordinates; sides that parts share are inside."""
    one = shapely.Point(1.2, 1.4).buffer(0.8) - shapely.Point(1.3, 1.5).buffer(0.2)
    body = tawami.polygon(GRID, one)
    check(body, one.length)
    assert len(body.border.names) == len(shapely.get_coordinates(one)) - 2
    two = shapely.MultiPolygon([shapely.box(0.2, 0.5, 1.1, 1.3), shapely.box(1.1, 0.7, 2.1, 1.9)])
    check(tawami.polygon(GRID, two), two.length - 2 * 0.6)
    apart = shapely.MultiPolygon([shapely.box(0.2, 0.5, 1.1, 1.3), shapely.box(1.3, 0.7, 2, 1.9)])
    check(tawami.polygon(GRID, apart), apart.length)


def test_a_vertex_near_a_line_moves_the_border():
    line = float(GRID.axis_positions(0, 4, 0))
    body = tawami.polygon(GRID, [(line + 1e-9, 0.5), (2.0, 0.5), (2.0, 1.1), (line + 1e-9, 1.1)])
    points = check(body)
    assert (points.x[points.tag == 3, 0] == line).all()


def test_wrong_names_of_sides():
    with pytest.raises(
        tawami.InputError, match="polygon: names = 3 names: expected one for each of the 6"
    ):
        tawami.polygon(GRID, turned(PLACES[0], 0.0), names=["a", "b", "c"])
    with pytest.raises(
        tawami.InputError, match="names for side 9: expected numbers of sides, from 0 to 5"
    ):
        tawami.polygon(GRID, turned(PLACES[0], 0.0), names={9: "a"})


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("inner", [0.0, 0.3137])
def test_discs_and_rings(place, inner):
    body = tawami.disc(GRID, place, 0.9, inner=inner)
    check(body, 2 * np.pi * (0.9 + inner))
    lengths = {"outer": 1.8 * np.pi, "inner": 2 * np.pi * inner}
    assert body.border.lengths == pytest.approx({k: v for k, v in lengths.items() if v}, rel=1e-14)


@pytest.mark.parametrize("place", PLACES)
def test_a_circle_as_a_level_set(place):
    body = tawami.level_set(GRID, lambda x, y: np.hypot(x - place[0], y - place[1]) - 0.9)
    points = check(body)
    assert body.border.lengths == pytest.approx({"border": 1.8 * np.pi}, rel=1e-6)
    assert points.chain.max() == 0
    away = (points.x - place) / 0.9
    assert np.linalg.norm(away, axis=1) == pytest.approx(1, abs=1e-4)
    assert (points.normal * away).sum(axis=1).min() > 0.999


def test_corners_of_a_level_set():
    """They are rounded off in pieces; four chains and the corner of the first piece are left."""

    def f(x, y):
        a, b = turned((0, 0), 0.3, np.stack([x - 1.2, y - 1.4], axis=-1)).T
        return np.maximum(abs(a), abs(b)) - 0.6

    body = tawami.level_set(GRID, f)
    points = check(body)
    assert body.border.length.sum() == pytest.approx(4.8, rel=1e-4)
    sides = np.bincount(points.chain, points.length)
    assert sides[sides > 0.01] == pytest.approx(1.2, abs=0.02)
    assert len(sides) in (4, 5)


def test_level_sets_that_end_on_edges():
    """A slope, a strip, everything, and the outside of a circle around a corner, with the corner."""
    width, height = 3.4, 3.06
    ends = ("left", "right", "bottom", "top")

    def border(f, **options):
        body = tawami.level_set(GRID, f, ends=ends, **options)
        check(body)
        return pytest.approx(body.border.lengths, rel=1e-5)

    x0, y0 = GRID.origin
    long = width * np.hypot(1, 0.5)
    slope = border(lambda x, y: (y - y0) - 0.5 * (x - x0) - 0.4, name="slope")
    assert slope == {"slope": long, "left": 0.4, "right": 0.4 + width / 2, "bottom": width}
    strip = border(lambda x, y: abs(x - 1.0) - 0.4)
    assert strip == {"border": 2 * height, "bottom": 0.8, "top": 0.8}
    assert border(lambda x, y: -1.0) == {
        "left": height, "right": height, "bottom": width, "top": width,
    }  # fmt: skip
    outside = border(lambda x, y: 0.5 - np.hypot(x - x0, y - y0))
    assert outside == {
        "border": np.pi / 4, "left": height - 0.5, "right": height, "bottom": width - 0.5, "top": width,
    }  # fmt: skip
    inside = border(lambda x, y: np.hypot(x - x0, y - y0) - 0.5)
    assert inside == {"border": np.pi / 4, "left": 0.5, "bottom": 0.5}
    with pytest.raises(tawami.InputError, match="name = 'left': expected a name, and no edge"):
        tawami.level_set(GRID, lambda x, y: x, name="left")


@pytest.mark.parametrize(
    "f",
    [
        lambda x, y: (
            np.hypot(x - 1.6, y - 1.7) - 0.9 * abs(np.sin(1.5 * np.arctan2(y - 1.7, x - 1.6)))
        ),
        lambda x, y: abs(np.hypot(x - 1.2, y - 1.4) - 0.8) - 0.012,
        lambda x, y: np.minimum(np.hypot(x - 1, y - 1.4) - 0.4, np.hypot(x - 1.82, y - 1.5) - 0.4),
        lambda x, y: np.maximum(abs(x - 0.89), abs(y - 1.5)) - 0.51,
    ],
    ids=["cusps", "thin ring", "two discs", "along lines"],
)
def test_level_sets_are_closed(f):
    check(tawami.level_set(GRID, f, tolerance=1e-4))


def quads(turn):
    """Three squares in a row, the nodes of the last one its own, and a triangle on the first two."""
    nodes = np.array(
        [(x, y) for y in (0, 0.5) for x in (0, 0.5, 1.0)]
        + [(1, 0), (1.5, 0), (1.5, 0.5), (1, 0.5), (0.5, 1)]
    )
    return turned((1.3, 1.2), turn, nodes), [[0, 1, 4, 3], [1, 2, 5, 4], [6, 7, 8, 9]], [[3, 5, 10]]


@pytest.mark.parametrize("turn", ANGLES)
def test_meshes(turn):
    """Sides of two elements are inside, also with hanging nodes or nodes of their own."""
    nodes, quadrilaterals, triangle = quads(turn)
    lines = [[0, 1], [1, 2], [5, 10], [1, 4]]
    cells = [("quad", quadrilaterals), ("triangle", triangle), ("line", lines)]
    tags = [np.array([2, 2, 2]), np.array([3]), np.array([7, 7, 8, 9])]
    names = {"soil": [2, 2], "fill": [3, 2], "base": [7, 1], "slope": [8, 1], "inside": [9, 1]}
    for options in (
        {"cell_data": {"gmsh:physical": tags}, "field_data": {n: np.array(v) for n, v in names.items()}},
        {"cell_sets": {
            "base": [np.array([], int), np.array([], int), np.array([0, 1])],
            "slope": [np.array([], int), np.array([], int), np.array([2])],
        }},
        {"point_sets": {"base": [0, 1, 2], "slope": [5, 10], "all": list(range(11))}},
    ):  # fmt: skip
        body = tawami.mesh(GRID, meshio.Mesh(nodes, cells, **options))
        rest = "all" if "point_sets" in options else "border"
        diagonal = np.hypot(0.5, 0.5)
        assert body.border.lengths == pytest.approx(
            {"base": 1.0, "slope": diagonal, rest: 2.0 + diagonal}, rel=1e-12
        )
        check(body)


def test_a_side_in_several_groups():
    nodes, quadrilaterals, _ = quads(0.4)
    lines, sets = [[0, 1], [1, 2]], {"base": [[], [0, 1]], "footing": [[], [1]]}
    source = meshio.Mesh(nodes, [("quad", quadrilaterals), ("line", lines)], cell_sets=sets)
    with pytest.warns(tawami.GeometryWarning, match=r"several groups \('base' and 'footing'\)"):
        body = tawami.mesh(GRID, source)
    assert body.border.lengths["base"] == pytest.approx(1.0)


BOXES = [((0.31, 0.45), (1.93, 2.2)), ((-0.13, 0.2), (3.2, 0.31)), ((0.9, 0.9), (0.95, 1.02)),
         ((0.04, 1.01), (0.21, 2.0))]  # fmt: skip


@pytest.mark.parametrize("gauss", [False, True])
@pytest.mark.parametrize(("lower", "upper"), BOXES)
def test_a_box_anywhere(lower, upper, gauss):
    """Area and moments are those of the polygon and, with Gauss points, exact."""
    size = np.subtract(upper, lower)
    body = tawami.box(GRID, lower, upper, gauss=gauss)
    assert body.volume.sum() == pytest.approx(size.prod(), rel=1e-12)
    assert (body.volume > 0).all()
    assert body.border.lengths == pytest.approx(
        {"bottom": size[0], "right": size[1], "top": size[0], "left": size[1]}, rel=1e-12
    )
    check(body)
    corners = np.array([lower, (upper[0], lower[1]), upper, (lower[0], upper[1])])
    polygon = moments.of_particles(tawami.polygon(GRID, corners, gauss=gauss))
    assert moments.of_particles(body) == pytest.approx(polygon, rel=1e-11)
    if gauss:
        exact = moments.of_polygons(corners[None])
        assert moments.of_particles(body) == pytest.approx(exact, rel=1e-12)


def test_a_box_on_lines_has_equal_particles():
    lower, upper = (GRID.in_metres(np.array(index)) for index in ([2, 3], [7, 9]))
    body = tawami.box(GRID, lower, upper, per_axis=2)
    i, j = np.arange(2, 7, 0.5) + 0.25, np.arange(3, 9, 0.5) + 0.25
    x, y = (part.ravel() for part in np.meshgrid(i, j))
    assert (body.x == np.array(GRID.origin) + GRID.h * np.column_stack([x, y])).all()
    assert (body.volume == body.volume[0]).all()
    near = tawami.box(GRID, lower + 1e-9, upper - 1e-9, per_axis=2)
    assert (near.x == body.x).all()
    assert near.border.start == pytest.approx(body.border.start, abs=0)
