"""Results of other codes for a study, from a CSV file with their origin.

A file has one line for each run and the columns

    code, version, command, machine, source, setting, wall_s, QUANTITY, ...

with the relative error of each quantity. `command` and `machine` tell how a time was measured, `source`
where the numbers are published. An empty `wall_s` is an error without a time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tawami.base import csv_file
from tawami.base.errors import InputError
from tawami.base.files import readable_file, reason
from tawami.study.row import Row, pareto, text_of
from tawami.study.table import Table

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


def peer_front(peers: Sequence[Peer], quantity: str) -> list[Peer]:
    """Timed runs of each code that no other run of the same code beats in both time and error."""
    timed = [peer for peer in peers if quantity in peer.errors and math.isfinite(peer.wall_s)]
    return [
        peer
        for label in dict.fromkeys(peer.label for peer in timed)
        for peer in pareto(
            [peer for peer in timed if peer.label == label],
            lambda peer: peer.wall_s,
            lambda peer: peer.errors[quantity],
        )
    ]


def comparison(table: Table, peers: Sequence[Peer], setting: Mapping[str, Any]) -> str:
    """Compare a setting with other codes at the same accuracy, in a table for each quantity.

    A row has a run on the front of another code, and the fastest run of the setting that is at least as
    accurate.

    Args:
        table: The runs of the study.
        peers: Runs of other codes.
        setting: Setting of the study's own series; knobs with the value `...` are chosen for each row.
    """
    free = [knob for knob, value in setting.items() if value is ...]
    fixed = {knob: value for knob, value in setting.items() if knob not in free}
    own = table.matching(setting)
    parts = [
        f"Runs of other codes, and the fastest run at least as accurate with {text_of(fixed)}:"
    ]
    for quantity in table.quantities:
        head = ["other code", f"error of {quantity}", "time", table.series[0], "error", "time",
                "other time / own"]  # fmt: skip
        lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
        for peer in peer_front(peers, quantity):
            lines.append(f"| {' | '.join(_cells(peer, own, free, quantity))} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _cells(peer: Peer, own: Sequence[Row], free: Sequence[str], quantity: str) -> list[str]:
    """Cells of a row: a run of another code, and the fastest run that is at least as accurate."""
    error, wall = peer.errors[quantity], peer.wall_s
    cells = [f"{peer.label}: {peer.origin['setting']}", f"{error:.2g}", f"{wall:.3g} s"]
    accurate = [row for row in own if row.errors[quantity] <= error]
    if not accurate:
        return [*cells, "none", "", "", ""]
    best = min(accurate, key=lambda row: row.costs["wall_s"])
    time = best.costs["wall_s"]
    chosen = text_of({knob: best.knobs[knob] for knob in free})
    return [*cells, chosen, f"{best.errors[quantity]:.2g}", f"{time:.3g} s", f"{wall / time:.3g}"]
