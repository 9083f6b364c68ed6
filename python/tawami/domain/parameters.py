"""Parameters of a form: numbers, functions of time or numbers of the particles, and their names."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.text import quoted
from tawami.domain.scattered import Scattered
from tawami.form.form import ARRAYS, Form


def by_kind(
    form: Form, given: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Callable[[float], float]], dict[str, Any]]:
    """Parameters and options that are numbers or text, parameters that are functions of time, and those
    with one number for each particle.
    """
    for name in given:
        if name in form.data and (wrong := misplaced(form, name, f"Scene(..., {name}=...)")):
            raise wrong
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


def misplaced(form: Form, name: Any, where: str) -> InputError | None:
    """The error of an input of a form that is given by another call; None for other names."""
    ways = (
        ("data", form.data, f"scene.data('{name}', ...)"),
        ("a parameter", form.parameters, f"scene.parameter('{name}', ...)"),
        ("an option", form.options, f"Scene(..., {name}=...)"),
        ("a field", form.own_fields, f"scene.initial('{name}', ...)"),
    )
    for what, known, call in ways:
        if checks.one_of(name, known):
            return InputError(f"{where}: '{name}' is {what} of form {form.name}: expected {call}")
    return None


def _arguments(function: Any) -> int:
    """Number of arguments that a function needs."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    positional = ("POSITIONAL_ONLY", "POSITIONAL_OR_KEYWORD")
    return sum(p.kind.name in positional and p.default is p.empty for p in parameters)


def check_names(form: Form, in_space: Iterable[str], materials: Sequence[_rust.Material]) -> None:
    """Check that fields, data and parameters of each particle have names of their own.

    Raises:
        InputError: One is called as an array of the particles or a history variable of a law.
    """
    histories = {name for one in materials for name in one.history_names}
    taken = ({*form.own_fields, *form.data} & histories) | ({*in_space} & (histories | ARRAYS))
    if taken:
        raise InputError(
            f"form {form.name}: {quoted(sorted(taken))} is also an array of the particles: expected "
            "another name in the form"
        )
