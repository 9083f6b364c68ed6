"""Text for headers and messages: labelled lines, lists of names, sizes."""

from __future__ import annotations

import difflib
import textwrap
from collections.abc import Iterable, Sequence

WIDTH, LABEL = 100, 13
#: Names that a line lists before it counts the rest.
MOST = 6


def labelled(label: str, text: str) -> str:
    """A text after its label, wrapped and indented."""
    return textwrap.fill(
        f"{label:{LABEL}} {text}",
        WIDTH,
        subsequent_indent=" " * (LABEL + 1),
        break_long_words=False,
        break_on_hyphens=False,
    )


def listed(texts: Sequence[str]) -> str:
    """The first few texts, and the number of the others."""
    if not texts:
        return "none"
    more = [f"{len(texts) - MOST} others"] if len(texts) > MOST else []
    return ", ".join([*texts[:MOST], *more])


def quoted(names: Iterable[object]) -> str:
    """Names in quotes, for messages."""
    return ", ".join(f"'{name}'" for name in names)


def meant(name: str, known: Iterable[str]) -> str:
    """The end of a message with the known name that is nearly this one; empty without one."""
    return suggestion(next(iter(difflib.get_close_matches(name, list(known), 1)), None))


def suggestion(name: object) -> str:
    """The end of a message that suggests a name; empty without one."""
    return "" if name is None else f"; did you mean '{name}'?"


def position(x: Iterable[float]) -> str:
    """Coordinates in parentheses, as "(0.5, 1)"."""
    return f"({', '.join(f'{c:g}' for c in x)})"


def size(number: int) -> str:
    """A number of bytes."""
    return f"{number / 1e6:.3g} MB" if number >= 1e6 else f"{number / 1e3:.3g} kB"
