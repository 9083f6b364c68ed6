"""Types of NumPy arrays, and places in them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: Real numbers.
Array = npt.NDArray[np.float64]
#: One truth value per entry.
Mask = npt.NDArray[np.bool_]
#: Positions in other arrays.
Indices = npt.NDArray[np.int64]


def of_components(numbers: Indices, dim: int) -> Indices:
    """Places of all components of some vectors, ... x dim, in an array that holds one vector after
    another.
    """
    return dim * numbers[..., None] + np.arange(dim)


def sums_at(place: Indices, values: Array, size: int) -> Array:
    """Sums of the values at each of `size` places.

    They are real numbers without any values too, where `bincount` gives whole ones, which are no part of
    a sum over ranks.
    """
    return np.bincount(place, values, size).astype(np.float64, copy=False)
