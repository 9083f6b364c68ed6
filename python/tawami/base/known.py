"""Values that follow from arrays, computed again where these are other arrays."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import TypeVar

from tawami.base.arrays import Array, Indices

T = TypeVar("T")


class Known:
    """Values by name, known as long as the arrays that they follow from are the same objects.

    The arrays must not be written in place.
    """

    __slots__ = ("_arrays", "_values")

    def __init__(self) -> None:
        self._arrays: Sequence[Array | Indices] = ()
        self._values = dict[object, object]()

    def of(self, arrays: Sequence[Array | Indices], name: object, compute: Callable[[], T]) -> T:
        """A value; it is computed unless it is known.

        Args:
            arrays: The arrays that all values follow from.
            name: Name of the value.
            compute: Computes it.
        """
        same = len(arrays) == len(self._arrays)
        if not (same and all(map(operator.is_, arrays, self._arrays))):
            self._arrays, self._values = arrays, {}
        if name not in self._values:
            self._values[name] = compute()
        return self._values[name]  # type: ignore[return-value]
