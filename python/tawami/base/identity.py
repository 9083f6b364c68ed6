"""Identity of a run: facts by which a checkpoint is recognised as one of the same run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from tawami.base.meaning import ALIKE, CODE, PYTHON, UNKNOWN, meaning

#: Placeholder of a fact that only the other run has.
NOTHING = "nothing"


def text(value: Any) -> Any:
    """A number as text; for a function, the facts about its code and values."""
    return {_name(value): meaning(value)} if callable(value) else repr(value)


def _name(function: Any) -> str:
    name = getattr(function, "__name__", type(function).__name__)
    return "a function" if name == "<lambda>" else str(name)


def same(one: Any, other: Any) -> bool:
    """Whether two facts are equal; numbers to the round-off of a run on another number of ranks."""
    return next(differences(one, other), None) is None


def differences(one: Any, other: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """The difference of two facts: the name of the part, and both values.

    Code of two versions of Python is not compared; see :func:`not_compared`.
    """
    if isinstance(one, float) and isinstance(other, float):
        equal = math.isclose(one, other, rel_tol=ALIKE) or (math.isnan(one) and math.isnan(other))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, pair in enumerate(zip(one, other, strict=True)):
            nested = isinstance(pair[1], dict | list)
            yield from differences(*pair, name if nested else f"{name}[{k}]")
        return
    elif isinstance(one, dict) and isinstance(other, dict):
        if PYTHON in one and PYTHON in other and one[PYTHON] != other[PYTHON]:
            return
        keys = sorted({**one, **other}, key=lambda key: key == CODE)  # a variable says more
        for key in keys:
            pair = one.get(key, NOTHING), other.get(key, NOTHING)
            yield from differences(*pair, f"{name}: {key}" if name else key)
        return
    else:
        equal = bool(one == other)
    if not equal:
        yield name, one, other


def not_compared(one: Any, other: Any, name: str = "") -> Iterator[str]:
    """Names of the parts of two equal facts that cannot be compared."""
    if isinstance(one, list) and isinstance(other, list):
        for pair in zip(one, other, strict=False):
            yield from not_compared(*pair, name)
    elif isinstance(one, dict) and isinstance(other, dict):
        if UNKNOWN in one:
            yield f"{name} ({one[UNKNOWN]})"
        elif one.get(PYTHON) != other.get(PYTHON):
            yield f"{name} (of Python {one.get(PYTHON)} and {other.get(PYTHON)})"
        for key in one.keys() & other.keys():
            yield from not_compared(one[key], other[key], f"{name}: {key}" if name else key)
