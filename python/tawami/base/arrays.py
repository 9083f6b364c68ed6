"""Types of NumPy arrays."""

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
