"""One live line at a terminal, and a log file with the whole history of a run."""

from __future__ import annotations

import logging
import os
import shutil
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any, TextIO

from tawami.base.errors import InputError

log = logging.getLogger("tawami")
#: Level from which the log is shown on standard error too, as in TAWAMI_LOG_LEVEL=INFO.
LOG_LEVEL = "TAWAMI_LOG_LEVEL"
FORM = logging.Formatter("%(asctime)s %(levelname)s %(message)s")
#: Seconds between two states of the live line.
OFTEN = 0.1


class Line:
    """A line that is written over and over.

    Args:
        stream: Where to.
        shown: Whether it is; where the stream is a terminal by default.
    """

    def __init__(self, shown: bool | None, stream: TextIO | None = None) -> None:
        self.stream = sys.stderr if stream is None else stream
        self._shown = self.stream.isatty() if shown is None else shown
        self._last, self._written = -OFTEN, False

    def show(self, text: str, *, now: bool = False) -> None:
        """Write a state of the line, unless the last one is too young."""
        if not self._shown or (not now and monotonic() - self._last < OFTEN):
            return
        self._last, self._written = monotonic(), True
        width = shutil.get_terminal_size().columns - 1
        self._write(f"\r{text[:width]:{width}}")

    def end(self) -> None:
        """Leave it as it is, what follows stands below."""
        if self._written:
            self._write("\n")
        self._written = False

    def _write(self, text: str) -> None:
        try:
            self.stream.write(text)
            self.stream.flush()
        except (OSError, ValueError):  # a terminal that is gone
            self._shown = False


class Remaining:
    """How long a run will take, by how far it has come since this began.

    Args:
        at: Where it begins.
        end: Where it ends.
    """

    def __init__(self, at: float, end: float) -> None:
        self._start, self._end, self._began = at, end, monotonic()

    def text(self, at: float) -> str:
        """In words; empty as long as nothing is known."""
        if not at > self._start:
            return ""
        seconds = (monotonic() - self._began) * max(self._end - at, 0.0) / (at - self._start)
        return f"{duration(seconds)} left"


def duration(seconds: float) -> str:
    """Seconds in words of two units at most."""
    whole = round(seconds)
    for size, unit, small, part in ((86400, "d", 3600, "h"), (3600, "h", 60, "min")):
        if whole >= size:
            return f"{whole // size} {unit} {whole % size // small} {part}"
    return f"{whole // 60} min {whole % 60} s" if whole >= 60 else f"{whole} s"


def level() -> int:
    """Level of the log on standard error.

    Raises:
        InputError: The variable names no level.
    """
    name = os.environ.get(LOG_LEVEL, "WARNING").upper()
    levels = ("DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL")
    if name not in levels:
        raise InputError(f"{LOG_LEVEL} = '{name}': expected one of {', '.join(levels)}")
    return logging.getLevelNamesMapping()[name]


@contextmanager
def logged(path: Path | None) -> Iterator[None]:
    """Within the block the log, with what Python warns of, goes to a file and to standard error.

    Args:
        path: The file, which is continued; None on ranks that write nothing.
    """
    if path is None:
        yield
        return
    shown = level()
    handlers: list[logging.Handler] = [logging.FileHandler(path, encoding="utf-8")]
    if LOG_LEVEL in os.environ:
        handlers.append(logging.StreamHandler())
        handlers[-1].setLevel(shown)
    before, show = (log.level, log.propagate), warnings.showwarning

    def noted(message: Any, category: Any, *rest: Any, **more: Any) -> None:
        log.warning("%s: %s", category.__name__, message)
        show(message, category, *rest, **more)

    for handler in handlers:
        handler.setFormatter(FORM)
        log.addHandler(handler)
    log.setLevel(min(logging.INFO, shown))
    log.propagate = False  # others configure the root logger, and would print every step
    warnings.showwarning = noted
    try:
        yield
    finally:
        warnings.showwarning = show
        log.setLevel(before[0])
        log.propagate = before[1]
        for handler in handlers:
            log.removeHandler(handler)
            handler.close()
