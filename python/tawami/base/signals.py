"""Signals: deferred while a step is stored; SIGTERM and Ctrl-C noted, so that a run ends in order."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

#: Signals that users, batch systems and timers send.
SIGNALS = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGALRM,
    signal.SIGUSR1,
    signal.SIGUSR2,
    signal.SIGHUP,
)


@contextmanager
def deferred() -> Iterator[None]:
    """Defer Python's handlers of signals to the end of the block, also those that raise as Ctrl-C does.

    Handlers and their exceptions run in the main thread only, so that nothing is done in other threads.
    Signal masks would not help: the system would deliver the signal to another thread.
    """
    arrived: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        arrived.append(number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    found = [(number, signal.getsignal(number)) for number in SIGNALS]
    handlers = [(number, handler) for number, handler in found if callable(handler)]
    try:
        for number, _ in handlers:
            signal.signal(number, note)
        yield
    finally:
        _restore(handlers)
        for one in dict.fromkeys(arrived):
            signal.raise_signal(one)


def _restore(handlers: list[tuple[signal.Signals, Any]]) -> None:
    """Restore all handlers, even if one of them is called and raises in between."""
    left = list(handlers)
    while left:
        number, handler = left.pop()
        try:
            signal.signal(number, handler)
        except BaseException:
            _restore(left)
            raise


class Interruption:
    """Context manager that notes SIGTERM and the first Ctrl-C; a second Ctrl-C interrupts at once.

    Outside the main thread it does nothing.

    Attributes:
        signal: The signal that arrived; None so far.
    """

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for one in (signal.SIGINT, signal.SIGTERM):
                self._before[one] = signal.signal(one, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for one, handler in self._before.items():
            signal.signal(one, handler)
        self._before.clear()

    def _note(self, number: int, _frame: FrameType | None) -> None:
        if self.signal is signal.SIGINT and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.signal = signal.Signals(number)

    def end(self) -> None:
        """End the program as the signal would have done."""
        if self.signal is signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + signal.SIGTERM)
