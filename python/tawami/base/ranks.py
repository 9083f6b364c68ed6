"""Collectives: sums and gathered arrays of all ranks, errors that every rank raises."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

Value = TypeVar("Value")


def sum_of(comm: Any, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Sum of the arrays of all ranks, in place."""
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, values, op=MPI.SUM)
    return values


def any_of(comm: Any, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Union of the masks of all ranks, in place."""
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, mask, op=MPI.LOR)
    return mask


def same(comm: Any, value: Value) -> Value:
    """The value that rank 0 has, on every rank."""
    if comm.size == 1:
        return value
    received: Value = comm.bcast(value)
    return received


def largest(comm: Any, value: float) -> float:
    """The largest value of all ranks, on every rank."""
    return value if comm.size == 1 else float(comm.allreduce(value, op=MPI.MAX))


def least_of(comm: Any, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The smallest of all ranks of each value, on every rank, in place."""
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, values, op=MPI.MIN)
    return values


def allgathered(comm: Any, part: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The arrays of all ranks one after the other, on every rank."""
    if comm.size == 1:
        return part
    part = np.ascontiguousarray(part)
    entries = np.array(comm.allgather(part.size))
    rows = int(entries.sum()) // int(np.prod(part.shape[1:], dtype=int))
    gathered = np.empty((rows, *part.shape[1:]), dtype=part.dtype)
    comm.Allgatherv(part, [gathered, entries])
    return gathered


def exchanged(comm: Any, rows: npt.NDArray[Any], to: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rows that all ranks send to this one.

    Args:
        comm: Communicator.
        rows: Rows of this rank.
        to: Rank to which each of them is sent.
    """
    return np.concatenate(parts_to(comm, rows, to))


def parts_to(comm: Any, values: npt.NDArray[Any], to: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
    """The values that each rank sends to this one.

    Args:
        comm: Communicator.
        values: Values of this rank.
        to: Rank to which each of them is sent.
    """
    parts: list[npt.NDArray[Any]] = comm.alltoall([values[to == rank] for rank in range(comm.size)])
    return parts


@contextmanager
def raise_together(comm: Any) -> Iterator[None]:
    """Raise an error of the block on all ranks, whichever rank it happens on, so that a driver script
    can catch it. If several ranks fail, the error of the lowest one is raised. sys.exit counts as one.

    The block must not communicate.
    """
    error: Exception | SystemExit | None = None
    try:
        yield
    except (Exception, SystemExit) as problem:
        if comm.size == 1:
            raise
        error = problem
    if comm.size == 1:
        return
    first = comm.allreduce(comm.size if error is None else comm.rank, op=MPI.MIN)
    if first == comm.size:
        return
    # the first rank too raises the copy that is sent: the same type everywhere
    received = comm.bcast(_portable(error) if comm.rank == first else None, root=first)
    raise received from (error if comm.rank == first else None)


def _portable(error: Exception | SystemExit | None) -> Exception | SystemExit:
    """An exception that can be sent to other ranks."""
    with suppress(Exception):
        MPI.pickle.loads(MPI.pickle.dumps(error))
        assert error is not None
        return error
    return RuntimeError(f"{type(error).__name__}: {error}")
