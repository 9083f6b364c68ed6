"""What this process has solved so far: counted for studies of cost, read by nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from time import perf_counter, process_time


@dataclass
class Tally:
    """Counts since the start or the last :meth:`reset`.

    Attributes:
        steps: Converged steps.
        newton_iterations: Linear solves, those of steps that failed too.
        unknowns: Reduced unknowns, the most that were solved for.
        compiling_s: Seconds of turning forms into kernels, which later runs find on disk.
        compiling_cpu_s: Processor time of the same.
    """

    steps: int = 0
    newton_iterations: int = 0
    unknowns: int = 0
    compiling_s: float = 0.0
    compiling_cpu_s: float = 0.0

    def reset(self) -> None:
        """Begin anew."""
        for field in fields(self):
            setattr(self, field.name, field.default)

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """The block turns a form into kernels."""
        start, busy = perf_counter(), process_time()
        try:
            yield
        finally:
            self.compiling_s += perf_counter() - start
            self.compiling_cpu_s += process_time() - busy


#: Of this process.
tally = Tally()
