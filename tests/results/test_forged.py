"""Checkpoints with valid checksums and a wrong content: a state that runs, or one error message."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from runs import Kill, Killed, block, results_of, run

import tawami
from tawami.base import archive


def leaves(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Places of all values in a state, those of dictionaries and lists included."""
    yield place
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in pairs:
            yield from leaves(item, (*place, key))


def forgeries(value: Any) -> Iterator[Any]:
    """Wrong values in place of a value."""
    yield from (None, "text", [1, 2], {"a": 1}, True, -3, np.zeros((2, 3)))
    if isinstance(value, np.ndarray) and value.size:
        yield from (value[:-1], value.T, value.ravel(), value.astype(np.float32), value.astype("U"))
        yield from (value.astype(complex), np.concatenate([value, value]), value[:0], -value)
        for bad in (np.nan, np.inf, 1e300, -1e300, 1e18, 0.5):
            forged = value.astype(float)
            forged.flat[value.size // 2] = bad
            yield forged
    elif isinstance(value, int | float):
        yield from (np.nan, np.inf, -value, 1e300, -1e300, 2**70, 0)


def forged(state: Any, place: tuple[Any, ...], value: Any) -> Any:
    """A copy of a state with another value at a place; without the entry for the value Ellipsis."""
    if not place:
        return value
    key, *rest = place
    copy = dict(state) if isinstance(state, dict) else list(state)
    if value is ... and not rest:
        del copy[key]
    else:
        copy[key] = forged(state[key], tuple(rest), value)
    return copy
