"""Parameters of a form by kind: numbers, functions of time, one number for each particle."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tawami.form.form import Form
from tawami.scene.scattered import Scattered


def by_kind(
    form: Form, given: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Callable[[float], float]], dict[str, Any]]:
    """Parameters and options that are numbers or text, parameters that are functions of time, and those
    with one number for each particle.
    """
    numbers = dict(given)
    in_time, in_space = dict[str, Any](), dict[str, Any]()
    for name in form.parameters:
        value = given.get(name)
        if callable(value) and not isinstance(value, Scattered):
            kind = in_time if _arguments(value) == 1 else in_space
            kind[name] = numbers.pop(name)
        elif isinstance(value, Scattered) or (
            not isinstance(value, str)
            and isinstance(value, Sequence | np.ndarray)
            and np.ndim(value)
        ):
            in_space[name] = numbers.pop(name)
    return numbers, in_time, in_space


def _arguments(function: Any) -> int:
    """Number of arguments that a function needs."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    positional = ("POSITIONAL_ONLY", "POSITIONAL_OR_KEYWORD")
    return sum(p.kind.name in positional and p.default is p.empty for p in parameters)
