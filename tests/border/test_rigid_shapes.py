"""Rigid shapes: distances with derivatives, input, outlines; motion of obstacles."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from border.contacts import SHAPES, WEDGE
from numpy.testing import assert_allclose

from tawami.base.errors import InputError
from tawami.border.rigid import Pose
from tawami.border.shapes import Function, half_plane, outline, rigid_disc, rigid_polygon

X = np.random.default_rng(3).uniform(-1, 1, (400, 2))


@pytest.mark.parametrize("name", SHAPES)
def test_normal_and_curvature_are_derivatives_of_the_distance(name):
    shape, step = SHAPES[name], 1e-6
    at = shape.evaluate(X)
    assert_allclose(np.linalg.norm(at.normal, axis=1), 1, atol=1e-6)
    for axis, move in enumerate(step * np.eye(2)):
        ahead, behind = shape.evaluate(X + move), shape.evaluate(X - move)
        smooth = np.abs(ahead.normal - behind.normal).max(axis=1) < 1e-3  # no ridge in between
        assert smooth.mean() > 0.98
        slope = (ahead.distance - behind.distance) / (2 * step)
        assert_allclose(slope[smooth], at.normal[smooth, axis], atol=1e-6)
        turn = (ahead.normal - behind.normal) / (2 * step)
        assert_allclose(turn[smooth], at.curvature[smooth, axis], atol=1e-4)


@pytest.mark.parametrize("radius", [0.0, 0.1])
@pytest.mark.parametrize("corners", [WEDGE, WEDGE[::-1], (*WEDGE, WEDGE[0])])
def test_distance_from_a_polygon(corners, radius):
    polygon = shapely.Polygon(WEDGE)
    points = shapely.points(X)
    sign = np.where(shapely.contains(polygon, points), -1, 1)
    exact = sign * shapely.distance(polygon.exterior, points) - radius
    shape = rigid_polygon(corners, radius)
    assert_allclose(shape.evaluate(X).distance, exact, atol=1e-12)
    assert_allclose(shape.centre, shapely.get_coordinates(polygon.centroid)[0])


def test_points_on_corners_and_centres_have_finite_normals():
    at = rigid_polygon(WEDGE).evaluate(np.array(WEDGE))
    assert_allclose(at.distance, 0, atol=1e-15)
    assert_allclose(np.linalg.norm(at.normal, axis=1), 1)
    assert np.isfinite(at.curvature).all()
    centre = rigid_disc((1, 2), 0.5).evaluate(np.array([[1.0, 2.0]]))
    assert centre.distance[0] == -0.5
    assert np.linalg.norm(centre.normal) == 1


def test_the_ridge_of_a_function_has_a_mean_normal():
    wedge = Function(lambda x, y: (np.abs(x) + y) / np.sqrt(2), 1e-4, np.zeros(2))
    at = wedge.evaluate(np.array([[0.0, 0.0], [0.1, -0.1], [0.0, -0.3]]))
    assert_allclose(at.normal, [[0, 1], [0.5**0.5, 0.5**0.5], [0, 1]], atol=1e-8)
    assert_allclose(at.curvature, 0, atol=1e-6)


@pytest.mark.parametrize(
    ("f", "message"),
    [
        (lambda x, y: x**2 + y**2 - 1, r"gradient of length 2 at .*expected a signed distance"),
        (lambda x, y: 0.0, r"returned an array of shape \(\): expected \(\d+,\), the shape of x"),
        (lambda x, y: y if y > 0 else 0 * y, "failed on arrays .* in place of if and min"),
        (lambda x, y: np.where(x > 0, y, np.nan), r"is nan at \(.*\) m: expected a finite number"),
    ],
)
def test_functions_that_are_no_distance_are_rejected(f, message):
    on_circle = np.column_stack([np.cos(np.arange(6.0)), np.sin(np.arange(6.0))])
    with pytest.raises(InputError, match=message):
        Function(f, 1e-4, np.zeros(2)).evaluate(on_circle)


def test_a_function_is_checked_to_be_a_distance_far_away_too():
    far = np.array([[0.0, 1.0]])
    Function(lambda x, y: 5 - y, 1e-4, np.zeros(2)).check(far)
    double = Function(lambda x, y: 2 * (5 - y), 1e-4, np.zeros(2))
    double.evaluate(far)
    with pytest.raises(InputError, match=r"gradient of length 2 at \(0, 1\)"):
        double.check(far)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: half_plane((0, 0), (0, 0)),
            r"half_plane: normal = \(0, 0\): expected a direction",
        ),
        (lambda: half_plane((0, 0), (0, 0, 1)), "as many components as the point"),
        (lambda: half_plane((0, np.inf), (0, 1)), "point = .*: expected finite numbers"),
        (lambda: rigid_disc((0, 0), 0), "radius = 0: expected a finite number above 0"),
        (lambda: rigid_polygon([(0, 0), (1, 0)]), r"shape \(2, 2\): expected three or more finite"),
        (lambda: rigid_polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), "sides cross"),
        (lambda: rigid_polygon([(0, 0), (0, 0), (1, 0), (0, 1)]), "none repeated"),
        (
            lambda: rigid_polygon(WEDGE, radius=-1),
            "radius = -1: expected a finite number of at least",
        ),
    ],
)
def test_wrong_shapes_are_rejected(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("name", SHAPES)
def test_the_outline_is_on_the_border(name):
    pose = Pose.at(SHAPES[name].centre).moved(np.array([0.2, 0.1, 0.4]))
    lines = outline(SHAPES[name], pose.to_local, ((-1.5, -1.5), (1.5, 1.5)))
    assert len(lines) == 1
    distance = SHAPES[name].evaluate(pose.to_local(lines[0])).distance
    assert np.abs(distance).max() < 0.015  # a square between samples; only corners are cut


def test_poses_move_points_rigidly():
    pose = Pose.at(np.array([1.0, 2.0])).moved(np.array([0.5, -1.0, np.pi / 2]))
    assert_allclose(pose.position, [1.5, 1.0])
    assert_allclose(pose.to_global(np.array([[2.0, 2.0]])), [[1.5, 2.0]], atol=1e-15)
    assert_allclose(pose.to_local(pose.to_global(X)), X, atol=1e-14)
    rates, step = np.array([0.3, -0.2, 2.0]), 1e-6
    local = pose.to_local(X)
    moved = [pose.moved(sign * step * rates).to_global(local) for sign in (1, -1)]
    assert_allclose(pose.velocity(X, rates), (moved[0] - moved[1]) / (2 * step), atol=1e-8)


def test_the_resultant_has_the_power_of_the_forces():
    pose, forces = Pose.at(np.array([0.2, -0.4])), np.random.default_rng(5).normal(size=X.shape)
    rates = np.array([0.3, -0.2, 2.0])
    power = np.sum(forces * pose.velocity(X, rates))
    assert pose.resultant(X, forces) @ rates == pytest.approx(power)
    assert_allclose(pose.coordinates, 0)
