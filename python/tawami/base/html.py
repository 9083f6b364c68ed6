"""Tables in HTML, as notebooks show them."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape


def table(title: str, rows: Mapping[str, str]) -> str:
    """A table of two columns, labels and texts; empty texts are left out."""
    cell = "<td style='text-align: left'>"
    lines = [
        f"<tr><th style='text-align: left'>{escape(label)}</th>{cell}{escape(text)}</td></tr>"
        for label, text in rows.items()
        if text
    ]
    return f"<table><caption>{escape(title)}</caption>{''.join(lines)}</table>"
