"""Where the time of a solve goes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter, process_time


class Stopwatch:
    """Seconds per named stage, on this rank.

    Attributes:
        seconds: Wall time of each stage so far.
        cpu: Processor time of each stage so far, of all threads.
        laps: What `seconds` was at the start of the last step and after each of its Newton iterations.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.cpu: dict[str, float] = {}
        self.laps: list[dict[str, float]] = []

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of the block to a stage."""
        start, busy = perf_counter(), process_time()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - start
            self.cpu[stage] = self.cpu.get(stage, 0.0) + process_time() - busy

    def start(self) -> None:
        """A step begins."""
        self.laps = [dict(self.seconds)]

    def lap(self) -> None:
        """A Newton iteration ends."""
        self.laps.append(dict(self.seconds))
