"""Output of numbers in time as a CSV table."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Sequence
from pathlib import Path

from tawami.base.errors import InputError, OutputError
from tawami.base.files import append_line, atomic_file, reason, result_folder
from tawami.base.ranks import raise_together
from tawami.motion.observer import Snapshot, Subject
from tawami.results.columns import Columns, columns, usual_columns
from tawami.results.output import Output


class TableOutput(Output):
    """A row at each time: step, time, and the quantities.

    Args:
        names: 'energies', 'momentum', 'angular momentum', 'reaction left' or another part of the border,
            'reaction (2, 0)' of a point with a support, 'displacement (2, 0)' since the start of a
            point of the body at the start, 'run-out' (the largest x), 'particles' (those that have
            not left), 'Newton iterations', 'step size'.
        every, every_steps: When; see `Output`. Every step by default.
        name: Of the file.
        phases: As in `Output`.
    """

    takes_quantities = False

    def __init__(
        self,
        *names: str,
        every: float | None = None,
        every_steps: int | None = None,
        name: str = "table",
        phases: Sequence[str] | None = None,
    ) -> None:
        super().__init__(names, every, every_steps, name, phases)

    def _resolve(self, subject: Subject) -> None:
        self._columns: list[Columns] = columns(
            [str(name) for name in self.names] or usual_columns(subject), subject
        )

    def _open(self, folder: Path, last: int | None, subject: Subject) -> None:
        self.path = result_folder(folder) / f"{self.name}.csv"
        time = "pseudo-time [-]" if subject.motion is None else "time [s]"
        labels = [label for column in self._columns for label in column.labels]
        rows = [_row(["step [-]", time, *labels])]
        if last is not None and os.path.lexists(self.path):
            rows += self._rows_until(last, rows[0])
        with atomic_file(self.path) as part:
            part.write_text("".join(f"{row}\n" for row in rows))

    def _rows_until(self, last: int, head: str) -> list[str]:
        """Rows of the existing table up to a step; a last row that was cut off is left out."""
        try:
            text = self.path.read_text()
        except (OSError, ValueError) as error:
            raise OutputError(
                f"'{self.path}' cannot be read ({reason(error)}): expected the table as this run wrote "
                "it; remove it to start a new table"
            ) from error
        found, *rows = text.split("\n")[:-1] or [""]
        if found != head:
            raise InputError(
                f"'{self.path}' has the columns {found}, and {head} are requested: expected the same "
                "columns in a run that is resumed; give the new table another name="
            )
        return [row for row in rows if _step(row) <= last]

    def _write(self, snapshot: Snapshot, size: float) -> None:
        values = [float(v) for column in self._columns for v in column.of(snapshot, size)]
        comm = snapshot.scene.grid.comm
        with raise_together(comm):
            if comm.rank == 0:
                append_line(self.path, _row([snapshot.step, float(snapshot.time), *values]))


def _row(values: Sequence[object]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(values)
    return text.getvalue()


def _step(row: str) -> float:
    """Number of the step of a row; infinite if the row is damaged."""
    number = row.partition(",")[0]
    return int(number) if number.isdecimal() else math.inf
