"""Values of coefficients of the whole grid, each on the rank that owns it."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array, Indices
from tawami.base.shared_file import Rows, in_blocks


class Owned:
    """Values of coefficients after a step, without the layout that they come from.

    Args:
        comm: Communicator.
        number: Number in the whole grid of each coefficient of this rank, ascending; None on one rank,
            which has all.
        values: Their values.
        size: Number of coefficients of the whole grid.
    """

    def __init__(self, comm: Any, number: Indices | None, values: Array, size: int) -> None:
        self._comm, self._number, self._values, self._size = comm, number, values, size

    @functools.cached_property
    def whole(self) -> Array:
        """Values of all coefficients, zero where there are no particles; the first use is a call for all
        ranks.
        """
        if self._number is None:
            return self._values
        return ranks.scattered(self._comm, self._size, self._number, self._values)

    @property
    def rows(self) -> Rows:
        """Values of all coefficients in equal blocks, as :attr:`whole`; a call for all ranks."""
        if self._number is None:
            return Rows(self._values, 0, self._size)
        return in_blocks(self._comm, self._number, self._size)(self._values)

    def picked(self, number: Indices) -> Array:
        """Values of some coefficients, which differ between ranks; a call for all ranks."""
        if self._number is None:
            return np.asarray(self._values[number])
        return ranks.looked_up(self._comm, self._number, self._values, number)

    def at(self, number: Indices) -> Array:
        """Values of some coefficients, the same on every rank; a call for all ranks."""
        if self._number is None:
            return np.asarray(self._values[number])
        found = np.zeros(number.shape)
        if len(self._number):
            place = np.searchsorted(self._number, number) % len(self._number)
            found = np.where(self._number[place] == number, self._values[place], 0.0)
        return ranks.sum_of(self._comm, found)
