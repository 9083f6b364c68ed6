"""Distributed arrays: each entry belongs to one rank, and other ranks hold copies of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Indices, of_components

Values = TypeVar("Values", bound=npt.NDArray[Any])
#: Places in an array of this rank by the other rank that has the same entries, in one order on both.
Places = dict[int, Indices]


class Exchange:
    """Sends entries to the ranks that hold copies, and adds what these ranks have to the entries.

    All methods are collective calls.

    Args:
        comm: Communicator.
        copies: Places of copies on this rank, by the rank that owns the entries.
        originals: Places of entries that this rank owns, by the rank that holds copies of them.
    """

    def __init__(self, comm: Any, copies: Places, originals: Places) -> None:
        self._comm, self._copies, self._originals = comm, copies, originals

    @classmethod
    def of(
        cls,
        comm: Any,
        owner: npt.NDArray[Any],
        number: Callable[[Indices], Indices],
        place: Callable[[Indices], Indices],
    ) -> Exchange:
        """The exchange of an array whose entries are at other places on other ranks; a collective call.

        Args:
            comm: Communicator.
            owner: Rank that owns each entry of this rank's array; -1 for entries without a meaning.
            number: Gives the numbers over all ranks of entries at these places.
            place: Gives the places of entries with these numbers.
        """
        if comm.size == 1:
            return cls(comm, {}, {})
        others = [np.flatnonzero(owner == rank) for rank in range(comm.size)]
        others[comm.rank] = np.empty(0, dtype=np.int64)
        wanted = comm.alltoall([number(of_rank) for of_rank in others])
        copies = {rank: of_rank for rank, of_rank in enumerate(others) if len(of_rank)}
        originals = {rank: place(numbers) for rank, numbers in enumerate(wanted) if len(numbers)}
        return cls(comm, copies, originals)

    @classmethod
    def joined(cls, comm: Any, parts: Sequence[tuple[Exchange, int, int]]) -> Exchange:
        """The exchange of several arrays of vectors, one after the other in one array.

        Args:
            comm: Communicator.
            parts: Exchange of each array, its place in the joined one, and its number of components.
        """

        def join(places: Sequence[Places]) -> Places:
            return {
                rank: np.concatenate(
                    [
                        start + of_components(of[rank], count).ravel()
                        for of, (_, start, count) in zip(places, parts, strict=True)
                        if rank in of
                    ]
                )
                for rank in sorted({rank for of in places for rank in of})
            }

        copies, originals = (
            [getattr(part, name) for part, _, _ in parts] for name in ("_copies", "_originals")
        )
        return cls(comm, join(copies), join(originals))

    def update(self, values: Values) -> Values:
        """Overwrite the copies on this rank with the entries of their owners, in place."""
        for rank, received in self._sent(values, self._originals, self._copies):
            values[self._copies[rank]] = received
        return values

    def add(self, values: Values) -> Values:
        """Add up an entry and all of its copies, on all ranks, in place.

        The sum has the same bits on all of them.
        """
        for rank, received in self._sent(values, self._copies, self._originals):
            values[self._originals[rank]] += received
        return self.update(values)

    def _sent(self, values: Any, to: Places, of: Places) -> list[tuple[int, Any]]:
        """Entries that other ranks send, in the order of the ranks."""
        if self._comm.size == 1:
            return []
        shape = values.shape[1:]
        received = {rank: np.empty((len(p), *shape), values.dtype) for rank, p in of.items()}
        requests = [
            self._comm.Irecv(_bytes(array), source=rank) for rank, array in received.items()
        ]
        parts = {rank: np.ascontiguousarray(values[p]) for rank, p in to.items()}
        requests += [self._comm.Isend(_bytes(part), dest=rank) for rank, part in parts.items()]
        for request in requests:
            request.Wait()
        return sorted(received.items(), key=lambda item: item[0])


def _bytes(array: npt.NDArray[Any]) -> Any:
    return array.reshape(-1).view(np.uint8)
