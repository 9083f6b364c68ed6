"""Rows of a study as a table: aligned text, CSV or Markdown. Imports nothing of tawami."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any


def as_text(rows: Sequence[Any], columns: Sequence[str]) -> str:
    """Format attributes of the rows as aligned text, with six digits and a dash for None."""
    lines = [tuple(columns)]
    lines += [tuple(_text(getattr(row, c), "-") for c in columns) for row in rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    return "\n".join(
        "  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True))
        for line in lines
    )


def as_csv(rows: Sequence[Any], columns: Sequence[str]) -> str:
    """Format attributes of the rows as CSV, with all digits and an empty cell for None."""
    file = io.StringIO()
    writer = csv.writer(file)
    writer.writerow(columns)
    writer.writerows([getattr(row, c) for c in columns] for row in rows)
    return file.getvalue()


def as_markdown(rows: Sequence[Any], columns: Sequence[str]) -> str:
    """Format attributes of the rows as Markdown, with six digits and an empty cell for None."""
    lines = ["| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns)]
    lines += ["| " + " | ".join(_text(getattr(r, c), "") for c in columns) + " |" for r in rows]
    return "\n".join(lines)


def _text(value: Any, blank: str) -> str:
    if value is None:
        return blank
    return f"{value:.6g}" if isinstance(value, float) else str(value)
