"""Fields of the particles that a scene begins with, and whether they fit each other and the laws.

Stress is what the laws go on from; the increments of a step add to it. eps_v and the displacement of
the particles are sums of increments that enter no equation. In a mixed form of an elastic law
sigma_m = K eps_v, for both are counted from no stress: an initial stress keeps that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks, ranks
from tawami.base.errors import InputError
from tawami.form import quantities
from tawami.scene import sources
from tawami.scene.sources import Earlier, Source

if TYPE_CHECKING:
    from tawami.scene.scene import Scene

Array = npt.NDArray[np.float64]
Beyond = Literal["stop", "return"]
#: Stress beyond the yield surface by no more than this share is round-off; and, at finite strain, what
#: is lost of small elastic strains, over mu.
ON_SURFACE, LOST = 1e-9, 1e-13
#: Share by which sigma_m / K may differ from eps_v.
FITS = 1e-6
COMPONENTS = {"stress": ("xx yy zz xy", "Pa"), "displacement": ("x y", "m")}


def give(scene: Scene, name: str, given: Source, beyond: Beyond) -> None:
    """See `Scene.initial`."""
    _check(scene, name, beyond)
    with ranks.raise_together(scene.grid.comm):
        found = sources.values(scene, name, given, *COMPONENTS.get(name, ("value", "")))
        if name == "eps_v" and not isinstance(given, Earlier):
            _check_volume(scene, found[:, 0])
        if name == "plastic_strain" and (found < 0).any():
            p = int(found[:, 0].argmin())
            raise InputError(
                f"plastic_strain of particle {scene.particles.number[p]} is {found[p, 0]:g}: expected "
                "0 or more"
            )
    array = _array(scene, name)
    before = array.copy()
    array[:] = found.reshape(array.shape)
    try:
        with ranks.raise_together(scene.grid.comm):
            if name == "stress" or name in scene.particles.history_names:
                _to_surface(scene, beyond)
    except InputError:
        array[:] = before
        raise
    if name == "stress" and scene.form.kinematics.has_eps_v:
        scene.particles.eps_v[:] = _mean(scene) / scene.constants["K"]


def _check(scene: Scene, name: str, beyond: Beyond) -> None:
    checks.choice("beyond", beyond, ("stop", "return"))
    known = [*COMPONENTS, *scene.particles.history_names]
    if scene.form.kinematics.has_eps_v:
        known.append("eps_v")
    if not checks.one_of(name, known):
        moves = checks.one_of(name, ("velocity",))
        more = "; velocities come in as Dynamics(scene, velocity=...)" if moves else ""
        raise InputError(
            f"initial({checks.shown(name)}): expected one of {', '.join(map(repr, known))}, which this "
            f"scene has{more}"
        )
    if scene.begun or "velocity" in dict(scene.particles.arrays):
        raise InputError(
            f"initial('{name}') after the scene was solved or set in motion: expected it before; to go "
            "on from a state make another scene with it, as tawami.earlier(...) reads it"
        )


def _array(scene: Scene, name: str) -> Array:
    """The storage of a field, a view."""
    if name in scene.particles.history_names:
        return scene.particles.history(name)
    array: Array = getattr(scene.particles, name)
    return array


def _mean(scene: Scene) -> Array:
    return np.asarray(scene.particles.stress[:, :3].mean(axis=1))


def _check_volume(scene: Scene, eps_v: Array) -> None:
    """Whether eps_v fits the stress of elastic particles, or is counted from their state."""
    mean, elastic = _mean(scene), scene.constants["K"] * eps_v
    off = np.abs(elastic - mean) > FITS * np.maximum(np.abs(mean), np.abs(elastic))
    off &= scene.elastic & bool(eps_v.any())
    if off.any():
        p = np.flatnonzero(off)[0]
        raise InputError(
            f"eps_v of particle {scene.particles.number[p]} is {eps_v[p]:g}, with which an elastic law "
            f"has a mean stress of {elastic[p]:g} Pa, and it has {mean[p]:g} Pa: expected 0, or "
            "initial('stress', ...) alone, which sets eps_v too"
        )


def _to_surface(scene: Scene, beyond: Beyond) -> None:
    """Stress beyond the yield surface: an error, or returned to it as the law returns it."""
    stress, mu = scene.particles.stress, scene.constants["mu"]
    borne = _borne(scene)
    size = np.maximum(_norm(stress), _norm(borne))
    off = _norm(borne - stress)
    wrong = np.flatnonzero(off > ON_SURFACE * size + LOST * mu)
    if not len(wrong):
        return
    if beyond == "return":
        stress[wrong] = borne[wrong]
        return
    p = wrong[(off[wrong] / size[wrong]).argmax()]
    (x, y), number = scene.particles.x[p], scene.particles.number[p]
    raise InputError(
        f"stress of particle {number} at ({x:g}, {y:g}) m is ({_row(stress[p])}) Pa, beyond what its "
        f"law bears by {off[p]:.3g} Pa, {100 * off[p] / size[p]:.2g} % of it, and {len(wrong) - 1} "
        "others are too: expected stress within the yield surface; the law returns it to "
        f"({_row(borne[p])}) Pa, as beyond='return' takes it"
    )


def _borne(scene: Scene) -> Array:
    """What the laws answer to no strain [Pa], xx, yy, zz, xy."""
    layout = scene.attached.layout
    fields = layout.split(np.zeros(layout.size))
    strain = scene.form.strain
    wanted = [(strain.mean, "value", 0, None), (strain.stress, "value", 1, None)]
    data = np.zeros((len(scene.particles), 1 + quantities.COMPONENTS[strain.stress]))
    scene.attached.stage.evaluate(*fields, _rust.Requests([wanted]), [data])
    mean, components = data[:, 0], data[:, 1:]
    xx, yy, xy = components[:, strain.stress_xx_yy_xy].T
    return np.column_stack([xx, yy, 3 * mean - xx - yy, xy])


def _norm(stress: npt.ArrayLike) -> Array:
    """sqrt(sigma : sigma) [Pa]."""
    return np.asarray(np.sqrt(np.square(stress) @ [1.0, 1.0, 1.0, 2.0]))


def _row(stress: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in stress)
