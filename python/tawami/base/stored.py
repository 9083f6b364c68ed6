"""Arrays of a checkpoint, checked before a state is made of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array, Indices
from tawami.base.errors import CheckpointError


def values(what: str, given: Any, shape: tuple[int, ...]) -> Array:
    """Finite real numbers of a shape.

    Raises:
        CheckpointError: Anything else.
    """
    raw = _array(given)
    if raw.shape != shape or raw.dtype.kind not in "fiu" or not np.isfinite(raw).all():
        raise CheckpointError(
            f"{what} in the checkpoint is an array of type {raw.dtype} and shape {raw.shape}: expected "
            f"finite numbers of shape {shape}, as in a run of the same script"
        )
    return np.asarray(raw, dtype=float)


def numbers(what: str, given: Any, length: int, below: float = math.inf) -> Indices:
    """Whole numbers from 0, as many as `length` says and all smaller than `below`.

    Raises:
        CheckpointError: Anything else.
    """
    raw = values(what, given, (length,))
    if (raw != np.floor(raw)).any() or not ((raw >= 0) & (raw < min(below, 2.0**53))).all():
        raise CheckpointError(
            f"{what} in the checkpoint holds other numbers than whole ones from 0 to {below - 1:g}: "
            "expected those of a run of the same script"
        )
    return raw.astype(np.int64)


def some_of(what: str, given: Any, count: int, *, repeated: bool = False) -> Indices:
    """Numbers of those of `count` things that are left, in ascending order.

    Args:
        what: The numbers, for messages.
        given: What the checkpoint holds.
        count: Number of things.
        repeated: Numbers may occur several times.

    Raises:
        CheckpointError: Anything else.
    """
    left = numbers(what, given, _array(given).size, count)
    if (np.diff(left) < (0 if repeated else 1)).any():
        raise CheckpointError(
            f"{what} in the checkpoint is not in ascending order: expected the numbers of a run of the "
            "same script"
        )
    return left


def check_count(what: str, stored: int, made: int, advice: str) -> None:
    """Check that a script has made as many things as the run had.

    Args:
        what: The things, for the message.
        stored: Their number when the run was stored.
        made: Their number now.
        advice: What is expected.

    Raises:
        CheckpointError: The numbers differ.
    """
    if stored != made:
        raise CheckpointError(
            f"the run had {stored} {what} when it was stored, and the script made {made}: expected "
            f"{advice}"
        )


def _array(given: Any) -> npt.NDArray[Any]:
    """An array of what a checkpoint holds; numbers in lists are read as those in arrays."""
    try:
        return np.asarray(given)
    except ValueError:  # lists of several lengths
        return np.asarray(None)
