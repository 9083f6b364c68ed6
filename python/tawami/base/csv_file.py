"""CSV files: a header, and rows of as many cells; decimal points, no thousands separators."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tawami.base.arrays import Array
from tawami.base.files import unreadable

#: Separators of files that are not read, and their names in messages.
OTHERS = {";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True)
class CsvFile:
    """Content of a CSV file; `read` makes one.

    Attributes:
        header: Names of the columns.
        rows: Cells of each row, as many as in the header.
        lines: Number of the last line of each row in the file.
    """

    header: list[str]
    rows: list[list[str]]
    lines: list[int]

    def column(self, place: int, *, finite: bool = True) -> Array:
        """The numbers of a column, one per row.

        Raises:
            ValueError: A cell is not a number, or, with `finite`, is NaN or infinite.
        """
        cells = [row[place] for row in self.rows]
        numbers = np.array([_number(cell) for cell in cells], dtype=float)
        wrong = np.array([cell.lower() != "nan" for cell in cells]) & np.isnan(numbers)
        if finite:
            wrong = ~np.isfinite(numbers)
        if wrong.any():
            k = int(wrong.argmax())
            raise ValueError(
                f"line {self.lines[k]}, column '{self.header[place]}': '{cells[k]}': expected a finite "
                "number with a decimal point, as -1000.5"
            )
        return numbers


def read(path: Path) -> CsvFile:
    """Read a file with commas between its cells; rows of empty cells are left out.

    Raises:
        OSError: It cannot be read.
        ValueError: It is not such a file; the message gives the line.
    """
    problem = unreadable(path)
    if problem is not None:
        raise OSError(problem)
    rows, lines = list[list[str]](), list[int]()
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file, strict=True, skipinitialspace=True)
        try:
            for row in reader:
                cells = [cell.strip() for cell in row]
                if any(cells):
                    rows.append(cells)
                    lines.append(reader.line_num)
        except UnicodeDecodeError:
            raise ValueError("it is not text in UTF-8") from None
        except csv.Error as error:
            raise ValueError(f"line {reader.line_num}: {error}") from None
    if not rows:
        raise ValueError("it is empty")
    header = rows[0]
    header[0] = header[0].removeprefix("#").strip()  # as numpy.savetxt writes it
    _check_lengths(header, rows, lines)
    return CsvFile(header, rows[1:], lines[1:])


def _check_lengths(header: Sequence[str], rows: Sequence[Sequence[str]], lines: list[int]) -> None:
    for separator, name in OTHERS.items():
        if separator in header[0] and len(header) == 1:
            raise ValueError(
                f"its header '{header[0]}' is separated by {name}: expected commas, and numbers with a "
                "decimal point"
            )
    for row, line in zip(rows, lines, strict=True):
        if len(row) != len(header):
            raise ValueError(
                f"line {line} has {len(row)} cells, and the header {len(header)}: {','.join(row)[:80]}: "
                "expected one cell for each column; numbers have a decimal point and no thousands "
                "separators"
            )


def _number(cell: str) -> float:
    """The number in a cell; NaN if it is not a number."""
    try:
        return math.nan if "_" in cell else float(cell)  # Python reads 1_000 as 1000
    except ValueError:
        return math.nan
