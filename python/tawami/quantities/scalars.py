"""The numbers in quantities of the particles: components, sizes of vectors, and measures that follow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.space import PLANE
from tawami.quantities.quantities import (
    HISTORY,
    PARTICLES,
    Arrays,
    Given,
    Quantity,
    history,
    split,
    unknown,
)


def scalars(fields: Mapping[str, Array], *, sizes: bool = True) -> dict[str, tuple[str, Array]]:
    """The numbers of fields: name -> (unit, values), one value for each particle.

    Args:
        fields: Values by label. Vectors may have more components than the space.
        sizes: Whether a vector has its size too, under its own name.
    """
    found: dict[str, tuple[str, Array]] = {}
    for label, values in fields.items():
        name, components, unit = split(label)
        if values.ndim == 1:
            found[name] = (unit, values)
            continue
        if not components and values.shape[1] in (PLANE.dim, 3):
            components = PLANE.axes
            if sizes:
                found[name] = (unit, np.linalg.norm(values, axis=1))
        if not components:
            components = tuple(map(str, range(1, values.shape[1] + 1)))
        found |= {f"{name} {c}": (unit, values[:, k]) for k, c in enumerate(components)}
    return found


def pick(given: Given, arrays: Arrays, more: Mapping[str, Quantity]) -> tuple[str, str, Array]:
    """Name, unit and values of a quantity with one number for each particle.

    Args:
        given: A quantity, or a name as 'mean stress', 'stress xx', 'displacement' (its size) or
            'displacement y'.
        arrays: Of the particles.
        more: Quantities that the laws and the form add.

    Raises:
        NotModelledError: The scene does not have it.
        InputError: An unknown name, or a tensor without a component.
    """
    known = {**PARTICLES, **more}
    if isinstance(given, Quantity):
        quantity, name = given, given.name
    else:
        name = given if isinstance(given, str) else checks.shown(given)
        base = name if name in known or name in HISTORY else name.rpartition(" ")[0]
        if base not in known and base not in HISTORY:
            raise unknown("quantity", name, known)
        quantity = known.get(base, history(base))
    found = scalars({quantity.label: quantity.values(arrays)})
    if name not in found:
        raise InputError(
            f"'{name}' is not one number: expected one of {', '.join(map(repr, found))}"
        )
    return name, *found[name]


def derived(fields: Mapping[str, Array]) -> dict[str, Array]:
    """Fields by label, with the quantities that follow from them: the mean stress from the stress."""
    by_name = {split(label)[0]: values for label, values in fields.items()}
    found = dict(fields)
    for quantity in PARTICLES.values():
        if quantity.name not in by_name:
            try:
                found[quantity.label] = np.asarray(quantity.of(Arrays(by_name.__getitem__)))
            except KeyError:
                continue
    return found
