"""Identity of a run: facts by which a checkpoint is recognised as one of the same run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

#: Relative tolerance to which numbers of two identities are compared.
ALIKE = 1e-9
#: Round-off of values of size one.
ROUND_OFF = 1e-12


def fingerprint(values: Any, size: float) -> float:
    """A number that other values hardly share.

    :func:`same` compares it to the relative tolerance ALIKE: round-off in the values, and values that
    are only round-off of `size`, make no difference.
    """
    weights = np.random.default_rng(0).uniform(0.5, 1.5, values.shape)
    least = values.size * ROUND_OFF * size / ALIKE
    return float((weights * values + 2 * np.abs(values)).sum() + least)


def text(value: Any) -> str:
    """A number as text; functions are not told apart, as their values cannot be compared."""
    return "a function" if callable(value) else repr(value)


def same(one: Any, other: Any) -> bool:
    """Whether two facts are equal; numbers to the round-off of a run on another number of ranks."""
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=ALIKE) or (math.isnan(one) and math.isnan(other))
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[k], other[k]) for k in one)
    return bool(one == other)
