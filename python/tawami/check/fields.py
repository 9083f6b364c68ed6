"""Checks of the fields of a form: blocks of the tangent, and each field that no law receives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.check import scenes, trial
from tawami.check.trial import Settings
from tawami.form.form import Form
from tawami.grid.basis import greville
from tawami.scene.scene import Scene

#: Steps of the central differences. Particles may change between elastic and plastic within one of them.
DIFFERENCES = (1e-4, 3e-5)
#: Part of the largest eigenvalue, or of the largest entry, that counts as round-off.
ROUND_OFF = 1e-10


def tangent_errors(scene: Scene, dt: float = 1.0) -> dict[tuple[str, str], float]:
    """Error of each block of the tangent in a direction, compared with differences of the residual.

    Args:
        scene: The particles.
        dt: Length of the step [s].

    Returns:
        (equation, field) -> error, relative to the largest entry of the equation.
    """
    random, places = np.random.default_rng(1), scene.configuration.domain.layout.fields
    c, whole = trial.spread(scene, random), trial.spread(scene, random)
    tangent = scene.tangent(c, dt=dt)
    parts = {name: np.zeros_like(whole) for name in places}
    for name, place in places.items():
        parts[name][place.slice] = whole[place.slice]
    predicted = {name: tangent @ part for name, part in parts.items()}
    errors = dict[tuple[str, str], float]()
    for name, part in parts.items():
        differences = []
        for step in DIFFERENCES:
            ahead, behind = (scene.residual(c + sign * step * part, dt=dt) for sign in (1, -1))
            differences.append((ahead - behind) / (2 * step) - predicted[name])
        for row, place in places.items():
            size = max(np.abs(p[place.slice]).max() for p in predicted.values())
            found = min(float(np.abs(d[place.slice]).max()) for d in differences)
            errors[row, name] = found / size if size else found
    return errors


@dataclass(frozen=True)
class Balance:
    """Out-of-balance of the equation of a field at rest, as parts of its largest entry.

    Attributes:
        uniform: Of a uniform field.
        linear: Of a field that is linear in the position, inside the body.
    """

    uniform: float
    linear: float


def balance(form: Form, given: Settings, name: str) -> Balance:
    """Out-of-balance of a uniform and of a linear field with all increments zero, over 1 s."""
    scene = scenes.filled(form, given)
    place = scene.configuration.domain.layout.fields[name]
    grid, x = scene.grid, np.asarray(scene.particles.x)
    column = np.asarray(scene.particles.carried(name))
    rest = np.zeros(scene.num_coefficients)
    points = greville(place.basis, grid.origin, grid.h, grid.cells)
    lower, upper = np.array(grid.origin), np.array(grid.upper)
    reach = (1.4 if place.basis == "quadratic_spline" else 0.9) * grid.h
    inside = (np.minimum(points - lower, upper - points) > reach).all(axis=1)
    value, slope = trial.natural(form, name), np.array([0.6, -0.4]) * trial.natural(form, name)

    def equation() -> Array:
        return np.asarray(scene.residual(rest, dt=1.0))[place.slice]

    none = equation()
    column[:, 0], column[:, 1:] = value, 0.0
    uniform = equation() - none
    column[:, 0], column[:, 1:] = value + x @ slope, slope
    linear = equation() - none
    direction = np.zeros_like(rest)
    direction[place.slice] = value + points @ slope
    block = np.abs(scene.tangent(rest, dt=1.0) @ direction)[place.slice].max()
    size = max(block, np.abs(linear).max(), np.abs(uniform).max())
    if not size:
        return Balance(0.0, 0.0)
    return Balance(np.abs(uniform).max() / size, np.abs(linear[inside]).max() / size)


def signs(form: Form, given: Settings, name: str) -> list[tuple[float, str]]:
    """Whether the derivative of the equation of a field by that field is definite, for each dt.

    Returns:
        dt [s], and 'positive', 'negative', 'mostly positive', 'mostly negative' or 'zero'.
    """
    scene = scenes.filled(form, given)
    place = scene.configuration.domain.layout.fields[name]
    at_rest, found = np.zeros(scene.num_coefficients), []
    for dt in trial.steps(form, given):
        tangent = scene.tangent(at_rest, dt=dt)
        own = tangent[place.slice][:, place.slice].toarray()
        others = np.abs(tangent[place.slice]).max()
        found.append((dt, _sign(np.linalg.eigvalsh((own + own.T) / 2), float(others))))
    return found


def _sign(values: npt.NDArray[np.float64], others: float) -> str:
    largest = np.abs(values).max()
    if largest <= ROUND_OFF * others:
        return "zero"
    name = "positive" if values[np.argmax(np.abs(values))] > 0 else "negative"
    signs = {value > 0 for value in values if abs(value) > ROUND_OFF * largest}
    return name if len(signs) == 1 else f"mostly {name}"
