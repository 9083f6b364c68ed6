"""Numbers that a driver script gives for particles, and that follow them from rank to rank."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices
from tawami.base.meaning import ALIKE, ROUND_OFF
from tawami.base.shared_file import Rows, by_number
from tawami.particles import placement

Numbers = npt.NDArray[np.integer[Any]]
#: Multiples of these numbers, modulo 1, are spread evenly: the weights of a fingerprint.
SPREAD = (np.sqrt(1.25) - 0.5, np.sqrt(2.0))


def fingerprint(comm: Any, number: Numbers, values: Array, size: float) -> float:
    """As `tawami.base.meaning.fingerprint`, of values of the particles of all ranks; a collective call.

    Args:
        comm: Communicator.
        number: Numbers of the particles of this rank.
        values: Their values, particles or particles x components.
        size: Size of the values.
    """
    columns = values if values.ndim > 1 else values[:, None]
    along, across = SPREAD
    weights = 0.5 + (along * number[:, None] + across * np.arange(columns.shape[1])) % 1
    own = [(weights * columns + 2 * np.abs(columns)).sum(), columns.size]
    total, count = ranks.sum_of(comm, np.array(own, dtype=float))
    return float(total + count * ROUND_OFF * size / ALIKE)


def fingerprints(
    comm: Any, particles: _rust.Particles, sizes: Mapping[str, float]
) -> dict[str, float]:
    """Fingerprints of all arrays of the particles by name; a collective call.

    Args:
        comm: Communicator.
        particles: The particles of this rank.
        sizes: Sizes of their values by name, 1 by default.
    """
    found = placement.arrays(particles).items()
    return {n: fingerprint(comm, particles.number, a, sizes.get(n, 1.0)) for n, a in found}


class OfParticles:
    """Numbers for some particles of a body, 0 for the others; all methods are collective calls.

    Args:
        comm: Communicator.
        number: Numbers of the particles.
        values: Values of each, particles or particles x components.
        everywhere: Whether every rank gives all of them; else each particle is given on one rank only.
    """

    def __init__(self, comm: Any, number: Indices, values: Array, *, everywhere: bool) -> None:
        self._comm, self._everywhere = comm, everywhere
        order = np.argsort(number, kind="stable")
        self.number, self.values = number[order], values[order]
        self._last: tuple[Indices, Array] | None = None
        self._any = ranks.anywhere(comm, np.any(values))

    def __bool__(self) -> bool:
        """Whether any value is not 0."""
        return self._any

    def at(self, number: Numbers) -> Array:
        """The values of the particles with these numbers."""
        wanted = number.astype(np.int64)
        known = self._last is not None and np.array_equal(wanted, self._last[0])
        if ranks.anywhere(self._comm, not known):
            self._last = wanted, self._found(wanted)
        assert self._last is not None
        return self._last[1]

    def _found(self, wanted: Indices) -> Array:
        if not self._everywhere and self._comm.size > 1:
            return np.asarray(ranks.looked_up(self._comm, self.number, self.values, wanted))
        found = np.zeros((len(wanted), *self.values.shape[1:]))
        place = np.minimum(np.searchsorted(self.number, wanted), len(self.number) - 1)
        if len(self.number):
            same = self.number[place] == wanted
            found[same] = self.values[place[same]]
        return found

    @property
    def _own(self) -> slice:
        """Those that this rank counts in sums over all ranks."""
        return slice(0 if self._everywhere and self._comm.rank else None)

    def state(self) -> dict[str, Any]:
        """All of them in the order of the numbers, for a checkpoint."""
        own = self._own
        sort = by_number(self._comm, self.number[own])
        return {"number": sort(self.number[own]), "values": sort(self.values[own])}

    @classmethod
    def of_state(cls, comm: Any, state: Mapping[str, Any]) -> OfParticles:
        """The reverse of :meth:`state`."""
        number, values = state["number"], state["values"]
        if isinstance(number, Rows):
            return cls(comm, number.own, values.own, everywhere=False)
        return cls(comm, number, values, everywhere=True)

    def identity(self) -> float:
        """A number that other values hardly share."""
        own = self._own
        values = self.values[own]
        most = ranks.largest(self._comm, float(np.abs(values).max(initial=0.0)))
        return fingerprint(self._comm, self.number[own], values, most)
