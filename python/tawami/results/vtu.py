"""VTU files: unstructured grids of VTK, whose arrays follow the XML as raw bytes.

Each rank writes its own rows.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from tawami.base import checks, shared_file
from tawami.base.errors import OutputError
from tawami.base.shared_file import Rows
from tawami.results.frame import Frame

ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
#: Numbers of types of cells in VTK.
TYPES = {"vertex": 1, "line": 3, "quad": 9}
#: Types of arrays in VTK.
NAMES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "i4": "Int32", "u8": "UInt64",
         "u4": "UInt32", "u1": "UInt8", "i1": "Int8", "b1": "UInt8"}  # fmt: skip
#: Bytes of an array before it in the file: their number.
HEAD = np.uint64


def write_vtu(path: str | Path, frame: Frame, comm: Any = MPI.COMM_SELF) -> None:
    """Write a VTU file; a call for all ranks.

    It is not compressed: zlib takes eight times as long (`cases/costs/writing.py`).

    Raises:
        OutputError: The file cannot be written, or has another ending.
    """
    if checks.path("path", path).suffix != ".vtu":
        raise OutputError(f"'{path}': expected a file name ending in .vtu")
    cells = frame.rows(comm, frame.cells)
    corners = cells.own.shape[1]
    offsets = corners * (1 + cells.first + np.arange(len(cells.own), dtype=np.int64))
    types = np.full(len(cells.own), TYPES[frame.kind], dtype=np.uint8)
    arrays = {
        "Points": {"Points": frame.rows(comm, frame.points)},
        "Cells": {
            "connectivity": Rows(cells.own.astype(np.int64), cells.first, cells.total),
            "offsets": Rows(offsets, cells.first, cells.total),
            "types": Rows(types, cells.first, cells.total),
        },
        "PointData": {name: frame.rows(comm, of) for name, of in frame.on_points.items()},
        "CellData": {name: frame.rows(comm, of) for name, of in frame.on_cells.items()},
    }
    words = [
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{ORDER}" '
        'header_type="UInt64">\n<UnstructuredGrid>',
        f'<Piece NumberOfPoints="{frame.rows(comm, frame.points).total}" '
        f'NumberOfCells="{cells.total}">',
    ]
    blocks, place = list[tuple[int, Rows]](), 0
    for group, of_group in arrays.items():
        words.append(f"<{group}>")
        for name, rows in of_group.items():
            words.append(_line(name, rows, place))
            blocks.append((place, rows))
            place += HEAD().itemsize + rows.total * rows.row_bytes
        words.append(f"</{group}>")
    words.append('</Piece>\n</UnstructuredGrid>\n<AppendedData encoding="raw">\n_')
    begin = "\n".join(words).encode()
    end = b"\n</AppendedData>\n</VTKFile>\n"
    pieces: list[tuple[int, Any]] = []
    if comm.rank == 0:
        pieces += [(0, begin), (len(begin) + place, end)]
        pieces += [
            (len(begin) + at, HEAD(rows.total * rows.row_bytes).tobytes()) for at, rows in blocks
        ]
    pieces += [
        (len(begin) + at + HEAD().itemsize + rows.first * rows.row_bytes, _bytes(rows.own))
        for at, rows in blocks
    ]
    shared_file.write(comm, path, pieces)


def _line(name: str, rows: Rows, place: int) -> str:
    kind = NAMES[rows.own.dtype.str[1:]]
    many = rows.own.ndim > 1 and name != "connectivity"
    columns = f' NumberOfComponents="{rows.own.shape[1]}"' if many else ""
    facts = f'type="{kind}" Name={quoteattr(name)}{columns} format="appended" offset="{place}"'
    return f"<DataArray {facts}/>"


def _bytes(own: npt.NDArray[Any]) -> memoryview:
    return np.ascontiguousarray(own).reshape(-1).view(np.uint8).data
