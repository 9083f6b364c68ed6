"""Signals: those that must not arrive in the middle of something wait for its end; SIGTERM and Ctrl-C
are noted so that a run can end in order.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

#: Those that people, batch systems and timers send.
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
    """What a driver handles in Python is handled when the block is done, also where its handler raises,
    as that of Ctrl-C does.

    Handlers run in the main thread only, and so do their exceptions: in another thread nothing is to
    be done. Masks of signals would not do: the system would give the signal to another thread.
    """
    came: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        came.append(number)

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
        for one in dict.fromkeys(came):
            signal.raise_signal(one)


def _restore(handlers: list[tuple[signal.Signals, Any]]) -> None:
    """All of them, also where one that is there again raises at once."""
    left = list(handlers)
    while left:
        number, handler = left.pop()
        try:
            signal.signal(number, handler)
        except BaseException:
            _restore(left)
            raise


class Interruption:
    """Within a block, SIGTERM and the first Ctrl-C are noted; a second Ctrl-C acts at once.

    Outside the main thread signals stay as they are.

    Attributes:
        signal: What has come; None so far.
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
        """End as the signal would have."""
        if self.signal is signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + signal.SIGTERM)
