"""Arguments of `scene.obstacle`: shape, motions, forces and masses, checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.arrays import Array, Mask
from tawami.base.errors import InputError
from tawami.base.identity import text
from tawami.base.space import Space
from tawami.border.rigid import num_modes
from tawami.border.shapes import Function, Shape
from tawami.conditions.factor import Factor


def checked_friction(what: str, friction: Any) -> float:
    """A coefficient of friction, which may be infinite.

    Raises:
        InputError: Anything else.
    """
    mu = checks.real(f"{what}: friction", friction)
    if not mu >= 0:
        raise InputError(
            f"{what}: friction = {checks.shown(friction)}: expected a number of at least 0, or "
            "numpy.inf for a surface without sliding"
        )
    return mu


def motions_of(space: Space) -> tuple[str, ...]:
    """Names of the rigid motions: translations, then rotations."""
    rotations = num_modes(space.dim) - space.dim
    names = ["rotation"] if rotations == 1 else [f"rotation {k + 1}" for k in range(rotations)]
    return (*space.axes, *names)


def components(what: str, value: Any, space: Space) -> tuple[float, ...]:
    """One number for each motion, from those of the translations or of all.

    Raises:
        InputError: Not as many finite numbers.
    """
    num, names = num_modes(space.dim), motions_of(space)
    if value is None:
        return (0.0,) * num
    given = list(value) if isinstance(value, Sequence | np.ndarray) else []
    if isinstance(value, str) or len(given) not in (space.dim, num):
        raise InputError(
            f"{what} = {checks.shown(value)}: expected {space.dim} or {num} numbers, for "
            f"{', '.join(names)}"
        )
    given += [0.0] * (num - len(given))
    return tuple(checks.number(f"{what}: {n}", v) for n, v in zip(names, given, strict=True))


def speeds_of(what: str, velocity: Any, space: Space, time: float) -> list[Factor]:
    """Factors of the velocities of all motions."""
    num, names = num_modes(space.dim), motions_of(space)
    given = [0.0] * num if velocity is None else velocity
    if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray):
        given = []
    if len(given) not in (space.dim, num):
        raise InputError(
            f"{what}: velocity = {checks.shown(velocity)}: expected {space.dim} or {num} numbers or "
            f"functions of time, for {', '.join(names)}"
        )
    given = [*given, *[0.0] * (num - len(given))]
    return [
        Factor(f"{what}: velocity of '{n}'", None, v, name="", time=time)
        for n, v in zip(names, given, strict=True)
    ]


def check_motions(
    what: str, space: Space, speeds: Sequence[Factor], free: Mask, *values: Array
) -> None:
    """Check that velocities fit free motions, and that motions fit axisymmetry.

    Raises:
        InputError: They do not.
    """
    for speed, name, one in zip(speeds, motions_of(space), free, strict=True):
        if one and speed.is_function:
            raise InputError(
                f"{what}: velocity of '{name}', which is free: expected a number, its velocity at first"
            )
    if not space.hoop:
        return
    along = np.array([name == space.axes[1] for name in motions_of(space)])
    moving = free | ~np.array([rests(speed) for speed in speeds])
    for value in values:
        moving = moving | (value != 0)
    if (moving & ~along).any():
        raise InputError(
            f"{what}: in axisymmetry an obstacle moves along the axis only: expected motions and "
            f"forces in '{space.axes[1]}', as free='{space.axes[1]}'"
        )


def rests(speed: Factor) -> bool:
    """Whether a velocity is zero at all times."""
    return not speed.is_function and speed.rates(0.0, 0.0)[0] == 0


def free_of(what: str, free: Any, space: Space, wanted: bool) -> Mask:
    """Mask of the free motions."""
    names = motions_of(space)
    if free is None:
        default = np.full(len(names), wanted)
        along = np.array([not space.hoop or n == space.axes[1] for n in names])
        return np.asarray(default & along)
    given = [free] if isinstance(free, str) else list(free)
    known = checks.names(f"{what}: free", given, names)
    return np.array([name in known for name in names])


def masses_of(what: str, mass: Any, inertia: Any, space: Space) -> Array:
    """Masses of all motions; 0 where none is given."""
    m = 0.0 if mass is None else checks.number(f"{what}: mass", mass, low=checks.LEAST)
    turning = 0.0
    if inertia is not None:
        turning = checks.number(f"{what}: inertia", inertia, low=checks.LEAST)
    dim = space.dim
    return np.array([m] * dim + [turning] * (num_modes(dim) - dim))


def check_fit(what: str, by: Array, forces: Array, free: Mask, names: Sequence[str]) -> None:
    """Check that displacements belong to prescribed motions and forces to free ones.

    Raises:
        InputError: They do not.
    """
    for k, name in enumerate(names):
        if free[k] and by[k]:
            raise InputError(
                f"{what}: displacement of '{name}', which is free: expected a force, or free=... "
                "without this motion"
            )
        if not free[k] and forces[k]:
            raise InputError(
                f"{what}: force on '{name}', which is prescribed: expected free=... with this motion"
            )


def shape_of(what: str, shape: Any, space: Space, h: float) -> Shape:
    """A shape, or that of a distance function."""
    if hasattr(shape, "evaluate") and hasattr(shape, "centre"):
        made: Shape = shape
        if len(made.centre) != space.dim:
            raise InputError(
                f"{what}: a shape of {len(made.centre)} coordinates: expected {space.dim}"
            )
        return made
    if callable(shape):
        return Function(shape, 1e-4 * h, np.zeros(space.dim))
    raise InputError(
        f"{what}: shape = {checks.shown(shape)}: expected tawami.half_plane(...), "
        "tawami.rigid_disc(...), tawami.rigid_polygon(...), or a function f(x, y), the distance [m]"
    )


def facts_of(shape: Shape) -> list[Any]:
    """A shape in the types of JSON."""
    facts: list[Any] = [type(shape).__name__]
    for value in vars(shape).values():
        facts.append(text(value) if callable(value) else np.asarray(value).tolist())
    return facts
