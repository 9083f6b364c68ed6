"""A line of progress: written over and over at a terminal, a bar of tqdm in a notebook."""

from __future__ import annotations

import shutil
import sys
from importlib.util import find_spec
from time import monotonic
from typing import Any, TextIO

from tawami.base.optional import optional

#: Seconds between two updates.
INTERVAL = 0.1


def progress_bar(*arguments: Any, **options: Any) -> Any:
    """A bar of `tqdm.auto`, which suits terminals and notebooks; one of text without ipywidgets.

    Raises:
        MissingDependencyError: tqdm is not installed.
    """
    return optional("tqdm.auto", "a progress bar needs").tqdm(*arguments, **options)


def in_notebook() -> bool:
    """Whether the process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


class Line:
    """A line of progress on standard error, or a bar below the cell of a notebook.

    Args:
        shown: Whether it appears; None: only at a terminal or in a notebook.
    """

    def __init__(self, shown: bool | None) -> None:
        self.stream: TextIO = sys.stderr
        notebook = in_notebook()
        self._shown = (notebook or self.stream.isatty()) if shown is None else shown
        self._has_bar = notebook and find_spec("tqdm") is not None
        self._last, self._written = -INTERVAL, False
        self._bar: Any = None

    def show(self, text: str, share: float, *, now: bool = False) -> None:
        """Update the line, unless the last update was just before.

        Args:
            text: The new text.
            share: Share that is done, from 0 to 1, for a bar.
            now: Update in any case.
        """
        if not self._shown or (not now and monotonic() - self._last < INTERVAL):
            return
        self._last, self._written = monotonic(), True
        if self._has_bar:
            if self._bar is None:
                self._bar = progress_bar(total=1.0, bar_format="{percentage:3.0f}%|{bar}| {desc}")
            self._bar.n = min(max(share, 0.0), 1.0)
            self._bar.set_description_str(text)
            return
        width = shutil.get_terminal_size().columns - 1
        self._write(f"\r{text[:width]:{width}}")

    def end(self) -> None:
        """Leave the line as it is; later output begins below it."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        elif self._written:
            self._write("\n")
        self._written = False

    def _write(self, text: str) -> None:
        try:
            self.stream.write(text)
            self.stream.flush()
        except (OSError, ValueError):  # the terminal was closed
            self._shown = False
