"""One shape made by several functions gives one solution; linear fields in cut cells are exact."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from profiles import examples
from scenes import grid_of

import tawami

MIDDLE, SIDE, TURN = np.array([1.04, 0.97]), 0.9, 0.3


def corners(side=SIDE, turn=TURN):
    """Corners of a square around the middle."""
    c, s = np.cos(turn), np.sin(turn)
    square = side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return MIDDLE + square @ np.array([[c, s], [-s, c]])


def in_square(x, y):
    c, s = np.cos(TURN), np.sin(TURN)
    u, v = x - MIDDLE[0], y - MIDDLE[1]
    return np.maximum(abs(c * u + s * v), abs(c * v - s * u)) - SIDE / 2


def mesh_of_square(n=9):
    t = np.linspace(0, 1, n + 1)
    a, b, _, d = corners()
    x, y = (part.ravel() for part in np.meshgrid(t, t))
    points = a + x[:, None] * (b - a) + y[:, None] * (d - a)
    corner = (np.arange(n) + (n + 1) * np.arange(n)[:, None]).ravel()
    cells = corner[:, None] + [0, 1, n + 2, n + 1]
    return meshio.Mesh(np.pad(points, ((0, 0), (0, 1))), [("quad", cells)])


def grid_of_two(n=16):
    return tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=2 / n, cells=(n, n))


def hanging(body, grid):
    """Deflection of a body under its weight, with three components of points held."""
    rubber = tawami.linear_elastic(E=1e5, nu=0.45)
    scene = tawami.Scene(grid, body, rubber, density=1e3)
    left, right = corners()[[3, 2]] * 0.9 + 0.1 * MIDDLE
    scene.hold(left, "x")
    scene.hold(left, "y")
    scene.hold(right, "y")
    scene.gravity((0, -9.81))
    return scene.solve().displacement(corners()[[0, 1]].mean(axis=0) * 0.9 + 0.1 * MIDDLE)


def test_all_functions_give_the_same_solution():
    grid = grid_of_two()
    polygon = hanging(tawami.polygon(grid, corners(), per_axis=2), grid)
    assert polygon[1] < -1e-2
    mesh = hanging(tawami.mesh(grid, mesh_of_square(), per_axis=2), grid)
    assert mesh == pytest.approx(polygon, rel=1e-9, abs=1e-12)
    geometry = tawami.polygon(
        grid, shapely.Polygon(corners()).union(shapely.Point(MIDDLE)), per_axis=2
    )
    assert hanging(geometry, grid) == pytest.approx(polygon, rel=1e-9, abs=1e-12)
    for tolerance in (1e-3, 1e-5, 1e-7):
        level_set = hanging(
            tawami.level_set(grid, in_square, tolerance=tolerance, per_axis=2), grid
        )
        assert level_set == pytest.approx(polygon, rel=10 * tolerance)


def joined(*bodies):
    """Several bodies as one, a material each."""
    return sum(body.named(f"{k}") for k, body in enumerate(bodies))


def embedded(grid, kind):
    """A shape and its surroundings, which together fill the grid; the error that is allowed."""
    ends = ("left", "right", "bottom", "top")
    around = [(0, 0), (2, 0), (2, 2), (0, 2)]
    if kind == "square":
        hole = tawami.polygon(grid, around, holes=[corners()], gauss=True, per_axis=2)
        return joined(tawami.polygon(grid, corners(), gauss=True, per_axis=2), hole), 1e-11
    disc = tawami.disc(grid, MIDDLE, 0.6, gauss=True, per_axis=2)
    if kind == "ring":  # a disc, a ring around it, and the rest of the square
        inside = tawami.disc(grid, MIDDLE, 0.3, gauss=True, per_axis=2)
        ring = tawami.disc(grid, MIDDLE, 0.6, inner=0.3, gauss=True, per_axis=2)
    hole = tawami.level_set(
        grid, lambda x, y: 0.6 - np.hypot(*(np.stack([x, y], axis=-1) - MIDDLE).T), ends=ends,
        tolerance=1e-8, gauss=True,
        per_axis=2,
    )  # fmt: skip
    return joined(inside, ring, hole) if kind == "ring" else joined(disc, hole), 1e-6


@pytest.mark.parametrize(
    ("kind", "form"), [("square", "u"), ("square", "u_epsv"), ("disc", "u_epsv"), ("ring", "u_p")]
)
def test_patch_test_of_embedded_shapes(kind, form):
    """With a linear field on the edges, the strain is constant in cells that two bodies share too."""
    grid = grid_of_two(7)
    body, bound = embedded(grid, kind)
    law = tawami.linear_elastic(E=3.0, nu=0.45)
    gradient = np.array([[1e-3, 4e-4], [-2e-4, 5e-4]])
    laws = [law] * (3 if kind == "ring" else 2)
    scene = tawami.Scene(grid, body, laws, form=form, tolerance=1e-12)
    for edge in ("left", "right", "bottom", "top"):
        for k, component in enumerate("xy"):
            row = gradient[k]
            scene.fix(edge, component, lambda x, y, row=row: row[0] * x + row[1] * y)
    stress = scene.solve().stress
    strain = (gradient + gradient.T) / 2
    K, mu = law.bulk_modulus, law.shear_modulus
    volume = np.trace(strain)
    exact = [*((K - 2 * mu / 3) * volume + 2 * mu * np.append(np.diag(strain), 0)),
             2 * mu * strain[0, 1]]  # fmt: skip
    assert np.abs(stress - exact).max() < bound * np.abs(exact).max()


def particles_of(kind, grid, move):
    if kind == "disc":
        return tawami.disc(grid, MIDDLE + move, 0.5, inner=0.2, per_axis=2)
    if kind == "polygon":
        return tawami.polygon(grid, corners() + move, holes=[corners(0.3, 0.8) + move], per_axis=2)
    if kind == "mesh":
        mesh = mesh_of_square()
        mesh.points[:, :2] += move
        return tawami.mesh(grid, mesh, per_axis=2)
    return tawami.level_set(
        grid, lambda x, y: in_square(x - move[0], y - move[1]), tolerance=1e-4, per_axis=2
    )


AREAS = {"disc": np.pi * 0.21, "polygon": SIDE**2 - 0.09, "mesh": SIDE**2, "level set": SIDE**2}


@pytest.mark.parametrize("kind", AREAS)
@settings(max_examples=examples(4))
@given(move=st.tuples(st.floats(-0.125, 0.125), st.floats(-0.125, 0.125)))
def test_area_and_centroid_of_shapes_moved_by_part_of_a_cell(kind, move):
    body = particles_of(kind, grid_of_two(), np.array(move))
    bound = 1e-4 if kind == "level set" else 1e-11
    if kind in ("polygon", "mesh"):
        bound = 1e-5  # vertices near lines of the grid are moved onto them
    assert body.volume.sum() == pytest.approx(AREAS[kind], rel=bound)
    assert body.volume @ body.x / AREAS[kind] == pytest.approx(MIDDLE + move, rel=bound)


def test_geometries_of_shapely():
    grid = grid_of_two()
    two = shapely.MultiPolygon(
        [shapely.Polygon(corners(0.3)), shapely.box(1.5, 1.5, 1.93, 2.0, ccw=False)]
    )
    body = tawami.polygon(grid, two, per_axis=2)
    assert body.volume.sum() == pytest.approx(0.09 + 0.43 * 0.5)
    ring = shapely.Point(*MIDDLE).buffer(0.6) - shapely.Point(*MIDDLE).buffer(0.4)
    assert tawami.polygon(grid, ring, per_axis=2).volume.sum() == pytest.approx(ring.area)


@pytest.mark.parametrize(
    ("shape", "options", "message"),
    [
        (shapely.Point(1, 1), {}, "it is a Point: expected a Polygon or MultiPolygon"),
        (shapely.Polygon(), {}, "it is an empty Polygon: expected"),
        (shapely.box(0.1, 0.1, 3, 1), {}, r"vertex \d at \(3, \d\.?\d*\) m lies outside the grid"),
        (shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), {}, "sides cross or touch each other"),
        (shapely.box(0, 0, 1, 1), {"holes": [corners(0.1)]}, "has its own holes"),
        (corners(), {"holes": [corners(0.2) + 1.0]}, r"vertex 1 of holes\[0\] at .* lies outside"),
        (corners(), {"holes": [corners(1.0, 0.0)]}, "sides cross or touch each other"),
        (corners(), {"holes": [corners(0.1)[:2]]}, r"holes\[0\] has shape \(2, 2\): expected three"),
    ],
)  # fmt: skip
def test_error_messages_of_geometries(shape, options, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.polygon(grid_of_two(), shape, **options)


def test_the_body_has_the_numbers_of_materials():
    grid = grid_of()
    box = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    soft, stiff = (tawami.linear_elastic(E=E, nu=0.3) for E in (1.0, 2.0))
    body = tawami.Body(box.x, box.volume, (box.x[:, 0] > 0).astype(np.uint32))
    scene = tawami.Scene(grid, body, [soft, stiff])
    assert (
        (scene.configuration.domain.constants["mu"] == stiff.shear_modulus) == (box.x[:, 0] > 0)
    ).all()


def test_parts_that_are_round_off_have_no_particles():
    """A side that is 1e-13 cells beyond a line of the grid does not reach the next cell."""
    grid = grid_of_two(8)
    box = tawami.box(grid, (0.5, 0.5), (1.5, 1.5), per_axis=2)
    beyond = 1.5 + 1e-14
    level_set = tawami.level_set(
        grid,
        lambda x, y: np.maximum(np.maximum(0.5 - x, x - beyond), np.maximum(0.5 - y, y - beyond)),
        per_axis=2,
    )
    for body in (
        level_set,
        tawami.polygon(grid, shapely.box(0.5, 0.5, beyond, beyond), per_axis=2),
    ):
        assert len(body.x) == len(box.x)
        assert body.volume.sum() == pytest.approx(1.0, rel=1e-12)
