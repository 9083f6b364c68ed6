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

#: A material for all particles, one for each number, or one for each name of the body.
Given = _rust.Material | Sequence[_rust.Material] | Mapping[str, _rust.Material] | NumpyLaw


@dataclass(frozen=True)
class Assignment:
    """The materials of a body.

    Attributes:
        materials: The laws.
        law: The law in NumPy, if there is one; `materials` then contains its elastic law.
        number: Number of the law of each particle.
    """

    materials: list[_rust.Material]
    law: NumpyLaw | None
    number: npt.NDArray[np.uint32]


def assigned(material: Given, material_of: npt.ArrayLike | None, body: Body, n: int) -> Assignment:
    """Assign materials to n particles.

    Args:
        material: Material, list or dictionary of materials, or a `NumpyLaw`.
        material_of: Number of the material of each particle.
        body: The body, with names and numbers of its own.
        n: Number of particles.

    Raises:
        InputError: There is no material, names of body and materials differ, or numbers do not fit.
    """
    law = material if isinstance(material, NumpyLaw) else None
    numbers = body.material_of if material_of is None else material_of
    if isinstance(material, Mapping):
        if material_of is not None:
            raise InputError(
                "material is a dictionary and material_of is given too: expected a dictionary with the "
                "names of the body, or a list of materials with material_of"
            )
        materials = _by_name("material", material, body.names)
    elif law is not None:
        materials, numbers = [law.elastic()], material_of
    else:
        materials = list(material) if isinstance(material, Sequence) else [material]
        if material_of is None and len(body.names) > 1 and len(materials) != len(body.names):
            raise InputError(
                f"{len(materials)} material{'s' if len(materials) > 1 else ''} for a body with "
                f"{len(body.names)} names, {_listed(body.names)}: expected one for each, as a list in "
                "this order or a dictionary from names to materials; one for all of it with "
                "material_of=np.zeros(len(body.x))"
            )
    if not materials or not all(isinstance(m, _rust.Material) for m in materials):
        raise InputError(
            f"material = {checks.shown(material)}: expected a material as linear_elastic(...) makes "
            "it, a list or a dictionary of these, or a NumpyLaw"
        )
    number = checks.numbering("material_of", np.zeros(n) if numbers is None else numbers, n)
    return Assignment(materials, law, number)


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
