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
