"""Files that several ranks write together: each writes its part of the bytes, and none has all."""

from __future__ import annotations

import functools
import os
import zlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks, ranks
from tawami.base.errors import OutputError
from tawami.base.files import check_regular, temporary, writing

#: Polynomial of the checksum of zip archives, in reversed order of its bits.
CRC = 0xEDB88320


@dataclass(frozen=True)
class Rows:
    """Rows of an array of which each rank has a block, one block after another.

    Attributes:
        own: Those of this rank.
        first: Number of rows before them.
        total: Number of rows of all ranks.
    """

    own: npt.NDArray[Any]
    first: int
    total: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the whole array."""
        return (self.total, *self.own.shape[1:])

    @property
    def row_bytes(self) -> int:
        """Bytes of a row."""
        return self.own.itemsize * int(np.prod(self.own.shape[1:], dtype=int))

    @classmethod
    def of_first_rank(cls, comm: Any, whole: npt.NDArray[Any]) -> Rows:
        """An array that every rank has, of which the first rank writes all rows."""
        return cls(
            whole if comm.rank == 0 else whole[:0], 0 if comm.rank == 0 else len(whole), len(whole)
        )


def by_number(comm: Any, number: npt.NDArray[Any]) -> Callable[[npt.NDArray[Any]], Rows]:
    """A function that sorts rows of all ranks by the numbers of their particles, into equal blocks.

    This and the function are collective calls.
    """
    if comm.size == 1:
        return lambda rows: Rows(np.asarray(rows), 0, len(rows))
    end = int(ranks.largest(comm, float(number.max(initial=0)))) + 1
    home = number.astype(np.int64) * comm.size // end
    received = ranks.exchanged(comm, np.asarray(number), home)
    order, count = np.argsort(received, kind="stable"), len(received)
    first = comm.exscan(count) or 0
    total = comm.allreduce(count)
    return lambda rows: Rows(
        ranks.exchanged(comm, np.asarray(rows), home)[order], first if comm.rank else 0, total
    )


def block(comm: Any, total: int) -> tuple[int, int]:
    """First row of this rank's block of some rows, and the row after it."""
    return total * comm.rank // comm.size, total * (comm.rank + 1) // comm.size


def in_blocks(
    comm: Any, number: npt.NDArray[Any], total: int
) -> Callable[[npt.NDArray[Any]], Rows]:
    """A function that puts rows of all ranks in the order of their numbers, into equal blocks.

    Rows that no rank has are zero. This and the function are collective calls.

    Args:
        comm: Communicator.
        number: Number of each row of this rank, from 0, which no other one has.
        total: Number of all rows.
    """
    ends = total * np.arange(1, comm.size + 1) // comm.size
    home, (first, last) = np.searchsorted(ends, number, side="right"), block(comm, total)
    place = ranks.exchanged(comm, number, home) - first

    def placed(rows: npt.NDArray[Any]) -> Rows:
        own = np.zeros((last - first, *rows.shape[1:]), rows.dtype)
        own[place] = ranks.exchanged(comm, rows, home)
        return Rows(own, first, total)

    return placed


def picked(comm: Any, given: Rows | npt.NDArray[Any], wanted: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rows with some numbers, which differ between ranks; a collective call.

    Args:
        comm: Communicator.
        given: Blocks of the ranks, or an array that every rank has.
        wanted: Numbers of the rows that this rank gets.
    """
    rows = given if isinstance(given, Rows) else Rows.of_first_rank(comm, given)
    return ranks.looked_up(comm, rows.first + np.arange(len(rows.own)), rows.own, wanted)


def write(
    comm: Any,
    path: str | Path,
    pieces: Iterable[tuple[int, Any]],
    finish: Callable[[Path], None] | None = None,
    *,
    sync: bool = False,
) -> None:
    """Write a file atomically; a call for all ranks.

    Args:
        comm: Communicator.
        path: The file.
        pieces: Places in the file [bytes], and the bytes that this rank writes there.
        finish: Function that the first rank calls with the complete temporary file.
        sync: Wait until it is on the disk.

    Raises:
        OutputError: It cannot be written; an older file at `path` is kept.
    """
    target = checks.path("path", path)
    if not target.name:
        raise OutputError(f"'{target}': expected the name of a file")
    part: Path = ranks.same(comm, temporary(target))
    try:
        with ranks.raise_together(comm), writing(target):
            if comm.rank == 0:
                check_regular(target, new=True)
                part.write_bytes(b"")
        with ranks.raise_together(comm), writing(target), part.open("r+b") as file:
            for place, data in pieces:
                file.seek(place)
                file.write(data)
            file.flush()
            if sync:
                os.fsync(file.fileno())
        with ranks.raise_together(comm), writing(target):
            if comm.rank == 0:
                if finish is not None:
                    finish(part)
                part.replace(target)
    finally:
        if comm.rank == 0:
            with suppress(OSError):  # it was never created, or its folder is gone
                part.unlink(missing_ok=True)


def crc_of(comm: Any, head: bytes, own: Any) -> int:
    """Checksum (CRC-32) of a head and the bytes of all ranks after it; a call for all ranks."""
    if comm.size == 1:
        return zlib.crc32(own, zlib.crc32(head))
    return joined(zlib.crc32(head), comm.allgather((zlib.crc32(own), len(own))))


def joined(crc: int, parts: Iterable[tuple[int, int]]) -> int:
    """Checksum of bytes, given those of their beginning and of parts after it, with lengths."""
    for other, length in parts:
        crc = _times(_zeros(length), crc) ^ other if crc else other
    return crc


@functools.lru_cache(maxsize=64)
def _zeros(length: int) -> list[int]:
    """Change of a checksum by zeros [bytes] that follow, for each of its bits.

    They multiply it by a power of x, a linear map over bits: its matrix is squared for each bit of the
    length.
    """
    result = [1 << bit for bit in range(32)]
    matrix = [CRC, *(1 << bit for bit in range(31))]  # one bit 0
    for _ in range(3):  # one byte
        matrix = [_times(matrix, column) for column in matrix]
    while length:
        if length & 1:
            result = [_times(matrix, column) for column in result]
        matrix = [_times(matrix, column) for column in matrix]
        length >>= 1
    return result


def _times(matrix: list[int], vector: int) -> int:
    result = 0
    for bit in range(32):
        if vector >> bit & 1:
            result ^= matrix[bit]
    return result
