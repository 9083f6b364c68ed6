"""Collectives: sums and gathered arrays of all ranks, errors that every rank raises."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.linalg.blas import dnrm2

Value = TypeVar("Value")
Number = TypeVar("Number", int, float)


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


def anywhere(comm: Any, found: Any) -> bool:
    """Whether something is so on any rank."""
    return bool(any_of(comm, np.array([bool(found)]))[0])


def total(comm: Any, value: Number) -> Number:
    """Sum of the numbers of all ranks."""
    summed: Number = sum_of(comm, np.array([value]))[0].item()
    return summed


def scattered(
    comm: Any, size: int, place: npt.NDArray[Any], own: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """An array on every rank, of which each rank has some rows; the others are zero.

    Args:
        comm: Communicator.
        size: Number of its rows.
        place: Those of this rank, which no other one has.
        own: Their values.
    """
    found = np.zeros((size, *own.shape[1:]), own.dtype)
    found[place] = own
    return sum_of(comm, found)


def same(comm: Any, value: Value) -> Value:
    """The value that rank 0 has, on every rank."""
    if comm.size == 1:
        return value
    received: Value = comm.bcast(value)
    return received


def norm_of(comm: Any, own: npt.NDArray[Any]) -> float:
    """Euclidean norm of a vector of which each rank has its own entries; no square overflows."""
    of_rank = float(dnrm2(np.ascontiguousarray(own))) if len(own) else 0.0
    return of_rank if comm.size == 1 else math.hypot(*comm.allgather(of_rank))


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
    if comm.size == 1:
        return [values]
    order = np.argsort(to, kind="stable")
    ends = np.searchsorted(to[order], np.arange(1, comm.size))
    parts: list[npt.NDArray[Any]] = comm.alltoall(np.split(values[order], ends))
    return parts


def offsets(comm: Any, key: npt.NDArray[Any], count: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Sums of the counts of all smaller keys, on any rank; a collective call.

    No rank gets the keys of all: each is sent to the rank that has its share of their range.

    Args:
        comm: Communicator.
        key: Whole numbers from 0, ascending, each on one rank only.
        count: Count of each.
    """
    own = np.stack([key, count]).astype(np.int64)
    if comm.size == 1:
        return np.asarray(np.cumsum(own[1]) - own[1])
    end = comm.allreduce(int(own[0].max(initial=0)), op=MPI.MAX) + 1
    parts = comm.alltoall(_split(comm, own.T, own[0], end))
    received = np.concatenate(parts)
    order = np.argsort(received[:, 0])
    sums = np.cumsum(received[order, 1])
    before = comm.exscan(int(received[:, 1].sum())) or 0
    starts = np.empty(len(order), dtype=np.int64)
    starts[order] = before + sums - received[order, 1]
    ends = np.cumsum([len(part) for part in parts])[:-1]
    return np.concatenate(comm.alltoall(np.split(starts, ends)))


def looked_up(
    comm: Any, number: npt.NDArray[Any], rows: npt.NDArray[Any], wanted: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Rows of some numbers, 0 for numbers that no rank has; a collective call.

    Args:
        comm: Communicator.
        number: Whole numbers from 0, each on one rank only.
        rows: Row of each.
        wanted: Numbers whose rows this rank gets.
    """
    end = int(largest(comm, max(number.max(initial=0), wanted.max(initial=0)))) + 1
    share = -(-end // comm.size)
    table = np.zeros((share, *rows.shape[1:]), dtype=rows.dtype)
    table[exchanged(comm, number, number // share) - share * comm.rank] = exchanged(
        comm, rows, number // share
    )
    order = np.argsort(wanted, kind="stable")
    asked = comm.alltoall(_split(comm, wanted[order], wanted[order], share * comm.size))
    found = comm.alltoall([table[part - share * comm.rank] for part in asked])
    result = np.empty((len(wanted), *rows.shape[1:]), dtype=rows.dtype)
    result[order] = np.concatenate(found)
    return result


def _split(
    comm: Any, rows: npt.NDArray[Any], key: npt.NDArray[Any], end: int
) -> list[npt.NDArray[Any]]:
    """Rows with ascending keys below `end`, divided into equal shares of the range of the keys."""
    share = -(-end // comm.size)
    return np.split(rows, np.searchsorted(key, share * np.arange(1, comm.size)))


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
