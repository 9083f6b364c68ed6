"""Scenes of a form whose data, parameters and fields have values of the right magnitude.

Scales are h = 0.5 m, K = 5 Pa and 1 s, so that a permeability [m2] is 0.25 m2, and every term of a
residual is of comparable size.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.dimensions import dimension, size
from tawami.body.body import Body
from tawami.border.pieces import Border
from tawami.border.polyline import polyline
from tawami.check.units import unit_of, unreadable
from tawami.form.compilation import CompiledForm, compile_form
from tawami.form.form import Form
from tawami.grid.grid import Grid
from tawami.particles.laws import cam_clay, drucker_prager, linear_elastic, mohr_coulomb, von_mises
from tawami.scene.scene import Scene

Settings = dict[str, Any]
Law = Callable[[_rust.Material], _rust.Material]

K, H = 5.0, 0.5
#: Sizes of the base units: K is 5 Pa, a second 1 s.
SCALES = {"m": H, "s": 1.0, "kg": K * H}
#: Lengths of a step [s] for forms that read dt, and one in which rates vanish.
STEPS, LONG = (1e-3, 1.0, 1e3), 1e9
#: Sides of the body, as sums over the border name them.
SIDES = ("right", "top", "left", "bottom")
#: Density for forms that read it [kg/m3].
DENSITY = 2.0
#: Plastic laws, and elastic laws, some of them with history variables that never change.
PLASTIC: tuple[Law, ...] = (
    lambda elastic: drucker_prager(elastic, phi=20.0, c=0.05, psi=10.0),
    lambda elastic: von_mises(elastic, yield_stress=0.1, hardening=0.1),
    lambda elastic: mohr_coulomb(elastic, phi=20.0, c=0.05, psi=10.0),
    lambda elastic: cam_clay(
        elastic, M=1.0, lambda_star=0.1, kappa_star=0.02, preconsolidation=0.05
    ),
)
ELASTIC: tuple[Law, ...] = (
    lambda elastic: elastic,
    lambda elastic: von_mises(elastic, yield_stress=1e9),
    lambda elastic: drucker_prager(elastic, phi=20.0, c=1e9, psi=10.0),
)


def histories(form: Form) -> list[str]:
    """History variables of shipped laws that the residual of a form asks for."""
    made = [law(linear_elastic(E=1.0, nu=0.3)) for law in PLASTIC]
    known = {name for material in made for name in material.history_names}
    return [name for name in inspect.signature(form.residual).parameters if name in known]


def law_of(form: Form, laws: tuple[Law, ...]) -> Law:
    """The first law with the history variables that a form reads."""
    needed = {*histories(form)}
    for law in laws:
        try:
            if needed <= {*law(linear_elastic(E=1.0, nu=0.3)).history_names}:
                return law
        except Exception:  # a law that these moduli do not fit
            continue
    return laws[0]


def compiled(form: Form, given: Settings, **more: Any) -> CompiledForm:
    """The form with its options, for plane strain."""
    options = form.settings(given)[1]
    return compile_form(MPI.COMM_SELF, form, options, histories=histories(form), **more)


def reads(form: Form, given: Settings, name: str) -> bool:
    """Whether a residual reads dt, a parameter or data."""
    return name in compiled(form, given).used


def steps(form: Form, given: Settings) -> tuple[float, ...]:
    """Lengths of a step at which a form is checked [s]."""
    return STEPS if reads(form, given, "dt") else (1.0,)


def natural(form: Form, name: str) -> float:
    """A value of a field, of data or of a parameter that is neither large nor small."""
    text = unit_of(form, name)
    return 1.0 if unreadable(form) else size(dimension(text), SCALES)


def values(form: Form, given: Settings) -> Settings:
    """Parameters and options of a form: as given, of natural size if they have a unit, or default."""
    chosen, used = dict(given), compiled(form, given).used
    for name, limits in form.parameters.items():
        if name in given or name not in used or not dimension(unit_of(form, name)):
            continue
        value, low, high = natural(form, name), limits.get("minimum"), limits.get("maximum")
        within = (low is None or value >= low) and (
            high is None or (not isinstance(high, dict) and value <= high)
        )
        chosen[name] = value if within else limits["default"]
    return chosen


def made(
    form: Form,
    given: Settings,
    grid: Grid,
    body: Body,
    material: Any,
    *,
    varied: bool = False,
    **options: Any,
) -> Scene:
    """A scene of a form with data of natural size.

    Args:
        form: The form.
        given: Parameters and options instead of their defaults.
        grid: The grid.
        body: The particles.
        material: As of `Scene`.
        varied: Whether data differ between particles.
        options: Other arguments of `Scene`.
    """
    if compiled(form, given).border:
        body = replace(body, border=border_of(form, given, body))
    if "rho" in inspect.signature(form.residual).parameters:
        options["density"] = DENSITY
    scene = Scene(grid, body, material, form=form, **options, **values(form, given))
    random = np.random.default_rng(3)
    for name in form.data:
        vary = random.uniform(0.8, 1.2, len(body.x)) if varied else 1.0
        scene.data(name, natural(form, name) * vary)
    return scene


def border_of(form: Form, given: Settings, body: Body) -> Border:
    """The rectangle around a body, or the square with the area and centroid of loose particles.

    Its sides are 'bottom', 'right', 'top' and 'left'. Other names in sums over the border take the
    places of sides that no sum names, and then of parts of the base.
    """
    centre, half = body.volume @ body.x / body.volume.sum(), np.sqrt(body.volume.sum()) / 2
    lower, upper = centre - half, centre + half
    if body.border is not None:
        ends = np.concatenate([body.border.start, body.border.end])
        lower, upper = ends.min(axis=0), ends.max(axis=0)
    asked = {name for term in compiled(form, given).border for name in term.on or ()}
    names, others = [*SIDES], sorted(asked - {*SIDES})
    for free in [name for name in names if name not in asked][: len(others)]:
        names[names.index(free)] = others.pop()
    base = np.linspace(lower, upper, len(others) + 2)[:-1, 0]
    corners = [(upper[0], lower[1]), tuple(upper), (lower[0], upper[1])]
    return polyline([*corners, *((x, lower[1]) for x in base)], names=[*names, *others])


def solve(scene: Scene, *, dt: float) -> Any:
    """Solve a scene, over a time if its form reads dt."""
    timed = "dt" in scene.configuration.model.compiled.used
    return scene.solve(until=scene.time + dt) if timed else scene.solve()


def at_random(scene: Scene) -> None:
    """Give the particles random fields and gradients."""
    random = np.random.default_rng(4)
    for name in scene.form.own_fields:
        column = np.asarray(scene.particles.carried(name))
        column[:] = 0.1 * natural(scene.form, name) * random.uniform(0.5, 1.5, column.shape)


def spread(scene: Scene, random: Any) -> Array:
    """Random increments of all fields, each of a size that suits its unit."""
    found = 0.05 * H * random.standard_normal(scene.num_coefficients)
    for name, place in scene.configuration.domain.layout.fields.items():
        if name in scene.form.own_fields:
            found[place.slice] *= natural(scene.form, name)
    return np.asarray(found)
