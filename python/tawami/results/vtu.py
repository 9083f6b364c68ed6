"""VTU files: unstructured grids of VTK, whose arrays are numbers in base64.

On one rank meshio writes them. It needs all rows, which no rank has on several: there each rank writes
its own rows into the same file.
"""

from __future__ import annotations

import binascii
import sys
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from mpi4py import MPI

from tawami.base import checks, shared_file
from tawami.base.errors import OutputError
from tawami.base.files import atomic_file
from tawami.base.shared_file import Rows
from tawami.results.frame import Frame

ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
#: Numbers of types of cells in VTK.
TYPES = {"vertex": 1, "line": 3, "quad": 9}
#: Types of arrays in VTK.
NAMES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "i4": "Int32", "u8": "UInt64",
         "u4": "UInt32", "u1": "UInt8", "i1": "Int8", "b1": "UInt8"}  # fmt: skip


def write_vtu(path: str | Path, frame: Frame, comm: Any = MPI.COMM_SELF) -> None:
    """Write a VTU file; a call for all ranks.

    It is not compressed: zlib takes eight times as long (`cases/costs/writing.py`).

    Raises:
        OutputError: The file cannot be written, or has another ending.
    """
    if checks.path("path", path).suffix != ".vtu":
        raise OutputError(f"'{path}': expected a file name ending in .vtu")
    if comm.size == 1:
        _write_by_meshio(path, frame)
        return
    cells = frame.of_cells(comm, frame.cells)
    corners = cells.own.shape[1]
    offsets = corners * (1 + cells.first + np.arange(len(cells.own), dtype=np.int64))
    types = np.full(len(cells.own), TYPES[frame.kind], dtype=np.uint8)
    arrays = {
        "Points": {"Points": frame.of_points(comm, frame.points)},
        "Cells": {
            "connectivity": Rows(cells.own.astype(np.int64), cells.first, cells.total),
            "offsets": Rows(offsets, cells.first, cells.total),
            "types": Rows(types, cells.first, cells.total),
        },
        "PointData": {name: frame.of_points(comm, of) for name, of in frame.on_points.items()},
        "CellData": {name: frame.of_cells(comm, of) for name, of in frame.on_cells.items()},
    }
    points = arrays["Points"]["Points"].total
    words = [
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="{ORDER}" '
        f'header_type="UInt64">\n<UnstructuredGrid>\n<Piece NumberOfPoints="{points}" '
        f'NumberOfCells="{cells.total}">\n'
    ]
    pieces, place = list[tuple[int, bytes]](), 0
    for group, of_group in arrays.items():
        words.append(f"<{group}>\n")
        for name, rows in of_group.items():
            text = "".join([*words, _line(name, rows)]).encode()
            if comm.rank == 0:
                pieces.append((place, text))
            first, code, length = _encoded(comm, rows)
            place += len(text)
            pieces.append((place + first, code))
            place, words = place + length, ["</DataArray>\n"]
        words.append(f"</{group}>\n")
    words.append("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")
    if comm.rank == 0:
        pieces.append((place, "".join(words).encode()))
    shared_file.write(comm, path, pieces)


def _write_by_meshio(path: str | Path, frame: Frame) -> None:
    import meshio  # here: a scene without output does not need it

    on_cells = {name: [values] for name, values in frame.on_cells.items()}
    mesh = meshio.Mesh(
        frame.points, [(frame.kind, frame.cells)], point_data=frame.on_points, cell_data=on_cells
    )
    with atomic_file(path) as part:
        meshio.vtu.write(part, mesh, compression=None)


def _line(name: str, rows: Rows) -> str:
    kind = NAMES[rows.own.dtype.str[1:]]
    many = rows.own.ndim > 1 and name != "connectivity"
    columns = f' NumberOfComponents="{rows.own.shape[1]}"' if many else ""
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{columns} format="binary">'


def _encoded(comm: Any, rows: Rows) -> tuple[int, bytes, int]:
    """The part of an array in base64 that this rank writes, its place in the whole, and the length of
    that; a call for all ranks.

    Three bytes are four letters: each rank begins at a multiple of three bytes and adds up to two bytes
    of the next ones.
    """
    size = rows.total * rows.row_bytes
    head = np.uint64(size).tobytes()
    own = np.ascontiguousarray(rows.own).tobytes()
    begin = len(head) + rows.first * rows.row_bytes
    if comm.rank == 0:
        own, begin = head + own, 0
    behind = b"".join(comm.allgather(own[:2])[comm.rank + 1 :])[:2]
    skipped, end = -begin % 3, begin + len(own)
    code = binascii.b2a_base64((own + behind[: -end % 3])[skipped:], newline=False)
    return 4 * ((begin + skipped) // 3), code, 4 * (-(-(size + len(head)) // 3))
