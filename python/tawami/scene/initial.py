"""Initial fields of the particles, and whether they fit each other and the laws.

The laws add the increments of a step to the initial stress. eps_v and the displacement of the particles
are sums of increments that enter no equation. In a mixed form with an elastic law sigma_m = K eps_v,
since both are counted from the state without stress: an initial stress keeps this relation.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks, ranks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.space import PLANE
from tawami.domain import own_fields, sources
from tawami.domain.domain import Domain
from tawami.domain.earlier import Earlier
from tawami.domain.parameters import misplaced
from tawami.domain.sources import Source
from tawami.form import quantities
from tawami.step.configuration import Configuration

Beyond = Literal["stop", "return"]
#: Stress beyond the yield surface by no more than this share is round-off; at finite strain another
#: share, of mu, is lost in small elastic strains.
ON_SURFACE, LOST = 1e-9, 1e-13
#: Share by which sigma_m / K may differ from eps_v.
FITS = 1e-6
COMPONENTS = {
    "stress": (" ".join(PLANE.tensor), "Pa"),
    "displacement": (" ".join(PLANE.axes), "m"),
}


def set_field(now: Configuration, name: str, given: Source, beyond: Beyond) -> None:
    """Set a field of the particles; see `Scene.initial`."""
    _check(now, name, beyond)
    domain = now.domain
    if name in now.model.form.own_fields:
        unit = now.model.form.own_fields[name].unit
        found = sources.values(domain, name, given, "value", unit)[:, 0]
        coefficients = own_fields.start(domain, name, found)
        if not now.model.moves:
            now.total[domain.layout.fields[name].slice] = coefficients
        return
    found = sources.values(domain, name, given, *COMPONENTS.get(name, ("value", "")))
    with ranks.raise_together(domain.model.grid.comm):
        if name == "eps_v" and not isinstance(given, Earlier):
            _check_volume(domain, found[:, 0])
        if name in ("plastic_strain", "preconsolidation") and (found < 0).any():
            p = int(found[:, 0].argmin())
            raise InputError(
                f"{name} of particle {domain.particles.number[p]} is {found[p, 0]:g}: expected "
                "0 or more"
            )
    array = _array(domain, name)
    before = array.copy()
    array[:] = found.reshape(array.shape)
    try:
        with ranks.raise_together(domain.model.grid.comm):
            if name == "stress" or name in domain.particles.history_names:
                _to_surface(domain, beyond)
    except InputError:
        array[:] = before
        raise
    if name == "stress" and domain.model.form.kinematics.has_eps_v:
        domain.particles.eps_v[:] = _mean(domain) / domain.constants["K"]


def _check(now: Configuration, name: str, beyond: Beyond) -> None:
    checks.choice("beyond", beyond, ("stop", "return"))
    known = [*COMPONENTS, *now.model.form.own_fields, *now.domain.particles.history_names]
    if now.model.form.kinematics.has_eps_v:
        known.append("eps_v")
    if not checks.one_of(name, known):
        if wrong := misplaced(now.model.form, name, f"initial({checks.shown(name)})"):
            raise wrong
        moves = checks.one_of(name, ("velocity",))
        more = "; velocities come in as Dynamics(scene, velocity=...)" if moves else ""
        raise InputError(
            f"initial({checks.shown(name)}): expected one of {', '.join(map(repr, known))}, which this "
            f"scene has{more}"
        )
    if now.begun or "velocity" in dict(now.domain.particles.arrays):
        raise InputError(
            f"initial('{name}') after the scene was solved or set in motion: expected it before. To "
            "start from a later state, make another scene with the particles of tawami.earlier(...)"
        )


def _array(domain: Domain, name: str) -> Array:
    """The storage of a field, a view."""
    if name in domain.particles.history_names:
        return domain.particles.history(name)
    array: Array = getattr(domain.particles, name)
    return array


def _mean(domain: Domain) -> Array:
    return np.asarray(domain.particles.stress[:, :3].mean(axis=1))


def _check_volume(domain: Domain, eps_v: Array) -> None:
    """Whether eps_v fits the stress of elastic particles, or is counted from their state."""
    mean, elastic = _mean(domain), domain.constants["K"] * eps_v
    off = np.abs(elastic - mean) > FITS * np.maximum(np.abs(mean), np.abs(elastic))
    off &= domain.is_elastic & bool(eps_v.any())
    if off.any():
        p = np.flatnonzero(off)[0]
        raise InputError(
            f"eps_v of particle {domain.particles.number[p]} is {eps_v[p]:g}, which gives an "
            f"elastic law a mean stress of {elastic[p]:g} Pa, but its mean stress is {mean[p]:g} Pa: "
            "expected 0, or initial('stress', ...) alone, which sets eps_v too"
        )


def _to_surface(domain: Domain, beyond: Beyond) -> None:
    """Stress beyond the yield surface: an error, or returned to it as the law returns it."""
    stress, mu = domain.particles.stress, domain.constants["mu"]
    returned = _returned(domain)
    size = np.maximum(_norm(stress), _norm(returned))
    off = _norm(returned - stress)
    wrong = np.flatnonzero(off > ON_SURFACE * size + LOST * mu)
    if not len(wrong):
        return
    if beyond == "return":
        stress[wrong] = returned[wrong]
        return
    p = wrong[(off[wrong] / size[wrong]).argmax()]
    (x, y), number = domain.particles.x[p], domain.particles.number[p]
    raise InputError(
        f"stress of particle {number} at ({x:g}, {y:g}) m is ({_row(stress[p])}) Pa, beyond the "
        f"yield surface by {off[p]:.3g} Pa, {100 * off[p] / size[p]:.2g} % of it, as are "
        f"{len(wrong) - 1} others: expected stress within the yield surface; beyond='return' uses "
        f"the stress to which the law returns it, ({_row(returned[p])}) Pa"
    )


def _returned(domain: Domain) -> Array:
    """Stress after a zero strain increment, on the yield surface or inside [Pa]: xx, yy, zz, xy."""
    layout = domain.layout
    fields = layout.split(np.zeros(layout.size))
    strain = domain.model.form.strain
    wanted = [(strain.mean, "value", 0, None), (strain.stress, "value", 1, None)]
    size = quantities.components(quantities.LawQuantity(strain.stress), domain.model.space)
    data = np.zeros((len(domain.particles), 1 + size))
    domain.total_strain_stage.evaluate(*fields, _rust.Requests([wanted]), [data])
    mean, components = data[:, 0], data[:, 1:]
    xx, yy, xy = components[:, strain.stress_xx_yy_xy].T
    return np.column_stack([xx, yy, 3 * mean - xx - yy, xy])


def _norm(stress: npt.ArrayLike) -> Array:
    """sqrt(sigma : sigma) [Pa]."""
    return np.asarray(np.sqrt(np.square(stress) @ [1.0, 1.0, 1.0, 2.0]))


def _row(stress: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in stress)
