"""Rows of a study as a table: text, aligned, or CSV. Nothing of tawami."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any


def as_text(rows: Sequence[Any], columns: Sequence[str]) -> str:
    """Attributes of the rows, six digits, aligned; None is a dash."""

    def text(value: Any) -> str:
        if value is None:
            return "-"
        return value if isinstance(value, str) else f"{value:.6g}"

    lines = [tuple(columns)] + [tuple(text(getattr(row, c)) for c in columns) for row in rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    return "\n".join(
        "  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True))
        for line in lines
    )


def as_csv(rows: Sequence[Any], columns: Sequence[str]) -> str:
    """Attributes of the rows, numbers in full, blanks for None."""
    file = io.StringIO()
    writer = csv.writer(file)
    writer.writerow(columns)
    writer.writerows([getattr(row, c) for c in columns] for row in rows)
    return file.getvalue()
