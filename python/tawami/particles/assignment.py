"""Material and density of each particle, from the arguments of a driver script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.body.body import Body
from tawami.particles.numpy_law import NumpyLaw

#: A law of particles.
Law = _rust.Material | NumpyLaw
#: A law for all particles, one for each number, or one for each name of the body.
Given = Law | Sequence[Law] | Mapping[str, Law]


@dataclass(frozen=True)
class Assignment:
    """The materials of a body.

    Attributes:
        laws: The laws.
        number: Number of the law of each particle.
    """

    laws: list[Law]
    number: npt.NDArray[np.uint32]


def assigned(material: Given, material_of: npt.ArrayLike | None, body: Body, n: int) -> Assignment:
    """Assign materials to n particles.

    Args:
        material: Material or `NumpyLaw`, or a list or dictionary of these.
        material_of: Number of the material of each particle.
        body: The body, with names and numbers of its own.
        n: Number of particles.

    Raises:
        InputError: There is no material, names of body and materials differ, or numbers do not fit.
    """
    numbers = body.material_of if material_of is None else material_of
    if isinstance(material, Mapping):
        if material_of is not None:
            raise InputError(
                "material is a dictionary and material_of is given too: expected a dictionary with the "
                "names of the body, or a list of materials with material_of"
            )
        materials = _by_name("material", material, body.names)
    else:
        materials = list(material) if isinstance(material, Sequence) else [material]
        if material_of is None and len(body.names) > 1 and len(materials) != len(body.names):
            raise InputError(
                f"{len(materials)} material{'s' if len(materials) > 1 else ''} for a body with "
                f"{len(body.names)} names, {_listed(body.names)}: expected one for each, as a list in "
                "this order or a dictionary from names to materials; one for all of it with "
                "material_of=np.zeros(len(body.x))"
            )
    if not materials or not all(isinstance(m, Law) for m in materials):
        raise InputError(
            f"material = {checks.shown(material)}: expected a material as linear_elastic(...) makes "
            "it, a NumpyLaw, or a list or a dictionary of these"
        )
    if numbers is None and len(materials) > 1:
        raise InputError(
            f"{len(materials)} materials, and nothing says which particle has which: expected "
            "material_of=..., with the number of the material of each particle, or a body with names"
        )
    number = checks.numbering("material_of", np.zeros(n) if numbers is None else numbers, n)
    return Assignment(materials, number)


def materials_of(laws: Sequence[Law]) -> list[_rust.Material]:
    """The laws as the Rust part knows them."""
    return [law.material if isinstance(law, NumpyLaw) else law for law in laws]


def in_numpy(laws: Sequence[Law]) -> dict[int, NumpyLaw]:
    """The laws in NumPy, by their numbers."""
    return {number: law for number, law in enumerate(laws) if isinstance(law, NumpyLaw)}


def densities(
    density: float | Sequence[float] | Mapping[str, float] | None,
    materials: int,
    names: Sequence[str],
) -> Array | None:
    """Density of each material [kg/m3]; None if no density is given.

    Raises:
        InputError: Number or names do not fit the materials, or a density is below 0.
    """
    if density is None:
        return None
    if isinstance(density, Mapping):
        density = _by_name("density", density, names)
    many = isinstance(density, Sequence) or (isinstance(density, np.ndarray) and density.ndim == 1)
    given: list[Any] = list(density) if many else [density] * materials  # type: ignore[arg-type]
    if len(given) != materials:
        raise InputError(
            f"density has {len(given)} values: expected one, or one for each of the {materials} "
            "materials"
        )
    return np.array([checks.number("density", rho, low=0.0) for rho in given])


def _by_name(what: str, given: Mapping[str, Any], names: Sequence[str]) -> list[Any]:
    """The values in the order of the names of the body."""
    if not names:
        raise InputError(
            f"{what} is a dictionary and the body has no names: expected a body of tawami.mesh(...) "
            "with groups, or Body(x, volume, material_of, names)"
        )
    missing = [name for name in names if name not in given]
    extra = [name for name in given if name not in names]
    if missing or extra:
        wrong = [f"nothing for {_listed(missing)}"] if missing else []
        wrong += [f"{_listed(extra)}, which the body does not have"] if extra else []
        raise InputError(
            f"{what} has {' and '.join(wrong)}: expected one for each of {_listed(names)}"
        )
    return [given[name] for name in names]


def _listed(names: Sequence[Any]) -> str:
    return ", ".join(repr(name) for name in names)
