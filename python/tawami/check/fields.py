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
#: Relative second difference of values that are linear in dt, and a step in which no rate acts [s].
STRAIGHT, SHORT, SMALLEST = 1e-8, 1e-12, 1e-300


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


def _linear(scene: Scene, name: str, size: float) -> tuple[Array, Array]:
    """A field that is linear in the position.

    Returns:
        Coefficients of all fields, and value and gradient at the particles.
    """
    grid, x = scene.grid, np.asarray(scene.particles.x)
    place, slope = scene.configuration.domain.layout.fields[name], size * np.array([0.6, -0.4])
    points = greville(place.basis, grid.origin, grid.h, grid.cells)
    coefficients = np.zeros(scene.num_coefficients)
    coefficients[place.slice] = size + points @ slope
    return coefficients, np.column_stack([size + x @ slope, np.tile(slope, (len(x), 1))])


def forgets(form: Form, given: Settings, name: str) -> bool:
    """Whether the flux in the rate equation of a field acts on the increment alone.

    The derivative of the equation is s(dt) (A + dt B), where s is 1 or 1/dt, A belongs to rates, and B
    to the flux. A flux that acts on the value depends on the old field, one of the increment does not.
    Equations of another kind, such as those without a rate, are not concerned.
    """
    if not trial.reads(form, given, "dt"):
        return False
    scene = scenes.filled(form, given)
    place = scene.configuration.domain.layout.fields[name]
    own, carried = _linear(scene, name, trial.natural(form, name))
    steps, rest = np.array([1.0, 2.0, 3.0]), np.zeros(scene.num_coefficients)
    rows = [scene.tangent(own, dt=dt)[place.slice] for dt in steps]
    whole, alone = ([row @ d for row in rows] for d in (trial.spread(scene, _random()), own))
    fits = [scaled for scaled in (np.ones(3), steps) if _bends(whole, scaled) < STRAIGHT]
    if len(fits) != 1:
        return False
    one, _, three = (v * scale for v, scale in zip(whole, fits[0], strict=True))
    rate = np.abs(one - (three - one) / 2).max()
    flux = np.abs(alone[2] * fits[0][2] - alone[0] * fits[0][0]).max() / 2
    size = max(np.abs(v).max() for v in (*whole, *alone))
    if min(rate, flux) <= STRAIGHT * size:
        return False
    column = np.asarray(scene.particles.carried(name))
    none = np.asarray(scene.residual(rest, dt=1.0))[place.slice]
    column[:] = carried
    change = np.asarray(scene.residual(rest, dt=1.0))[place.slice] - none
    return bool(np.abs(change).max() <= ROUND_OFF * flux)


def _random() -> np.random.Generator:
    return np.random.default_rng(1)


def _bends(values: list[Array], scale: Array) -> float:
    """Second difference of values at 1, 2 and 3 s times a scale, relative to their size."""
    one, two, three = (value * factor for value, factor in zip(values, scale, strict=True))
    return float(np.abs(three - 2 * two + one).max() / max(np.abs(three).max(), SMALLEST))


def expands(form: Form, given: Settings, name: str) -> bool:
    """Whether the equation of the volume contains the value of an old field, other than in a rate."""
    if form.volume_field is None:
        return False
    scene = scenes.filled(form, given)
    rows = scene.configuration.domain.layout.fields[form.volume_field].slice
    rest, column = np.zeros(scene.num_coefficients), np.asarray(scene.particles.carried(name))
    dt = SHORT if trial.reads(form, given, "dt") else 1.0
    none = np.asarray(scene.residual(rest, dt=dt))[rows]
    column[:, 0] = trial.natural(form, name)
    change = np.asarray(scene.residual(rest, dt=dt))[rows] - none
    size = np.abs(scene.tangent(rest, dt=dt)[rows] @ trial.spread(scene, _random())).max()
    return bool(np.abs(change).max() > STRAIGHT * size)


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
