"""Old names that still work: each says, when it is used, its new name and how long it will work."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from tawami.errors import InputError, TawamiDeprecationWarning

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _warn(old: str, new: str, goes_in: str) -> None:
    """Where the driver script is: two calls above this one."""
    warnings.warn(
        f"{old} is called {new} now; the old name works until tawami {goes_in}, where it goes: expected "
        f"{new}",
        TawamiDeprecationWarning,
        stacklevel=3,
    )


def renamed_parameter(
    old: str, new: str, *, goes_in: str
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Decorate a function whose keyword `old` is `new` now; type checkers know the new one only.

    Args:
        old: What it was called.
        new: What it is called.
        goes_in: First version of tawami without the old name.
    """

    def decorate(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @functools.wraps(function)
        def call(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
            if old in kwargs:
                name = function.__name__
                if new in kwargs:
                    raise InputError(f"{name}: {old} is {new} now: expected one of them, not both")
                _warn(f"{name}({old}=...)", f"{name}({new}=...)", goes_in)
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call

    return decorate


def renamed(
    old: str, *, goes_in: str
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Decorate a function to get the one that stands under its old name: `f_old = renamed("f_old",
    goes_in="1.0")(f)`.

    Args:
        old: What it was called.
        goes_in: First version of tawami without the old name.
    """

    def decorate(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @functools.wraps(function)
        def call(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
            _warn(f"{old}(...)", f"{function.__name__}(...)", goes_in)
            return function(*args, **kwargs)

        call.__name__ = old
        return call

    return decorate
