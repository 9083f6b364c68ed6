"""Quantities of the particles, by name.

Files and tables label them "name [unit]", tensors "stress xx yy zz xy [Pa]". A quantity that the scene
does not model gives an error that says how to model it; an unknown name gives the list of names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError, NotModelledError
from tawami.base.ranks import raise_together
from tawami.base.space import PLANE, Space
from tawami.base.text import meant
from tawami.particles import assignment, placement

#: Arrays of the particles that are carried by a motion.
CARRIED = ("velocity", "acceleration")
#: The array of the particles with F - I, at finite strain.
GRADIENT = "displacement_gradient"
#: Components of a symmetric tensor, as labels have them.
TENSOR = " ".join(PLANE.tensor)


class Arrays:
    """Arrays of particles by name, as `p.stress` or `p["plastic_strain"]`.

    There are `x`, `stress`, `strain`, `displacement`, `volume`, `material` and `number`, and as far
    as the scene has them `eps_v`, `velocity`, `acceleration`, history variables and, at finite strain,
    `displacement_gradient`. `mean_stress` and `deviatoric_stress_q` are computed. The first index of
    an array is the particle.

    Args:
        get: Function that returns the array of a name.
    """

    def __init__(self, get: Callable[[str], npt.ArrayLike]) -> None:
        self._get, self._known = get, dict[str, Array]()

    def __getitem__(self, name: str) -> Array:
        if (plain := name.replace("_", " ")) in DERIVED:
            return DERIVED[plain](self)
        if name not in self._known:
            self._known[name] = np.asarray(self._get(name))
        return self._known[name]

    def __getattr__(self, name: str) -> Array:
        if name.startswith("_"):
            raise AttributeError(name)
        return self[name]


@dataclass(frozen=True)
class Quantity:
    """A quantity of the particles, for outputs and pictures.

    Args:
        label: Its name and unit, as "largest shear stress [Pa]".
        of: Function that returns its values, particles or particles x components, from the arrays of the
            particles, :class:`Arrays`: `lambda p: p.stress[:, 0] - p.stress[:, 1]`.
        nodal: Whether it can be projected on the grid.
        whole: Whether its function needs the arrays of the particles of all ranks; else each rank
            calls it for its own particles.

    Raises:
        InputError: A label without a unit in brackets, or something that is not a function.
    """

    label: str
    of: Callable[[Arrays], Any]
    nodal: bool = True
    whole: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.label, str) or not re.fullmatch(r".*\S \[[^\[\]]+\]", self.label):
            raise InputError(
                f"Quantity({checks.shown(self.label)}, ...): expected a name with its unit in brackets, "
                "as 'largest shear stress [Pa]' or 'ratio [-]'"
            )
        if not callable(self.of):
            raise InputError(
                f"Quantity('{self.label}', {checks.shown(self.of)}): expected a function of the arrays "
                "of the particles, as lambda p: p.stress[:, 0]"
            )

    @property
    def name(self) -> str:
        """Its name without unit and components."""
        return split(self.label)[0]

    def values(self, arrays: Arrays) -> Array:
        """Its values.

        Raises:
            NotModelledError: The scene does not have an array that it needs.
            InputError: The function failed, or returned another shape, NaN or infinity.
        """
        what = f"quantity '{self.label}'"
        try:
            found = np.asarray(self.of(arrays), dtype=float)
        except NotModelledError as error:
            raise NotModelledError(f"{what}: {error}") from None
        except Exception as error:
            raise InputError(
                f"{what}: its function raised {type(error).__name__}: {error}"
            ) from error
        n = len(arrays["number"])
        if found.ndim not in (1, 2) or len(found) != n:
            raise InputError(
                f"{what}: its function returned an array of shape {found.shape}: expected ({n},) or "
                f"({n}, components), one row for each particle"
            )
        axes = tuple(range(1, found.ndim))
        wrong = np.flatnonzero(~np.isfinite(found).all(axis=axes))
        if len(wrong):
            p = wrong[0]
            raise InputError(
                f"{what}: its function returned {found[p]} for particle {int(arrays['number'][p])} and "
                f"NaN or infinity for {len(wrong)} of {n} particles: expected finite numbers, "
                "also at the start, where the stress may be 0 (np.divide(a, b, out=..., where=b != 0))"
            )
        return found


def _stored(name: str) -> Callable[[Arrays], Array]:
    return lambda p: p[name]


def _mean_stress(p: Arrays) -> Array:
    return np.asarray(p["stress"][:, :3].mean(axis=1))


def _deviatoric_stress(p: Arrays) -> Array:
    """q = sqrt(3/2 s : s), three-dimensional."""
    stress = p["stress"]
    s = stress[:, :3] - _mean_stress(p)[:, None]
    return np.asarray(np.sqrt(1.5 * ((s**2).sum(axis=1) + 2 * (stress[:, 3:] ** 2).sum(axis=1))))


def _volume(space: Space) -> str:
    return f"volume [{space.unit(space.volume)}]"


def _own(label: str, of: Callable[[Arrays], Any], *, nodal: bool = True) -> Quantity:
    """A quantity of each particle that depends on this particle only."""
    return Quantity(label, of, nodal, whole=False)


#: Quantities that follow from arrays of the particles.
DERIVED = {"mean stress": _mean_stress, "deviatoric stress q": _deviatoric_stress}
#: Quantities of the particles. History variables of the laws, which are strains, are added to them.
PARTICLES = {
    "displacement": _own("displacement [m]", _stored("displacement"), nodal=False),
    "stress": _own(f"stress {TENSOR} [Pa]", _stored("stress")),
    "mean stress": _own("mean stress [Pa]", _mean_stress),
    "deviatoric stress q": _own("deviatoric stress q [Pa]", _deviatoric_stress),
    "strain": _own(f"strain {TENSOR} [-]", _stored("strain")),
    "volume": _own(_volume(PLANE), _stored("volume"), nodal=False),
    "eps_v": _own("eps_v [-]", _stored("eps_v")),
    "velocity": _own("velocity [m/s]", _stored("velocity"), nodal=False),
    "acceleration": _own("acceleration [m/s2]", _stored("acceleration"), nodal=False),
    "material": _own("material [-]", _stored("material"), nodal=False),
    "number": _own("number [-]", _stored("number"), nodal=False),
}
#: History variables of the laws of tawami, and their units.
HISTORY = {"plastic_strain": "-", "dilatancy": "-", "preconsolidation": "Pa"}
#: Names, or quantities of the driver script.
Given = str | Quantity


class Subject(Protocol):
    """A scene, or its motion, which has velocities too."""

    @property
    def scene(self) -> Any:
        """The scene."""


def of_scene(scene: Any) -> dict[str, Quantity]:
    """The quantities that the laws and the form of a scene add: history variables, fields and data."""
    form, particles = scene.form, scene.particles
    units = dict(HISTORY)
    for law in assignment.in_numpy(scene.configuration.model.given).values():
        units |= law.units
    found = {name: history(name, units.get(name, "-")) for name in particles.history_names}
    found |= {
        name: _own(f"{name} [{field.unit}]", _stored(name))
        for name, field in form.own_fields.items()
    }
    given = {name: form.data_unit(name) for name in form.data if name in dict(particles.arrays)}
    found |= {n: _own(f"{n} [{unit}]", _stored(n)) for n, unit in given.items()}
    if scene.grid.space != PLANE:  # the same name, with its unit there
        found["volume"] = replace(PARTICLES["volume"], label=_volume(scene.grid.space))
    return found


def history(name: str, unit: str = "-") -> Quantity:
    """The quantity of a history variable."""
    return _own(f"{name} [{unit}]", _stored(name))


# -- arrays of particles -----------------------------------------------------


def arrays_of(particles: _rust.Particles) -> list[str]:
    """Names of the arrays that particles store, without those of a motion that are gradients."""
    stored = [name for name, _ in particles.arrays]
    names = [name for name in ("x", *PARTICLES, GRADIENT) if name in stored]
    return [*names, *particles.history_names, *_of_form(particles)]


def _of_form(particles: _rust.Particles) -> list[str]:
    """Names of the fields and data of a form that particles store."""
    others = {"x", *PARTICLES, GRADIENT, *particles.history_names}
    others |= {"velocity_gradient", "acceleration_gradient"}
    return [name for name, _ in particles.arrays if name not in others]


def array_of(particles: _rust.Particles, name: str) -> npt.NDArray[Any]:
    """An array of particles by its name.

    Raises:
        InputError: The particles do not have it; the message names what models it.
    """
    of_form = _of_form(particles)
    known = ["x", *PARTICLES, GRADIENT, *HISTORY, *particles.history_names, *of_form]
    if name in of_form:  # of a field, the gradient is behind the value
        return particles.carried(name)[:, 0]
    if name not in known:
        raise unknown("arrays of the particles", name, dict.fromkeys(known))
    if name in CARRIED:
        return particles.carried(name)
    if name not in (*PARTICLES, GRADIENT, "x"):
        return particles.history(name)
    return np.asarray(getattr(particles, name))


def copies(particles: _rust.Particles) -> dict[str, npt.NDArray[Any]]:
    """Copies of all arrays of the particles of this rank."""
    return {name: np.array(array_of(particles, name)) for name in arrays_of(particles)}


def local_arrays(subject: Subject) -> Arrays:
    """Arrays of the particles of this rank."""
    return Arrays(lambda name: _present(subject, name))


def _present(subject: Subject, name: str) -> npt.NDArray[Any]:
    with not_modelled():
        if name in CARRIED:
            _ = getattr(subject, name)  # or the error of the scene that has none
        return array_of(subject.scene.particles, name)


def body_arrays(subject: Subject) -> Arrays:
    """Arrays of the particles of all ranks in the order of their numbers; calls for all ranks."""
    gather = placement.in_order(subject.scene.grid.comm, _present(subject, "number"))
    return Arrays(lambda name: gather(_present(subject, name)))


def own_values(quantity: Quantity, subject: Subject, own: Arrays) -> Array:
    """Values of a quantity for this rank's particles, given their arrays; a call for all ranks."""
    comm = subject.scene.grid.comm
    if not quantity.whole or comm.size == 1:
        with raise_together(comm):
            return quantity.values(own)
    arrays = body_arrays(subject)
    with raise_together(comm):
        values = quantity.values(arrays)
    return np.asarray(values[np.searchsorted(arrays["number"], own["number"])])


