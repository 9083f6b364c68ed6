"""Progress of a run: a live line at a terminal or in a notebook, and a log file of all steps."""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

from tawami.base.errors import InputError
from tawami.base.files import check_regular, writing
from tawami.base.line import Line
from tawami.motion.pace import Step
from tawami.solve.measures import text

log = logging.getLogger("tawami")
#: The log file in the folder of a run.
LOG = "log.txt"
#: Environment variable with the level from which the log appears on standard error, as INFO.
LOG_LEVEL = "TAWAMI_LOG_LEVEL"
LEVELS = ("DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL")
FORMAT = logging.Formatter("%(asctime)s %(levelname)s %(message)s")


class Progress:
    """Reports of the steps of a phase, in the log and in the live line.

    Args:
        phase: Name of the phase.
        end: Time [s] or share at which it ends.
        unit: Of that.
        shown: Whether the live line appears; see :class:`Line`.
    """

    def __init__(self, phase: str, end: float, unit: str, shown: bool | None) -> None:
        self.phase, self.end, self.unit, self.line = phase, end, unit, Line(shown)
        self.begin(0.0)

    def begin(self, at: float) -> None:
        """Measure times from now on."""
        self._start, self._began = at, monotonic()

    @property
    def seconds(self) -> float:
        """Wall time since :meth:`begin`."""
        return monotonic() - self._began

    def step(self, number: int, at: float, step: Step, particles: int, *, last: bool) -> None:
        """Report an accepted step that ends at a time or share `at`."""
        measures = text(step.history[-1])
        log.info(
            "%s: step %d to %g %s, size %g, %d Newton iterations to %s, %d particles",
            self.phase, number, at, self.unit, step.size, step.iterations, measures, particles,
        )  # fmt: skip
        parts = (
            f"{self.phase} {at:.6g} of {self.end:g} {self.unit}",
            f"step {number} ({step.size:.3g})",
            f"Newton {step.iterations}: {measures}",
            f"{particles} particles",
            self._remaining(at),
        )
        share = 1.0 if last else (at - self._start) / (self.end - self._start)
        self.line.show(" | ".join(part for part in parts if part), share, now=last)

    def _remaining(self, at: float) -> str:
        """Estimate of the time to the end; empty before the first step."""
        if not at > self._start:
            return ""
        seconds = self.seconds * max(self.end - at, 0.0) / (at - self._start)
        return f"{duration(seconds)} left"


def duration(seconds: float) -> str:
    """Seconds as text with two units at most."""
    whole = round(seconds)
    for size, unit, small, part in ((86400, "d", 3600, "h"), (3600, "h", 60, "min")):
        if whole >= size:
            return f"{whole // size} {unit} {whole % size // small} {part}"
    return f"{whole // 60} min {whole % 60} s" if whole >= 60 else f"{whole} s"


def level() -> int:
    """Level of the log on standard error.

    Raises:
        InputError: The environment variable names no level.
    """
    name = os.environ.get(LOG_LEVEL, "WARNING").upper()
    if name not in LEVELS:
        raise InputError(f"{LOG_LEVEL} = '{name}': expected one of {', '.join(LEVELS)}")
    return logging.getLevelNamesMapping()[name]


@contextmanager
def logged(path: Path | None) -> Iterator[None]:
    """Within the block the log, with the warnings of Python, goes to a file and to standard error.

    Args:
        path: The file; an existing one is continued. None on ranks that write nothing.

    Raises:
        OutputError: The file cannot be written.
        InputError: See :func:`level`.
    """
    shown = level()
    handlers: list[logging.Handler] = [logging.NullHandler()]
    if path is not None:
        with writing(path):
            check_regular(path, new=True)
            handlers = [logging.FileHandler(path, encoding="utf-8")]
    if path is not None and LOG_LEVEL in os.environ:
        handlers.append(logging.StreamHandler())
        handlers[-1].setLevel(shown)
    before, show = (log.level, log.propagate), warnings.showwarning

    def show_and_log(message: Any, category: Any, *rest: Any, **more: Any) -> None:
        log.warning("%s: %s", category.__name__, message)
        show(message, category, *rest, **more)

    for handler in handlers:
        handler.setFormatter(FORMAT)
        log.addHandler(handler)
    log.setLevel(min(logging.INFO, shown))
    log.propagate = False  # the root logger may be configured by others, and would print every step
    warnings.showwarning = show_and_log
    try:
        yield
    finally:
        warnings.showwarning = show
        log.setLevel(before[0])
        log.propagate = before[1]
        for handler in handlers:
            log.removeHandler(handler)
            handler.close()
