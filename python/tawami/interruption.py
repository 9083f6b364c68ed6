"""Signals (Ctrl-C) that must not arrive in the middle of something: they wait for its end."""

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
