"""Checks of what a driver script passes: each returns the value in its proper type, or raises."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.errors import InputError

Array = npt.NDArray[np.float64]
#: The least number above 0.
LEAST = sys.float_info.min


def number(name: str, value: Any, *, low: float = -math.inf, high: float = math.inf) -> float:
    """A finite number within limits.

    Raises:
        InputError: Anything else.
    """
    if not isinstance(value, Real):
        raise InputError(f"{name} = {value!r}: expected a number")
    if not (math.isfinite(value) and low <= float(value) <= high):
        least = "above 0" if low == LEAST else f"of at least {low:g}"
        within = f" {least}" if math.isinf(high) else f" {least} and at most {high:g}"
        if math.isinf(low):
            within = "" if math.isinf(high) else f" of at most {high:g}"
        raise InputError(f"{name} = {value!r}: expected a finite number{within}")
    return float(value)


def whole_number(name: str, value: Any, *, low: int) -> int:
    """A whole number, at least `low`.

    Raises:
        InputError: Anything else.
    """
    if not isinstance(value, Integral) or value < low:
        raise InputError(f"{name} = {value!r}: expected a whole number, at least {low}")
    return int(value)


def pair(name: str, value: Any, what: str) -> tuple[Any, Any]:
    """A sequence of two.

    Raises:
        InputError: Anything else; `what` says what the two are.
    """
    if isinstance(value, str) or not isinstance(value, Sequence | np.ndarray) or len(value) != 2:
        raise InputError(f"{name} = {value!r}: expected two {what}")
    return value[0], value[1]


def point(name: str, value: Any) -> tuple[float, float]:
    """A point (x, y) [m].

    Raises:
        InputError: Anything but two finite numbers.
    """
    x, y = pair(name, value, "numbers, a point (x, y)")
    return number(f"{name}[0]", x), number(f"{name}[1]", y)


def array(name: str, values: Any, dimensions: int) -> Array:
    """A contiguous array of real numbers.

    Raises:
        InputError: Not numbers, not real, or another number of dimensions.
    """
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "fiu":
            raise ValueError(f"it holds {raw.dtype}")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected an array of real numbers: {error}") from None
    if raw.ndim != dimensions:
        raise InputError(f"{name} has shape {raw.shape}: expected {dimensions} dimensions")
    return np.ascontiguousarray(raw, dtype=np.float64)


def numbering(name: str, values: Any, length: int) -> npt.NDArray[np.uint32]:
    """Whole numbers from 0, one per particle.

    Raises:
        InputError: Another length, a fraction, or a negative number.
    """
    raw = array(name, values, 1)
    if len(raw) != length:
        raise InputError(f"{name} has {len(raw)} entries: expected {length}, one per particle")
    wrong = np.flatnonzero(~((raw >= 0) & (raw == np.floor(raw)) & (raw < 2**32)))
    if len(wrong):
        raise InputError(
            f"{name}[{wrong[0]}] = {raw[wrong[0]]:g}: expected the number of a material, from 0"
        )
    return raw.astype(np.uint32)
