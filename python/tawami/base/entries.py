"""Arrays in an archive of NumPy (.npz) that is not compressed: whole, or the rows of one rank."""

from __future__ import annotations

import math
import os
import struct
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from tawami.base.shared_file import Rows, block, joined

#: Bytes that are read at once for a checksum.
CHUNK = 1 << 20


@dataclass(frozen=True)
class Entry:
    """Place of an array in the file.

    Attributes:
        start: Its first byte.
        size: Its number of bytes.
        crc: Their checksum as the archive has it.
    """

    start: int
    size: int
    crc: int


class Entries:
    """The arrays of an archive by name.

    Args:
        path: The archive.
        file: The same, open for reading.

    Raises:
        OSError, ValueError, zipfile.BadZipFile: It cannot be read, or its directory is damaged.
    """

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self._file, self._of = file, dict[str, Entry]()
        with zipfile.ZipFile(path) as content:
            for one in content.infolist():
                content.open(one).close()  # compares its head with the directory
                if one.compress_type != zipfile.ZIP_STORED or one.compress_size != one.file_size:
                    raise ValueError(f"'{one.filename}' is compressed")
                file.seek(one.header_offset + 26)
                start = one.header_offset + 30 + sum(struct.unpack("<HH", file.read(4)))
                self._of[one.filename.removesuffix(".npy")] = Entry(start, one.file_size, one.CRC)

    def sums(self, comm: Any) -> list[tuple[int, int]]:
        """Checksum and number of bytes of this rank's part of each array; it reads no other one."""
        found = []
        for entry in self._of.values():
            first, last = block(comm, entry.size)
            self._file.seek(entry.start + first)
            crc, left = 0, last - first
            while left and (data := self._file.read(min(left, CHUNK))):
                crc, left = zlib.crc32(data, crc), left - len(data)
            found.append((crc, last - first - left))
        return found

    def check(self, sums: list[list[tuple[int, int]]]) -> None:
        """Compare the checksums of the archive with :meth:`sums` of all ranks.

        Raises:
            ValueError: One differs.
        """
        for (name, entry), parts in zip(self._of.items(), zip(*sums, strict=True), strict=True):
            if joined(0, parts) != entry.crc or sum(length for _, length in parts) != entry.size:
                raise ValueError(f"wrong checksum of '{name}'")

    def whole(self, name: str) -> npt.NDArray[Any]:
        """An array."""
        self._file.seek(self._of[name].start)
        array: npt.NDArray[Any] = np.lib.format.read_array(  # type: ignore[no-untyped-call]
            self._file, allow_pickle=False
        )
        return array

    def rows(self, name: str, comm: Any) -> Rows:
        """This rank's block of the rows of an array, of which it reads nothing else."""
        file = self._file
        file.seek(self._of[name].start)
        np.lib.format.read_magic(file)  # type: ignore[no-untyped-call]
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)  # type: ignore[no-untyped-call]
        first, last = block(comm, shape[0])
        row = dtype.itemsize * math.prod(shape[1:])
        file.seek(first * row, os.SEEK_CUR)
        own = np.frombuffer(file.read((last - first) * row), dtype)
        return Rows(own.reshape(last - first, *shape[1:]).copy(), first, shape[0])
