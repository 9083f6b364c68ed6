"""Places along a border where a function of the driver script changes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array, Indices, Mask
from tawami.base.checks import shown
from tawami.base.errors import InputError
from tawami.border.curves import Curves

#: Samples on each piece, and bisections between two of them.
SAMPLES, BISECTIONS = 17, 52


def changes(curves: Curves, f: Callable[[Array, Array], npt.ArrayLike]) -> tuple[Indices, Array]:
    """Pieces, and shares of their length, at which a function changes its value.

    Raises:
        InputError: The function fails, or returns an array of another shape or no mask.
    """
    n, samples = len(curves.start), np.linspace(0, 1, SAMPLES)
    each = np.repeat(np.arange(n), SAMPLES)
    values = mask(f, curves.at(each, np.tile(samples, n))).reshape(n, SAMPLES)
    of, first = np.nonzero(values[:, 1:] != values[:, :-1])
    low, high, before = samples[first], samples[first + 1], values[of, first]
    if len(of):
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            same = mask(f, curves.at(of, middle)) == before
            low, high = np.where(same, middle, low), np.where(same, high, middle)
    return of, high


def mask(f: Callable[[Array, Array], npt.ArrayLike], x: Array) -> Mask:
    """The mask that a function returns at positions [m], n x dim.

    Raises:
        InputError: The function fails, or returns an array of another shape or no mask.
    """
    if not callable(f):
        raise InputError(f"where = {shown(f)}: expected a function f(x, y) -> mask on arrays")
    try:
        values = np.asarray(f(*x.T))
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"where: the function failed on arrays ({error}): expected f(x, y) -> mask on arrays of "
            "positions [m], as lambda x, y: (x > 1) & (y > 2)"
        ) from error
    if values.shape not in ((), (len(x),)):
        raise InputError(
            f"where: the function returned an array of shape {values.shape}: expected ({len(x)},), the "
            "shape of x"
        )
    if values.dtype != np.bool_:
        raise InputError(
            f"where: the function returned {values.dtype}: expected a mask of True and False, as "
            "lambda x, y: x > 1"
        )
    return np.asarray(np.broadcast_to(values, len(x)))