# -- by name -----------------------------------------------------------------


def of_particles(given: Iterable[Given], subject: Subject) -> list[Quantity]:
    """Quantities of the particles by their names; a call for all ranks.

    Raises:
        NotModelledError: The scene does not have one; the message names the switch that adds it.
        InputError: An unknown name, or a function of the driver script that fails.
    """
    known = PARTICLES | of_scene(subject.scene)
    found = []
    for one in given:
        if isinstance(one, Quantity):
            one.values(body_arrays(subject))
            found.append(one)
            continue
        if one not in known and one not in HISTORY:
            raise unknown("particles", one, known)
        quantity = known.get(one, history(one))
        quantity.of(local_arrays(subject))
        found.append(quantity)
    labels = [quantity.label for quantity in dict.fromkeys(found)]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"two quantities are called '{label}': expected different labels")
    return found


def usual_of_particles(subject: Any) -> tuple[str, ...]:
    """Quantities of an output without names."""
    scene, names = subject.scene, ["displacement", "stress", "mean stress"]
    names += ["eps_v"] if scene.form.kinematics.has_eps_v else []
    names += ["velocity"] if subject.motion is not None else []
    return (*names, *of_scene(scene))


def unknown(place: str, name: str, known: Iterable[str]) -> InputError:
    """The error for a name that no quantity has."""
    some = list(known)
    hint = meant(name, some)
    return InputError(f"{place}: '{name}' is unknown: expected one of {', '.join(some)}{hint}")


@contextmanager
def not_modelled() -> Iterator[None]:
    """Raise InputError of the block as NotModelledError."""
    try:
        yield
    except InputError as error:
        raise NotModelledError(str(error)) from None


def split(label: str) -> tuple[str, tuple[str, ...], str]:
    """Name, components and unit of a label; of a tensor, the components of its label."""
    name, _, unit = label.removesuffix("]").rpartition(" [")
    if name.endswith(f" {TENSOR}"):
        return name.removesuffix(f" {TENSOR}"), PLANE.tensor, unit
    return name, (), unit
