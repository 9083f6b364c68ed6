"""Arrays of the particles of all ranks, gathered when they are read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy.typing as npt

from tawami.base import ranks
from tawami.particles import placement


class Gathered(Mapping[str, npt.NDArray[Any]]):
    """Arrays of the particles of all ranks, in the order of the numbers; reading one is a call for all
    ranks, which gathers it.

    Args:
        comm: Communicator.
        own: The arrays of this rank, `number` among them.
    """

    def __init__(self, comm: Any, own: Mapping[str, npt.NDArray[Any]]) -> None:
        self._comm, self.own = comm, own
        self._in_order: Callable[[npt.ArrayLike], Any] | None = None

    @property
    def num_particles(self) -> int:
        """Number of particles of all ranks; a collective call."""
        return ranks.total(self._comm, len(self.own["number"]))

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        if self._comm.size == 1:
            return self.own[name]
        if self._in_order is None:
            self._in_order = placement.in_order(self._comm, self.own["number"])
        found: npt.NDArray[Any] = self._in_order(self.own[name])
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self.own)

    def __len__(self) -> int:
        return len(self.own)
