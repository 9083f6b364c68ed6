"""Objects whose attributes are set by their own methods, and settings that are fixed."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn, TypeVar

from tawami.base.errors import InputError

Value = TypeVar("Value")


class Sealed:
    """Base class of public objects: once sealed, setting an attribute raises an error.

    Without it a misspelt or misplaced setting, as `scene.alpha = 1`, would be stored and never read.
    """

    _is_sealed = False

    def _seal(self) -> None:
        """Allow no further public attributes to be set; called at the end of `__init__`."""
        self._is_sealed = True

    def _how_to_set(self, name: str) -> str:
        """Advice for an attribute that cannot be set; subclasses give their own."""
        return f"a {type(self).__name__} is changed by its methods only"

    def __setattr__(self, name: str, value: Any) -> None:
        if self._is_sealed and not name.startswith("_"):
            descriptor = inspect.getattr_static(type(self), name, None)
            if isinstance(descriptor, property | None) or not hasattr(descriptor, "__set__"):
                raise InputError(
                    f"{type(self).__name__}.{name} cannot be set: {self._how_to_set(name)}"
                )
        super().__setattr__(name, value)


class Settings(Mapping[str, Value]):
    """Names and values that are fixed when an object is made.

    Args:
        values: The values by name.
        instead: Advice on what to do instead, for the error message.
    """

    def __init__(self, values: Mapping[str, Value], instead: str) -> None:
        self._values, self._instead = dict(values), instead

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return repr(self._values)

    def __setitem__(self, name: str, value: Any) -> NoReturn:
        raise InputError(f"'{name}' cannot be set to {value!r}: {self._instead}")
