"""Shapes of rigid obstacles as signed distances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.base.checks import LEAST, array, number, shown
from tawami.base.errors import InputError
from tawami.base.optional import optional
from tawami.base.space import lattice
from tawami.base.text import position
from tawami.border.curves import left
from tawami.border.polyline import unclosed


@dataclass(frozen=True)
class Distance:
    """Signed distance of points from an obstacle, with its derivatives.

    Attributes:
        distance: Distance [m], negative inside the obstacle.
        normal: Gradient of the distance: the outward normal of the obstacle, points x dim.
        curvature: Second derivative of the distance [1/m], points x dim x dim.
    """

    distance: Array
    normal: Array
    curvature: Array


class Shape(Protocol):
    """Shape of a rigid obstacle."""

    @property
    def centre(self) -> Array:
        """The point about which it rotates [m]."""

    @property
    def width(self) -> float:
        """Width at its narrowest place [m]; infinite if it is not known."""

    def evaluate(self, x: Array) -> Distance:
        """Distance of points [m], points x dim."""


@dataclass(frozen=True)
class HalfPlane:
    """Everything behind a straight line, or behind a plane.

    Attributes:
        centre: A point on it [m].
        normal: The unit normal that leads out of the obstacle.
    """

    centre: Array
    normal: Array
    width = np.inf

    def evaluate(self, x: Array) -> Distance:
        """Distance of points [m], points x dim."""
        num, dim = x.shape
        normal = np.tile(self.normal, (num, 1))
        return Distance((x - self.centre) @ self.normal, normal, np.zeros((num, dim, dim)))


@dataclass(frozen=True)
class Disc:
    """A disc, or a ball.

    Attributes:
        centre: Its centre [m].
        radius: Its radius [m].
    """

    centre: Array
    radius: float

    @property
    def width(self) -> float:
        """Its diameter [m]."""
        return 2 * self.radius

    def evaluate(self, x: Array) -> Distance:
        """Distance of points [m], points x dim."""
        return _from_point(x - self.centre, np.ones(len(x)), np.eye(x.shape[1])[0], self.radius)


@dataclass(frozen=True)
class Polygon:
    """A polygon, convex or not, enlarged by a radius.

    Attributes:
        corners: Its corners [m], counterclockwise.
        radius: Distance [m] by which its border is moved outwards; convex corners become arcs.
    """

    corners: Array
    radius: float = 0.0

    @property
    def centre(self) -> Array:
        """Centre of the area without the radius [m]."""
        a, b = self.corners, np.roll(self.corners, -1, axis=0)
        double = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        return np.asarray(double @ (a + b) / (3 * double.sum()))

    @property
    def width(self) -> float:
        """Shortest of its sides and of the distances of a corner from other sides, plus 2 radii [m]."""
        import shapely

        return float(shapely.minimum_clearance(shapely.Polygon(self.corners))) + 2 * self.radius

    def evaluate(self, x: Array) -> Distance:
        """Distance of points [m], points x 2; beyond a corner, from the corner."""
        side, corner, offset = self._nearest(x)
        to, normals = np.roll(self.corners, -1, axis=0) - self.corners, self._normals
        mean = normals + np.roll(normals, 1, axis=0)
        mean /= np.linalg.norm(mean, axis=1)[:, None]
        before = np.roll(to, 1, axis=0)
        convex = np.sign(before[:, 0] * to[:, 1] - before[:, 1] * to[:, 0])
        at = np.argmin(np.sum((x[:, None] - self.corners) ** 2, axis=2), axis=1)
        round_corner = _from_point(x - self.corners[at], convex[at], mean[at], self.radius)
        straight = np.einsum("ja,ja->j", offset, normals[side]) - self.radius
        return Distance(
            np.where(corner, round_corner.distance, straight),
            np.where(corner[:, None], round_corner.normal, normals[side]),
            np.where(corner[:, None, None], round_corner.curvature, 0.0),
        )

    @property
    def _normals(self) -> Array:
        """Outward unit normals of the sides, sides x 2."""
        to = np.roll(self.corners, -1, axis=0) - self.corners
        return np.asarray(-left(to) / np.linalg.norm(to, axis=1)[:, None])

    def _nearest(self, x: Array) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_], Array]:
        """The nearest side of each point, whether an end of it is nearest, and the way from there."""
        to = np.roll(self.corners, -1, axis=0) - self.corners
        from_start = x[:, None] - self.corners
        share = np.sum(from_start * to, axis=2) / np.sum(to**2, axis=1)
        clamped = np.clip(share, 0.0, 1.0)
        offset = from_start - clamped[:, :, None] * to
        side, points = np.argmin(np.sum(offset**2, axis=2), axis=1), np.arange(len(x))
        return side, (share != clamped)[points, side], offset[points, side]


@dataclass(frozen=True)
class Function:
    """An obstacle that is given by its signed distance f(x, y), differentiated numerically.

    Attributes:
        f: The distance [m] of positions, as a function on arrays.
        step: Step of the central differences [m], about 1e-4 of the size of a cell.
        centre: The point about which the obstacle rotates [m].
    """

    f: Callable[..., npt.ArrayLike]
    step: float
    centre: Array
    width = np.inf

    def evaluate(self, x: Array) -> Distance:
        """Distance of points [m], points x dim.

        Raises:
            InputError: f fails, does not return one finite number per point, or is no distance where
                it is smaller than 1000 steps: the length of its gradient is not 1.
        """
        num, dim = x.shape
        steps = self.step * np.eye(dim)
        i, j = np.triu_indices(dim, 1)
        cross = [(steps[i] + steps[j]), (steps[i] - steps[j])]
        moves = np.concatenate([np.zeros((1, dim)), steps, -steps, *cross, *(-c for c in cross)])
        values = self.values(x + moves[:, None]).reshape(len(moves), num)
        here, ahead, behind = values[0], values[1 : dim + 1], values[dim + 1 : 2 * dim + 1]
        same, other, opposite, last = values[2 * dim + 1 :].reshape(4, -1, num)
        gradient = (ahead - behind).T / (2 * self.step)
        curvature = np.zeros((num, dim, dim))
        diagonal = np.arange(dim)
        curvature[:, diagonal, diagonal] = (ahead - 2 * here + behind).T / self.step**2
        mixed = (same - other - last + opposite).T / (4 * self.step**2)
        curvature[:, i, j] = curvature[:, j, i] = mixed
        # at a ridge of the distance one-sided slopes differ by about 1: the mean normal, no curvature
        ridge = (np.abs(curvature) > 0.1 / self.step).any(axis=(1, 2))
        size = np.linalg.norm(gradient, axis=1)
        near = np.abs(here) < 1000 * self.step
        self._check_slope(x, np.where(near & ~ridge, size, 1.0))
        curvature[ridge] = 0.0
        gradient[ridge] /= np.maximum(size[ridge], LEAST)[:, None]
        return Distance(here, gradient, curvature)

    def values(self, x: Array) -> Array:
        """Distances of points [m], points x dim, checked."""
        points = x.reshape(-1, x.shape[-1])
        try:
            values = np.asarray(self.f(*points.T), dtype=float)
        except (TypeError, ValueError) as error:
            raise InputError(
                f"the obstacle's distance failed on arrays ({error}): expected f(x, y) on arrays of "
                "positions, with np.where and np.minimum in place of if and min"
            ) from error
        if values.shape != (len(points),):
            raise InputError(
                f"the obstacle's distance returned an array of shape {values.shape}: expected "
                f"{(len(points),)}, the shape of x"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"the obstacle's distance is {values[bad[0]]} at {position(points[bad[0]])} m: "
                "expected a finite number everywhere"
            )
        return values

    def check(self, x: Array) -> None:
        """Check that it is a distance at points [m], points x dim, however far away they are.

        Raises:
            InputError: The length of its gradient is not 1 at one of them.
        """
        self._check_slope(x, np.linalg.norm(self.evaluate(x).normal, axis=1))

    def _check_slope(self, x: Array, size: Array) -> None:
        bad = np.flatnonzero(np.abs(size - 1) > 0.05)
        if len(bad):
            raise InputError(
                f"the obstacle's distance has a gradient of length {size[bad[0]]:.3g} at "
                f"{position(x[bad[0]])} m: expected a signed distance [m], whose gradient has the "
                "length 1, positive outside"
            )


def half_plane(point: npt.ArrayLike, normal: npt.ArrayLike) -> HalfPlane:
    """A rigid half-plane, an obstacle for `scene.obstacle`.

    Args:
        point: A point (x, y) on its border [m].
        normal: Direction that leads out of the obstacle, of any length.

    Raises:
        InputError: A point that is not finite, or a normal without direction.
    """
    at, direction = _vector("point", point), _vector("normal", normal)
    size = float(np.linalg.norm(direction))
    if size == 0 or len(at) != len(direction):
        raise InputError(
            f"half_plane: normal = {shown(normal)}: expected a direction that is not zero, with as "
            "many components as the point"
        )
    return HalfPlane(at, direction / size)


def rigid_disc(centre: npt.ArrayLike, radius: float) -> Disc:
    """A rigid disc, an obstacle for `scene.obstacle`.

    Args:
        centre: Its centre (x, y) [m].
        radius: Its radius [m].

    Raises:
        InputError: A centre that is not finite, or a radius that is not positive.
    """
    return Disc(_vector("centre", centre), number("radius", radius, low=LEAST))


def rigid_polygon(corners: npt.ArrayLike, radius: float = 0.0) -> Polygon:
    """A rigid polygon, an obstacle for `scene.obstacle`.

    Args:
        corners: Its corners [m] in order, n x 2, in either orientation; convex or not.
        radius: Distance [m] by which its border is moved outwards. Convex corners become arcs of this
            radius, so that bodies can slide around them.

    Raises:
        InputError: Fewer than three corners, sides that cross or have no length, or a negative radius.
    """
    import shapely

    given = unclosed(array("corners", corners, 2))
    if len(given) < 3 or given.shape[1] != 2 or not np.isfinite(given).all():
        raise InputError(
            f"rigid_polygon: corners of shape {given.shape}: expected three or more finite points (x, y)"
        )
    shape = shapely.Polygon(given)
    repeated = (given == np.roll(given, 1, axis=0)).all(axis=1).any()
    if not shape.is_valid or shape.area <= 0 or repeated:
        raise InputError(
            f"rigid_polygon: its sides cross or have no length ({shapely.is_valid_reason(shape)} m): "
            "expected a simple polygon, with its corners in order and none repeated"
        )
    ring = shape.exterior
    return Polygon(given if ring.is_ccw else given[::-1].copy(), number("radius", radius, low=0.0))


def outline(
    shape: Shape, pose: Callable[[Array], Array], bounds: Sequence[Array], samples: int = 201
) -> list[Array]:
    """Lines along the border of a plane obstacle inside a box, for pictures.

    Args:
        shape: The obstacle.
        pose: Function from positions to those where the shape is described, `Pose.to_local`.
        bounds: Two opposite corners of the box [m].
        samples: Number of points along each side of the box at which the distance is taken.

    Returns:
        Lines, each n x 2 [m].

    Raises:
        MissingDependencyError: contourpy is not installed, which comes with matplotlib.
    """
    contourpy = optional("contourpy", "outlines of obstacles need")
    along = [np.linspace(low, high, samples) for low, high in zip(*bounds, strict=True)]
    distance = shape.evaluate(pose(lattice(along))).distance.reshape(samples, samples)
    return list(contourpy.contour_generator(*along, distance).lines(0.0))


def _vector(name: str, value: npt.ArrayLike) -> Array:
    vector = array(name, value, 1)
    if not np.isfinite(vector).all():
        raise InputError(f"{name} = {shown(value)}: expected finite numbers")
    return vector


def _from_point(offset: Array, sign: Array, otherwise: Array, radius: float) -> Distance:
    """Distance from a point, less a radius; with sign -1 it is negative.

    Args:
        offset: The way from the point [m], points x dim.
        sign: 1 or -1 for each.
        otherwise: Normal at the point itself.
        radius: The radius [m].
    """
    size = np.linalg.norm(offset, axis=1)
    away, signed = size > 0, np.where(size > 0, sign * size, 1.0)[:, None]
    normal = np.where(away[:, None], offset / signed, otherwise)
    tangential = np.eye(offset.shape[1]) - normal[:, :, None] * normal[:, None, :]
    curvature = np.where(away[:, None, None], tangential / signed[:, :, None], 0.0)
    return Distance(sign * size - radius, normal, curvature)
