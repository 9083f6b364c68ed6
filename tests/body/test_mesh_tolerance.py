"""Meshes are accepted whatever the rounding of their nodes, and refused for real overlaps."""

from __future__ import annotations

import meshio
import moments
import numpy as np
import pytest
from mpi4py import MPI

import tawami

SIZE = np.array([1.7, 1.1])
ANGLES = range(0, 91, 5)


def turned(points, degrees, scale=1.0):
    """Points of the rectangle SIZE turned about its centre, which is that of the grid."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return scale * ((points - SIZE / 2) @ np.array([[c, s], [-s, c]]) + 1.2)


def grid_of(scale=1.0, n=10):
    return tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=2.4 / n * scale, cells=(n, n))


def rows(nx, ny, low, high):
    """Points and quadrilaterals of the rectangle between two heights."""
    x, y = np.meshgrid(np.linspace(0, SIZE[0], nx + 1), np.linspace(low, high, ny + 1))
    corner = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    return np.column_stack([x.ravel(), y.ravel()]), corner[:, None] + [0, 1, nx + 2, nx + 1]


def two_surfaces(below=(5, 2), above=(7, 3), overlap=0.0, kind="quad"):
    """A rectangle of two surfaces, each with its own nodes along their common side."""
    middle = SIZE[1] / 3
    a, quads_a = rows(*below, 0, middle + overlap)
    b, quads_b = rows(*above, middle, SIZE[1])
    quads = np.concatenate([quads_a, quads_b + len(a)])
    if kind == "triangle":
        quads = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    return np.concatenate([a, b]), quads


def body_of(points, cells, grid=None, kind=None):
    kind = kind or {3: "triangle", 4: "quad"}[cells.shape[1]]
    return tawami.mesh(grid or grid_of(), meshio.Mesh(points, [(kind, cells)]), gauss=True)


def exact(degrees):
    return moments.of_polygons(
        turned(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * SIZE, degrees)[None]
    )


@pytest.mark.parametrize("kind", ["quad", "triangle"])
@pytest.mark.parametrize("degrees", ANGLES)
def test_surfaces_with_their_own_nodes_along_a_common_side(degrees, kind):
    points, cells = two_surfaces(kind=kind)
    body = body_of(turned(points, degrees), cells)
    assert moments.of_particles(body) == pytest.approx(exact(degrees), rel=1e-11)


@pytest.mark.parametrize("digits", range(6, 16))
def test_nodes_that_are_rounded(digits):
    points, cells = two_surfaces(above=(8, 3), below=(4, 2))  # every second node hangs
    for degrees in (0, 17, 45, 71):
        rounded = np.round(turned(points, degrees) / 2, digits) * 2
        body = body_of(rounded, cells)
        found = moments.of_particles(body)
        assert found == pytest.approx(exact(degrees), rel=20 * 10.0**-digits + 1e-11)


@pytest.mark.parametrize("digits", [6, 7, 9])
def test_a_side_on_a_line_of_the_grid_stays_there_if_it_is_rounded(digits):
    """Rounded upwards, nodes are beyond the line, and beyond the grid."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.1 / 3, cells=(30, 30))
    points, cells = rows(30, 15, 0, 1.0)
    points = points / [SIZE[0], 1.0]
    body = body_of(np.ceil(points * 10**digits) / 10**digits, cells, grid)
    box = tawami.box(grid, (0, 0), grid.upper, gauss=True)
    assert len(body.x) == len(box.x)
    assert body.volume.sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_units_do_not_matter(scale):
    points, cells = two_surfaces()
    for degrees in (0, 30, 60):
        body = body_of(turned(points, degrees, scale), cells, grid_of(scale))
        found = tawami.Body(body.x / scale, body.volume / scale**2)
        assert moments.of_particles(found) == pytest.approx(exact(degrees), rel=1e-11)
        over, cells_over = two_surfaces(overlap=1e-4)
        with pytest.raises(tawami.InputError, match="overlap by"):
            body_of(turned(over, degrees, scale), cells_over, grid_of(scale))


@pytest.mark.parametrize("degrees", ANGLES)
def test_real_overlaps_and_inverted_elements(degrees):
    for overlap in (2e-5, 1e-3, 0.2):
        points, cells = two_surfaces(overlap=overlap)
        with pytest.raises(
            tawami.InputError, match=r"elements \d+ and \d+ overlap by .*surfaces lie"
        ):
            body_of(turned(points, degrees), cells)
    points, cells = rows(6, 4, 0, SIZE[1])
    points[8] += [0.4, 0.02]  # through the opposite side
    with pytest.raises(tawami.InputError, match=r"overlap by .*turned inside out|cross themselves"):
        body_of(turned(points, degrees), cells)


def test_the_width_that_the_message_states_is_the_limit():
    """Surfaces that overlap by less are accepted."""
    points, cells = two_surfaces(overlap=1e-3)
    with pytest.raises(tawami.InputError, match=r"\(to (\S+) m\)") as raised:
        body_of(turned(points, 30), cells)
    limit = float(str(raised.value).split("(to ")[1].split(" m)")[0])
    body_of(turned(two_surfaces(overlap=0.8 * limit)[0], 30), cells)
    with pytest.raises(tawami.InputError):
        body_of(turned(two_surfaces(overlap=1.2 * limit)[0], 30), cells)


def test_unused_nodes_and_noise_in_z():
    points, cells = rows(5, 4, 0, SIZE[1])
    z = 3.0 + 1e-7 * np.random.default_rng(0).uniform(-1, 1, len(points))
    in_space = np.column_stack([turned(points, 20), z])
    unused = [[1e3, 1e3, 7.0], [np.nan, np.nan, np.nan]]
    body = body_of(np.concatenate([in_space, unused]), cells)
    assert moments.of_particles(body) == pytest.approx(exact(20), rel=1e-12)
    in_space[3, 2] += 1e-4
    with pytest.raises(tawami.InputError, match="z from 3 to 3.0001 m: expected a plane mesh"):
        body_of(in_space, cells)


@pytest.mark.parametrize("degrees", [0, 20, 45])
def test_triangles_that_are_stored_as_quadrilaterals(degrees):
    points, cells = rows(5, 4, 0, SIZE[1])
    for repeat in range(4):
        collapsed = np.concatenate([cells[:, [0, 1, 2, 2]], cells[:, [0, 2, 3, 3]]])
        body = body_of(turned(points, degrees), np.roll(collapsed, repeat, axis=1))
        assert moments.of_particles(body) == pytest.approx(exact(degrees), rel=1e-12)


@pytest.mark.parametrize("degrees", [0, 20, 45])
def test_elements_that_are_flat(degrees):
    points, cells = rows(4, 4, 0, SIZE[1])
    cells[5] = [0, 1, 2, 3]  # four nodes on a line
    with pytest.raises(tawami.InputError, match="1 of its elements have no area.* element 5"):
        body_of(turned(points, degrees), cells)


def test_middle_nodes_that_are_rounded_are_not_on_a_curve():
    """A warning would fail the test; tests/body/test_mesh.py has curved sides."""
    points, cells = rows(40, 30, 0, SIZE[1])
    points = turned(points, 20)
    middle = (points[cells] + points[np.roll(cells, -1, axis=1)]) / 2
    numbers = len(points) + np.arange(cells.size).reshape(cells.shape)
    nodes = np.round(np.concatenate([points, middle.reshape(-1, 2)]), 6)
    body = body_of(nodes, np.concatenate([cells, numbers], axis=1), kind="quad8")
    assert body.volume.sum() == pytest.approx(SIZE.prod(), rel=1e-5)
