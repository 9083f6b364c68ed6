"""Results of other codes for the picture of a study, from a CSV file with their origin.

A file has one line for each run and the columns

    code, version, command, machine, source, setting, wall_s, QUANTITY, ...

with the relative error of each quantity. `command` and `machine` tell how a time was measured, `source`
where the numbers are published. An empty `wall_s` is an error without a time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from tawami.base import csv_file
from tawami.base.errors import InputError
from tawami.base.files import readable_file, reason

#: Columns before the quantities; those that may be empty.
ORIGIN = ("code", "version", "command", "machine", "source", "setting", "wall_s")
OPTIONAL = ("source", "wall_s")


@dataclass(frozen=True)
class Peer:
    """A run of another code.

    Attributes:
        origin: code, version, command, machine, source and setting.
        wall_s: Wall time [s]; NaN if it is not known.
        errors: Relative error of each quantity.
    """

    origin: dict[str, str]
    wall_s: float
    errors: dict[str, float]

    @property
    def label(self) -> str:
        """Code and version."""
        return f"{self.origin['code']} {self.origin['version']}"


def read_peers(path: str | Path) -> list[Peer]:
    """Read the runs of other codes.

    Raises:
        InputError: No such file, a column that is missing, an empty cell, or a text instead of a number.
    """
    path = readable_file("peers", path, "a CSV file with results of other codes")
    try:
        content = csv_file.read(path)
    except (OSError, ValueError) as error:
        raise InputError(f"peers '{path}' cannot be read ({reason(error)}): expected CSV") from None
    missing = [column for column in ORIGIN if column not in content.header]
    if missing:
        raise InputError(
            f"peers '{path}' has no column {', '.join(missing)}: expected {', '.join(ORIGIN)} and "
            "the errors of quantities"
        )
    return [
        _peer(path, number, dict(zip(content.header, row, strict=True)))
        for number, row in enumerate(content.rows, start=2)
    ]


def _peer(path: Path, number: int, line: dict[str, str]) -> Peer:
    for column in ORIGIN:
        if not line[column] and column not in OPTIONAL:
            raise InputError(
                f"peers '{path}', line {number}: {column} is empty: expected the origin of the run"
            )
    numbers = {name: cell for name, cell in line.items() if name not in ORIGIN and cell}
    try:
        wall = float(line["wall_s"] or math.nan)
        errors = {name: float(cell) for name, cell in numbers.items()}
    except ValueError as error:
        raise InputError(f"peers '{path}', line {number}: {error}: expected numbers") from None
    return Peer({name: line[name] for name in ORIGIN[:-1]}, wall, errors)
