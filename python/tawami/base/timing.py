"""Times and counts: seconds per stage of a solve, and totals of the process for studies of cost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from time import perf_counter, process_time


class Stopwatch:
    """Seconds per named stage, on this rank.

    Attributes:
        seconds: Wall time of each stage so far.
        cpu: Processor time of each stage so far, over all threads.
        laps: Copies of `seconds` at the start of the last step and after each of its Newton iterations.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.cpu: dict[str, float] = {}
        self.laps: list[dict[str, float]] = []

    def __call__(self, stage: str) -> Stage:
        """Add the time of the block to a stage."""
        return Stage(self, stage)

    def start(self) -> None:
        """Begin a step."""
        self.laps = [dict(self.seconds)]

    def lap(self) -> None:
        """End a Newton iteration."""
        self.laps.append(dict(self.seconds))


class Stage:
    """A block whose time is added to a stage. A class, because steps enter many short blocks."""

    __slots__ = ("_busy", "_stage", "_start", "_watch")

    def __init__(self, watch: Stopwatch, stage: str) -> None:
        self._watch, self._stage = watch, stage

    def __enter__(self) -> None:
        self._start, self._busy = perf_counter(), process_time()

    def __exit__(self, *error: object) -> None:
        seconds, cpu, stage = self._watch.seconds, self._watch.cpu, self._stage
        seconds[stage] = seconds.get(stage, 0.0) + perf_counter() - self._start
        cpu[stage] = cpu.get(stage, 0.0) + process_time() - self._busy


@dataclass
class Tally:
    """Counts since the start of the process or the last :meth:`reset`.

    Attributes:
        steps: Converged steps.
        newton_iterations: Linear solves, with those of failed steps.
        line_searches: Newton iterations that a line search shortened.
        unknowns: Largest number of reduced unknowns.
        compiling_s: Wall time of compiling forms [s]; later runs find the kernels on disk.
        compiling_cpu_s: Processor time of the same [s].
    """

    steps: int = 0
    newton_iterations: int = 0
    line_searches: int = 0
    unknowns: int = 0
    compiling_s: float = 0.0
    compiling_cpu_s: float = 0.0

    def reset(self) -> None:
        """Set all counts to 0."""
        for field in fields(self):
            setattr(self, field.name, field.default)

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Count the time of the block as compiling."""
        start, busy = perf_counter(), process_time()
        try:
            yield
        finally:
            self.compiling_s += perf_counter() - start
            self.compiling_cpu_s += process_time() - busy


#: Of this process.
tally = Tally()
